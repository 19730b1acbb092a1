"""The world stops itself as the timeline asks for: its launcher strikes it, and wakes it again."""

import os
import signal
import time
from collections.abc import Callable

from worldsim.engine.operations import StopWorldProcess
from worldsim.fleet.fork import request_death_signal
from worldsim.fleet.launcher_link import LauncherLink
from worldsim.judge.event import By

POLL_S = 0.25
STRUCK_WITHIN_S = 10.0


def stop_world(
    operation: StopWorldProcess,
    launcher: LauncherLink,
    speed: float,
    should_stop: Callable[[], bool],
    by: By = None,
) -> float:
    """Let the launcher stop this process; return how long it stood still [s; wall time].

    A kill does not return. speed: simulated seconds in a second of wall time. by: who asked for the
    stop. Raises TimeoutError where the launcher does not strike.
    """
    began_s = time.monotonic()
    # A stopped process would not take the signal that lets it finish when the launcher dies.
    request_death_signal(os.getppid(), signal.SIGKILL)
    for_s = operation.for_s / speed
    launcher.stop("world", operation.cause, for_s, by)
    while not launcher.is_woken() and not should_stop():
        launcher.wait(POLL_S)
        if time.monotonic() - began_s > for_s + STRUCK_WITHIN_S:
            raise TimeoutError(f"the launcher did not {operation.cause} the world")
    request_death_signal(os.getppid(), signal.SIGTERM)
    return time.monotonic() - began_s
