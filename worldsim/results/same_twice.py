"""Whether a run that was flown twice is the same twice, in words and as an exit status."""

from collections.abc import Callable
from pathlib import Path
from shutil import rmtree
from typing import NamedTuple

from worldsim.results.exit_status import FAIL, INCONCLUSIVE, INTERRUPTED, PASS
from worldsim.results.run_folder import RunDirectoryError, RunWriteError
from worldsim.results.trace_file import remove_trace, slots_in, trace_parting
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario

AGAIN = "again"
"""The folder of the second run, in that of the first one; it stays where they differ."""
ENDED = (PASS, FAIL, INCONCLUSIVE)
"""Exit statuses of a run that ended by itself."""


class Verified(NamedTuple):
    """What the second run showed."""

    status: int  # of the exit
    text: str


def verify_twice(
    scenario: Scenario, folder: Path, status: int, again: Callable[[Path], int]
) -> Verified:
    """Fly a run again, compare the traces, and keep them only where they differ.

    folder: of the first run. status: its exit status. again: flies it into a folder and returns the
    exit status. Raises RunWriteError.
    """
    second = folder / AGAIN
    if status not in ENDED:
        return Verified(status, "not verified: the first run did not end by itself")
    try:
        status_2 = again(second)
        if status_2 == INTERRUPTED:
            return Verified(INTERRUPTED, "not verified: interrupted")
        return _compared(scenario, folder, status)
    except RunDirectoryError:
        raise
    except OSError as error:
        raise RunWriteError(folder, f"no trace to compare: {error.strerror or error}") from error


def _compared(scenario: Scenario, folder: Path, status: int) -> Verified:
    second = folder / AGAIN
    parting = trace_parting(folder, second)
    if parting is None:
        slots = slots_in(folder)
        remove_trace(folder)
        rmtree(second)
        return Verified(status, f"the same twice: poses, commands and verdicts of {slots} slots")
    tick, time_s = parting.slot // SLOTS_PER_TICK, parting.slot / scenario.slot_hz
    at = f"tick {tick} ({time_s:g} s): {parting.what}"
    return Verified(FAIL, f"NOT the same twice: they part at {at}; the second run is in {second}")
