"""Run events: rows decode to equal events, and the judge recovers the radio faults in force."""

import json
from typing import get_args

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.conditions import NetworkConditions
from netem.faults import FaultOrder, Flap, Heal, Jam, Partition, RadioEvent, Sabotage
from netem.link_parameters import Conditions, LinkKeys
from worldsim.judge.radio_events import applied, order_of
from worldsim.judge.run_events import (
    ClockChanged,
    Intruded,
    Joined,
    Killed,
    LateStart,
    Left,
    Paused,
    PoseChanged,
    QueueChanged,
    RoleChanged,
    RunEvent,
    SensorChanged,
    SlotChanged,
    SlowChanged,
    Starved,
    as_row,
    event_of,
)

FAULTS = [
    Partition(((0, 1), (2,)), "bridge", (4,)),
    Jam((1.0, 2.0, 3.0), 2.0),
    Flap(0.5, ((0, 1),)),
    Conditions(loss_percent=50.0, multihop=LinkKeys(delay_ms=9.0)),
    Sabotage("replay", (2, 5), delay_s=0.5),
]
EVENTS: list[RunEvent] = [
    Killed(t_s=1.0, agent=2, planned=True),
    Killed(t_s=1.0, agent=2, planned=False, signal=9),
    Left(t_s=1.0, agent=None, planned=True, nobody=("vertex:V1",)),
    Paused(t_s=1.0, agent=3, planned=True, by="operator"),
    Joined(t_s=1.0, agent=None, planned=True, refused="no room"),
    SensorChanged(t_s=2.0, agent=1, planned=True, sensor="all", mode="stuck"),
    ClockChanged(t_s=2.0, agent=1, planned=True, number=3, offset_s=-3.0, drift_ppm=10.0),
    ClockChanged(t_s=2.0, agent=1, planned=True, number=3, offset_s=-3.0, ends=True),
    PoseChanged(t_s=2.0, agent=1, planned=True, number=3, bias_m=(1.0, 0.0, 0.5), noise_m=0.1),
    SlowChanged(t_s=2.0, agent=1, planned=True, number=3, delay_s=0.2, ends=True),
    Starved(t_s=2.0, agent=1, planned=True, number=3, cpu_percent=20.0, period_s=0.5),
    Intruded(t_s=2.0, agent=None, planned=True, number=3, agents=(1,), per_s=10.0),
    Intruded(t_s=2.0, agent=None, planned=True, number=3, agents=None, per_s=10.0),
    SlotChanged(t_s=0.5, agent=1, place=(2, 1), before=None),
    QueueChanged(t_s=0.5, agent=1, queue=2),
    RoleChanged(t_s=0.5, agent=1, role="vertex"),
    LateStart(t_s=3.0, agent=1, detail="its process is not up"),
]


@pytest.mark.parametrize("event", EVENTS, ids=lambda event: event.kind)
def test_an_event_is_equal_after_encoding_and_decoding(event: RunEvent) -> None:
    row = as_row(event)
    assert list(row)[:3] == ["t_s", "kind", "agent"]
    assert event_of(json.loads(json.dumps(row))) == event


def test_every_event_type_has_its_own_kind() -> None:
    kinds = [event.__struct_config__.tag for event in get_args(RunEvent)]
    assert len(set(kinds)) == len(kinds)


@pytest.mark.parametrize(
    "row", [{}, {"kind": "explode", "t_s": 0, "agent": None}, {"kind": "kill"}]
)
def test_an_invalid_row_is_rejected(row: dict[str, object]) -> None:
    with pytest.raises(msgspec.ValidationError):
        event_of(row)


orders = st.one_of(
    st.tuples(st.integers(0, 5), st.sampled_from(FAULTS)).map(
        lambda each: FaultOrder(each[0], 1.5, RadioEvent.of(each[1]))
    ),
    st.integers(0, 5).map(lambda number: FaultOrder(number, 2.5)),
    st.just(FaultOrder(0, 3.5, RadioEvent.of(Heal()))),
)


@settings(derandomize=True, deadline=None, max_examples=80)
@given(st.lists(orders, max_size=12))
def test_the_judge_recovers_the_faults_in_force_from_events(given_orders: list[FaultOrder]) -> None:
    world, judge = NetworkConditions(Conditions()), NetworkConditions(Conditions())
    for order in given_orders:
        if order.fault is None and not world.ends(order):
            continue
        event = event_of(json.loads(json.dumps(as_row(applied(order, world, 1.5, None)))))
        judge.apply(order_of(event))
        assert [each.fault for each in judge.in_force.values()] == [
            each.fault for each in world.in_force.values()
        ]
        assert list(judge.in_force) == list(world.in_force)
        assert judge.conditions == world.conditions
