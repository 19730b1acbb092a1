"""Whether a user's controller can be imported without harm to the process that imports it.

Any code may stand at a module's top level. It is tried in a child first.
"""

import os
import signal
import time
from contextlib import suppress
from functools import cache

from agent.controller import BUILT_IN, load
from worldsim.fleet.fork import ProcessExit, fork, reap

IMPORT_WITHIN_S = 60.0
POLL_S = 0.005
SURVIVED = 77
"""Exit status of a child in which the import returned or raised an error."""


@cache
def import_problem(name: str) -> str | None:
    """Return how the import of a controller ends or blocks its process; None: it does neither.

    An import that raises an error is not reported here; the flight imports it again.
    """
    if name in BUILT_IN:
        return None
    output = os.open(os.devnull, os.O_WRONLY)
    pid = fork(output, signal.SIGKILL, lambda: _import(name))
    os.close(output)
    deadline = time.monotonic() + IMPORT_WITHIN_S
    while (ended := reap(pid)) is None:
        if time.monotonic() > deadline:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            return f"its import did not return within {IMPORT_WITHIN_S:g} s"
        time.sleep(POLL_S)
    return None if ended == ProcessExit(None, SURVIVED) else f"the process that imports it {ended}"


def _import(name: str) -> int:
    with suppress(Exception, SystemExit, GeneratorExit):
        load(name)
    return SURVIVED
