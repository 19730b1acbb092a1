"""Reports of progress, of what is done to a fleet, and of long waits."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from worldsim.fleet.ipc import Notice, Progress, Stalled, world_sockets
from worldsim.fleet.launcher_link import LaunchedLink
from worldsim.fleet.progress import MAX_EVENTS, STALL_AFTER_S, ProgressReporter, StallReporter
from worldsim.judge.run_events import Joined, Killed, Paused, RoleChanged


def loop_at(time_s: float) -> Any:
    """Return what the reporter sees of a loop: three agents, two faults in force, one over."""
    faults = [
        SimpleNamespace(kind="kill", to_s=None),
        SimpleNamespace(kind="netem", to_s=4.0),
        SimpleNamespace(kind="pause", to_s=None),
        SimpleNamespace(kind="pause", to_s=None),
    ]
    phases = [SimpleNamespace(formation=SimpleNamespace(name=name)) for name in ("vee", "line")]
    return SimpleNamespace(
        events=[],
        figures=SimpleNamespace(slot_error=np.array([0.05, 0.2, np.nan])),
        world=SimpleNamespace(time_s=time_s),
        members=SimpleNamespace(running=np.array([True, True, False])),
        judge=SimpleNamespace(phases=phases, min_separation_m=0.756),
        effects=SimpleNamespace(faults=SimpleNamespace(all=faults)),
    )


def reports(*elapsed_s: float, events: tuple[Any, ...] = ()) -> list[Any]:
    """Return what the launcher gets; the events happen after the first report."""
    launcher, world = world_sockets()
    loop = loop_at(5.0)
    reporter = ProgressReporter(20.0, loop, LaunchedLink(world))
    for each in elapsed_s:
        reporter.report(each, 0.004)
        loop.events.extend(events if each == elapsed_s[0] else ())
    received = launcher.receive()
    launcher.close()
    world.close()
    return received


def test_progress_tells_pace_formation_and_the_faults_in_force() -> None:
    (progress,) = reports(2.0, 2.1)
    assert progress == Progress(5.0, 20.0, 2, 1, 0.756, 0.004, None, 2.5, "line", ("kill", "pause"))
    assert str(progress) == (
        "5.0 of 20 s, 6 s left, 2.5 x real time   line: in place 1/2"
        "   minimum separation 0.76 m   late ticks 0.4%   in force: kill, pause"
    )


def test_before_the_first_tick_the_pace_is_not_known() -> None:
    assert str(Progress(0.0, 20.0, 9, 0, None, None)) == (
        "0.0 of 20 s   in place 0/9   minimum separation -   late ticks -"
    )


def killed(**more: Any) -> Killed:
    return Killed(t_s=5.0, agent=2, planned=True, **more)


@pytest.mark.parametrize(
    ("event", "told"),
    [
        (Paused(t_s=4.98, agent=1, planned=True), "4.98 s: a1 is paused (scheduled)"),
        (killed(by="operator"), "5.00 s: a2 is killed; its vehicle hovers (by the operator)"),
        (killed(), None),  # the launcher tells how the process ended
        (RoleChanged(t_s=5.0, agent=1, role="vertex"), None),
    ],
)
def test_what_is_done_to_the_fleet_is_told_once(event: Any, told: str | None) -> None:
    received = reports(2.0, 3.0, 4.0, events=(event,))
    notices = [each for each in received if isinstance(each, Notice)]
    assert notices == ([Notice(told)] if told is not None else [])


def test_many_events_at_once_are_counted() -> None:
    joins = tuple(Joined(t_s=5.0, agent=agent, planned=True) for agent in range(50))
    notices = [each for each in reports(2.0, 3.0, events=joins) if isinstance(each, Notice)]
    assert len(notices) == MAX_EVENTS + 1
    assert notices[-1] == Notice(f"and {50 - MAX_EVENTS} more at that time: see events.jsonl")


def test_a_wait_is_reported_once_when_it_has_become_long() -> None:
    launcher, world = world_sockets()
    stall = StallReporter("agent-2's command of slot 5", LaunchedLink(world))
    stall.add_wait(STALL_AFTER_S - 0.5)
    assert launcher.receive() == []
    stall.add_wait(0.5)
    assert launcher.receive() == [Stalled("agent-2's command of slot 5")]
    stall.add_wait(10 * STALL_AFTER_S)
    assert launcher.receive() == []
    launcher.close()
    world.close()
