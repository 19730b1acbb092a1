"""How well the formation is held after convergence, and how fast it is restored after faults."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from netem.conditions import NetworkConditions
from netem.faults import FaultOrder, Flap, Heal, Jam, Partition, RadioEvent, RadioFault
from netem.link_parameters import Conditions
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.finding import Expectation
from worldsim.judge.radio_events import RadioRunEvent, applied
from worldsim.judge.verdict import Judge
from worldsim.scenario.tables import Expectations

WINDOW_S = 3.0
FLIGHT = msgspec.structs.replace(
    wedge(5, duration_s=20.0),
    expect=Expectations(
        min_separation_m=0.0,
        reform_within_s=WINDOW_S,
        in_formation_fraction=0.9,
        max_slot_error_m=0.5,
    ),
)
"""In formation from about 4 s on."""
JAM = Jam((0.0, 0.0, 0.0), 1.0)
Off = Callable[[float], float]
"""How far the first agent is from its slot at a time [m]."""


def radio(*changes: tuple[float, int, RadioFault | None]) -> list[RadioRunEvent]:
    """Return the events of faults that begin, or end (None), at times [s] by their numbers."""
    network = NetworkConditions(Conditions())
    return [
        applied(
            FaultOrder(n, t_s, RadioEvent.of(fault) if fault is not None else None),
            network,
            t_s,
            None,
        )
        for t_s, n, fault in changes
    ]


def judged(off_m: Off, events: Iterable[RadioRunEvent] = ()) -> Judge:
    judge, waiting = Judge(FLIGHT), list(events)
    for tick in straight_flight(FLIGHT):
        while waiting and waiting[0].t_s <= tick.time_s:
            judge.handle_event(waiting.pop(0))
        position = tick.position + off_m(tick.time_s) * np.eye(5, 1) * np.array([[0, 0, 1.0]])
        judge.see(replace(tick, position=position))
    return judge


def rows(judge: Judge) -> dict[str, Expectation]:
    return {each.name: each for each in judge.expectations()}


def still(_time_s: float) -> float:
    return 0.0


def away(from_s: float, to_s: float, off_m: float = 0.4) -> Off:
    return lambda time_s: off_m * (from_s <= time_s < to_s)


def test_a_team_that_stays_in_its_slots_holds_its_formation() -> None:
    found = rows(judged(still))
    assert found["in_formation_fraction"].got == 1.0
    assert found["max_slot_error_m"].got == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("to_s", "held"), [(11.0, True), (13.0, False)])
def test_the_time_out_of_formation_counts(to_s: float, held: bool) -> None:
    judge = judged(away(10.0, to_s))
    row = rows(judge)["in_formation_fraction"]
    counted_s = 20.0 - (judge.phases[0].converge_s or 0.0) - 2.0  # it is known 2 s later
    assert row.got == pytest.approx(1.0 - (to_s - 10.0) / counted_s, abs=0.01)
    assert row.held is held


def test_the_largest_slot_error_counts() -> None:
    row = rows(judged(away(10.0, 10.1, off_m=0.6)))["max_slot_error_m"]
    assert row.got == pytest.approx(0.6)
    assert not row.held


@pytest.mark.parametrize(
    "events",
    [
        radio((10.0, 0, Conditions(loss_percent=50.0))),
        radio((10.0, 0, JAM), (11.0, 0, None)),
        radio((9.0, 0, Flap(1.0)), (10.0, 0, None)),
        radio((5.0, 0, Partition(((0,),))), (10.5, 1, Heal())),
    ],
)
def test_the_window_after_a_fault_and_after_its_end_does_not_count(
    events: list[RadioRunEvent],
) -> None:
    assert rows(judged(away(10.0, 12.9), events))["in_formation_fraction"].got == 1.0
    late = rows(judged(away(10.0, 15.0), events))["in_formation_fraction"]
    assert late.got is not None
    assert late.got < 1.0


def test_while_a_fault_parts_the_team_nothing_counts_and_without_a_tick_nothing_is_judged() -> None:
    """The end of another fault, and a heal beside a jam, do not make the team one."""
    events = radio(
        (1.0, 0, Partition(((0,),))), (2.0, 1, JAM), (3.0, 2, Flap(1.0)), (8.0, 3, Heal())
    ) + radio((9.0, 2, Flap(1.0)), (9.0, 2, None))
    judge = judged(away(10.0, 19.0), events)
    found = rows(judge)
    assert [found[name].got for name in ("in_formation_fraction", "max_slot_error_m")] == [None] * 2
    assert found["in_formation_fraction"].held is None
    assert judge.recoveries == []


def test_what_ends_the_parting_of_a_team_and_what_changes_its_radio_is_recovered_from() -> None:
    lossy = Conditions(loss_percent=50.0)
    events = radio((6.0, 0, Partition(((0,),))), (8.0, 0, None), (14.0, 1, lossy))
    judge = judged(away(7.0, 9.0), events)
    assert [(each.kind, each.t_s, each.agents) for each in judge.recoveries] == [
        ("heal", 8.0, []),
        ("netem", 14.0, []),
    ]
    assert [each.reformed_s for each in judge.recoveries] == pytest.approx([1.0, 0.0], abs=0.06)
    assert rows(judge)["reform_within_s"].held
    assert not rows(judged(away(7.0, 12.0), events))["reform_within_s"].held
    assert not rows(judged(away(7.0, 99.0), events))["reform_within_s"].held
