"""The command about this host: ``doctor``."""

import sys
from time import monotonic
from typing import TYPE_CHECKING

import typer

from worldsim.commands.options import complain, examples
from worldsim.results.exit_status import FAIL, INTERRUPTED, PASS

if TYPE_CHECKING:
    from worldsim.doctor.checks import Check

commands = typer.Typer()


@commands.command(epilog=examples("qswarm doctor", "QSWARM_PURE=1 qswarm doctor"))
def doctor() -> int:
    """Say what this host has for qswarm, and how many agents it flies in real time.

    The host, its cores and clock, whether compiled code runs, Zenoh, the viewer and the optional
    extras; then a fleet of 16 processes flies for 3 s, and its cost gives the size of fleet that
    this host keeps up with. It takes about ten seconds. Exit status 1: no fleet can be flown.
    """
    from netem.wire.shutdown import interrupt_on_signals
    from worldsim.doctor.checks import checks

    interrupt_on_signals()
    try:
        for check in checks():
            _tell(check)
        return _measured()
    except KeyboardInterrupt:
        complain("qswarm: interrupted")
        return INTERRUPTED


def _tell(check: "Check") -> None:
    print(f"{check.name + ':':15}{check.says}", flush=True)
    if check.hint:
        print(f"{'':15}-> {check.hint}", flush=True)


def _measured() -> int:
    """Measure, with progress, and print what this host can fly."""
    from worldsim.bench.measures import InvalidFigureError
    from worldsim.bench.ticking import ticking
    from worldsim.doctor.capacity import (
        AGENTS,
        measured_capacity,
        process_check,
        virtual_check,
        virtual_steps_per_s,
    )
    from worldsim.doctor.checks import Check
    from worldsim.results.progress_line import ProgressLine

    line, began_s = ProgressLine(sys.stderr), monotonic()

    def show() -> None:
        line.update(f"measuring fleets, {monotonic() - began_s:.0f} of about 8 s")

    try:
        with ticking(show):
            steps = virtual_steps_per_s()
            capacity = measured_capacity()
    except InvalidFigureError as error:
        _tell(Check("processes", f"a fleet of {AGENTS} cannot be flown: {error}"))
        return FAIL
    finally:
        line.clear()
    _tell(virtual_check(steps))
    _tell(process_check(capacity))
    return PASS
