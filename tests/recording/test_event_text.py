"""Events in the viewer's list: a sentence for each kind, with its origin."""

from typing import get_args

import pytest

from agent.messages import AT_HOME
from netem.faults import Jam
from netem.link_keys import Conditions, LinkKeys
from tests.recording.flights import wedge
from worldsim.judge.run_events import (
    ConditionsChanged,
    Flapped,
    FlapWindow,
    FormationGiven,
    FrameGiven,
    Healed,
    Jammed,
    Joined,
    Killed,
    LateStart,
    Left,
    Partitioned,
    Paused,
    QueueChanged,
    Restarted,
    Resumed,
    RoleChanged,
    RunEvent,
    SensorChanged,
    SlotChanged,
)
from worldsim.recording.event_text import event_text

NOW = {"t_s": 1.0}
ONE = {**NOW, "agent": 4}
ALL = {**NOW, "agent": None, "planned": True}
MISSION = {"formation": "vee", "mission": 7, "path": AT_HOME, "tables": wedge(4).formation}
ALL_LOST = Conditions(loss_percent=100.0)

EVENTS = [
    (SlotChanged(**ONE, place=(2, 1), before=None), "a4 takes slot 2 of queue 3"),
    (
        SlotChanged(**ONE, place=(2, 1), before=(0, 0)),
        "a4 takes slot 2 of queue 3, was in slot 1 of queue 1",
    ),
    (SlotChanged(**ONE, place=None, before=(2, 1)), "a4 gives up slot 2 of queue 3"),
    (QueueChanged(**ONE, queue=2), "a4 enters queue 3"),
    (QueueChanged(**ONE, queue=None), "a4 leaves its queue"),
    (RoleChanged(**ONE, role="vertex"), "a4 becomes vertex"),
    (LateStart(**ONE, detail="its process is not up"), "a4 is late: its process is not up"),
    (Killed(**ONE, planned=True), "a4 killed (scheduled)"),
    (Killed(**ONE, planned=False, signal=9), "a4 killed (unplanned: signal 9)"),
    (Killed(**ONE, planned=False, status=0), "a4 killed (unplanned: status 0)"),
    (Killed(**ONE, planned=False), "a4 killed (unplanned)"),
    (
        Killed(**ALL, nobody=("vertex:V1", 3)),
        "kill: no agent matches vertex:V1, 3 (scheduled)",
    ),
    (Left(**ONE, planned=True), "a4 left (scheduled)"),
    (Paused(**ONE, planned=True), "a4 paused (scheduled)"),
    (Resumed(**ALL, nobody=()), "resume: no agent matches the selection (scheduled)"),
    (Resumed(**ONE, planned=True, by="operator"), "a4 resumed (by operator)"),
    (Restarted(**ONE, planned=True, incarnation=1), "a4 restarted (scheduled)"),
    (Joined(**ONE, planned=True, incarnation=0, by="operator"), "a4 joined (by operator)"),
    (Joined(**ALL, refused="no room"), "join refused: no room (scheduled)"),
    (
        Partitioned(**ALL, number=0, groups=((0, 1), (2,)), parted="clean", bridge=()),
        "radio partitioned (clean): a0 a1 | a2 (scheduled)",
    ),
    (
        Partitioned(**ALL, number=0, groups=((0, 1), (2,)), parted="bridge", bridge=(3,)),
        "radio partitioned (bridge): a0 a1 | a2, bridge: a3 (scheduled)",
    ),
    (Healed(**ALL), "partition healed (scheduled)"),
    (
        Jammed(**ALL, number=5, jam=Jam(centre_m=(0.0, 1.5, 0.0), radius_m=0.5)),
        "radio jammed within 0.5 m of [0, 1.5, 0] m (scheduled)",
    ),
    (Jammed(**ALL, number=5, jam=None), "jamming ended (scheduled)"),
    (
        Flapped(**ALL, number=5, flap=FlapWindow(period_s=1.0, links=((0, 1), (1, 0)))),
        "links flap every 1 s: a0 to a1, a1 to a0 (scheduled)",
    ),
    (
        Flapped(**ALL, number=5, flap=FlapWindow(period_s=0.5)),
        "links flap every 0.5 s: all (scheduled)",
    ),
    (Flapped(**ALL, number=5, flap=None), "flapping ended (scheduled)"),
    (
        ConditionsChanged(**ALL, number=2, conditions=ALL_LOST, loss_percent=0.0),
        "radio changed: loss_percent 0.0 (scheduled)",
    ),
    (
        ConditionsChanged(**ALL, number=2, conditions=ALL_LOST, local=LinkKeys(delay_ms=5.0)),
        "radio changed: local {'delay_ms': 5.0} (scheduled)",
    ),
    (
        ConditionsChanged(**ALL, number=2, conditions=Conditions(), undone=ALL_LOST),
        "radio change ended: loss_percent 100.0 (scheduled)",
    ),
    (
        SensorChanged(**ONE, planned=True, sensor="all", mode="stuck"),
        "a4: all sensors: stuck (scheduled)",
    ),
    (
        SensorChanged(**ONE, planned=True, sensor="laser", mode="works again"),
        "a4: laser sensor: works again (scheduled)",
    ),
    (
        FormationGiven(**ONE, planned=True, **MISSION),
        "new formation vee: mission 7 given to a4 (scheduled)",
    ),
    (
        FrameGiven(**ALL, **MISSION),
        "new frame of vee: mission 7 given to no agent (scheduled)",
    ),
]


@pytest.mark.parametrize(("event", "text"), EVENTS)
def test_an_event_is_a_sentence(event: RunEvent, text: str) -> None:
    assert event_text(event) == text


def test_the_table_has_every_kind_of_event() -> None:
    assert {type(event) for event, _ in EVENTS} == set(get_args(RunEvent))
