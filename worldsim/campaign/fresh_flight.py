"""A flight in a fresh interpreter, where the process that starts it has loaded rerun.

A forked child cannot record after its parent has. The command line never loads rerun before it
starts a flight; a program that uses these packages may.
"""

import os
import pickle
import sys
from pathlib import Path
from typing import NamedTuple, NoReturn

from worldsim.campaign.flight import Kept, fly_in_child
from worldsim.campaign.pulse import Pulse
from worldsim.results.run_folder import RunDirectory
from worldsim.scenario.tables import Scenario

_PROGRAM = "from worldsim.campaign.fresh_flight import main; main()"


class _Task(NamedTuple):
    """What the fresh interpreter has to know."""

    scenario: Scenario
    folder: Path
    kept: Kept
    pulse: int
    """The descriptor of the pulse's memory."""


def is_needed() -> bool:
    """Return whether a child that was merely forked could hang."""
    return "rerun" in sys.modules


def fly_in_fresh_child(scenario: Scenario, folder: Path, kept: Kept, pulse: Pulse) -> NoReturn:
    """Replace this process by a fresh one that flies."""
    task = os.memfd_create("qswarm-flight")
    os.write(task, pickle.dumps(_Task(scenario, folder, kept, pulse.descriptor)))
    os.lseek(task, 0, os.SEEK_SET)
    os.set_inheritable(task, True)
    os.set_inheritable(pulse.descriptor, True)
    program = [sys.executable, "-c", _PROGRAM, str(task)]
    path = os.pathsep.join([str(Path.cwd()) if entry == "" else entry for entry in sys.path])
    os.execve(sys.executable, program, {**os.environ, "PYTHONPATH": path})


def main() -> NoReturn:
    """Fly what the descriptor of the first argument holds."""
    with os.fdopen(int(sys.argv[1]), "rb") as file:
        task: _Task = pickle.load(file)
    pulse = Pulse(task.pulse)
    status = fly_in_child(task.scenario, RunDirectory(task.folder), task.kept, pulse)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
