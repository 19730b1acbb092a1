"""Requests of an operator: carried out and reported, or rejected with a reason."""

import re
from math import inf, nan
from pathlib import Path
from typing import Any

import msgspec
import pytest

from netem.faults import Flap, Jam, Partition, RadioEvent
from netem.link_parameters import Conditions
from worldsim.engine.operations import Operation
from worldsim.engine.virtual import VirtualFleet
from worldsim.fleet.control import MAX_REQUEST_B, Answer, Control, Request, RequestError
from worldsim.judge.event import By
from worldsim.judge.event_text import sentence
from worldsim.judge.radio_events import ConditionsChanged
from worldsim.judge.run_events import (
    FormationGiven,
    FrameGiven,
    QueueChanged,
    Reconnected,
    RoleChanged,
    SlotChanged,
)
from worldsim.scenario.file import formation_tables, load

DEPLOY = Path("deploy")
WEDGE = DEPLOY / "scenarios/wedge-9.toml"
LINES = formation_tables(DEPLOY / "formations/three-horizontal-lines.toml")
JOINED = "[{ at_s = 15, join = 1 }]"
RAY = {"kind": "ray", "direction": [-1, 0, 0]}


def queue_of(
    through: list[str], shape: dict[str, Any] | None = None, **vertices: list[float]
) -> dict[str, Any]:
    """Return the tables of a formation of one queue."""
    queue = {"name": "Q", "vertices": through} | ({"shape": shape} if shape else {})
    return {"name": "f", "vertices": vertices or {"A": [0, 0, 0]}, "queue": [queue]}


class OperatedFleet:
    """A fleet in virtual time with an operator's control."""

    def __init__(self, until_s: float = 1.0, launcher: bool = True, **overrides: str) -> None:
        keys = {key.replace("__", "."): value for key, value in overrides.items()}
        scenario = load(WEDGE, {"duration_s": "60", **keys})
        self.virtual = VirtualFleet(scenario)
        self.loop = self.virtual.loop
        self.control = Control(scenario, self.loop, launcher)
        self.fly(until_s)

    def fly(self, until_s: float) -> None:
        while self.loop.world.time_s < until_s:
            self.virtual.slot()

    def ask(self, to: int | None = None, version: int | None = None, **event: Any) -> Answer:
        request = Request(event or None, to, version)
        return self.control.answer(msgspec.json.encode(request), self.carry_out)

    def carry_out(self, operation: Operation, by: By) -> None:
        self.virtual.carry_out(operation)
        self.loop.apply(operation, by)


def test_a_change_of_conditions_is_in_force_and_is_undone() -> None:
    fleet = OperatedFleet()
    assert fleet.ask().conditions == Conditions(range_m=6.0)
    answer = fleet.ask(netem={"loss_percent": 50}, for_s=0.5)
    (event,) = answer.events
    assert isinstance(event, ConditionsChanged)
    assert (event.by, event.planned, event.loss_percent) == ("operator", True, 50.0)
    assert answer.conditions.loss_percent == 50.0
    fleet.fly(2.0)
    assert fleet.ask().conditions.loss_percent is None
    assert fleet.virtual.medium_counters.fates["dropped_loss"] > 0


def test_a_radio_fault_is_reported_while_it_is_in_force() -> None:
    jam = Jam((0.0, 0.0, 0.0), 2.0)
    fleet = OperatedFleet(
        event="[{ at_s = 0.5, jam = { centre_m = [0, 0, 0], radius_m = 2 }, for_s = 3 }]"
    )
    fleet.ask(flap={"period_s": 2, "links": [[0, 1]]}, for_s=1)
    fleet.ask(flap={"period_s": 3})
    faults = fleet.ask(partition=[[0, 1], [2]]).faults
    assert [(each.since_s, each.fault) for each in faults] == [
        (0.5, RadioEvent(jam=jam)),
        (1.0, RadioEvent(flap=Flap(2.0, ((0, 1),)))),
        (1.0, RadioEvent(flap=Flap(3.0))),
        (1.0, RadioEvent(partition=Partition(((0, 1), (2,))))),
    ]
    fleet.fly(2.5)
    ring = Partition(((0, 1, 2, 3),), "ring")
    faults = fleet.ask(partition={"kind": "ring", "groups": [[0, 1, 2, 3]]}, for_s=0.5).faults
    assert faults[-1].fault == RadioEvent(partition=ring)
    assert len(faults) == 4
    fleet.fly(4.0)
    remaining = [each.fault for each in fleet.ask(heal=True).faults]
    assert remaining == [RadioEvent(flap=Flap(3.0))]


def test_an_operators_fault_sets_no_clock_below_0() -> None:
    """Neither with what is in force, nor with what is to come."""
    event = "[{ at_s = 0.5, clock = { agents = ['random:9'], offset_s = -0.4 } },"
    fleet = OperatedFleet(event=event + "{ at_s = 4, clock = { agents = [2], offset_s = -2 } }]")
    clocks = fleet.loop.world.clocks
    fleet.ask(clock={"agents": [2], "offset_s": -0.5}, for_s=0.9)
    for agent in (1, 2):
        before_s = clocks.ahead_s(agent, 1.0)
        with pytest.raises(RequestError, match=r"^clock.offset_s: -0.7; .* less than 0 s at 1 s"):
            fleet.ask(clock={"agents": [agent], "offset_s": -0.7})
        assert clocks.ahead_s(agent, 1.0) == before_s
    fleet.fly(2.0)
    with pytest.raises(RequestError, match=r"clock.offset_s: -2; .* at 4 s, the clock of agent 2"):
        fleet.ask(clock={"agents": ["all"], "offset_s": -1.6, "drift_ppm": -10_000})
    fleet.ask(clock={"agents": ["all"], "offset_s": -1.6, "drift_ppm": -10_000}, for_s=1.9)


def test_a_saboteur_works_until_it_is_ended() -> None:
    fleet = OperatedFleet()
    answer = fleet.ask(sabotage={"kind": "flood", "agents": ["vertex:V1", 2]})
    (active,) = answer.faults
    assert answer.name == active.name == "sabotage-1"
    assert 2 in active.fault.victims
    fleet.fly(2.0)
    sent = fleet.virtual.medium_counters.sent
    assert fleet.ask(end="sabotage-1").faults == ()
    fleet.fly(3.0)
    assert fleet.virtual.medium_counters.sent - sent < 0.7 * sent


def test_a_saboteur_takes_hold_of_an_agent_that_is_dead_once_it_is_back() -> None:
    fleet = OperatedFleet()
    fleet.ask(kill=[2], for_s=1)
    (_, active) = fleet.ask(sabotage={"kind": "flood", "agents": [2]}).faults
    assert active.fault.victims == (2,)
    fleet.fly(2.0)
    dead = dict(fleet.virtual.medium_counters.struck).get(active.number, 0)
    fleet.fly(6.0)
    alive = dict(fleet.virtual.medium_counters.struck)[active.number] - dead
    assert alive > 100 > dead


def test_every_fault_in_force_is_reported_with_whom_it_strikes_and_until_when() -> None:
    fleet = OperatedFleet(event="[{ at_s = 0.5, for_s = 3, kill = [4, 5] }]")
    fleet.ask(clock={"agents": [3], "offset_s": 3}, for_s=2)
    fleet.ask(sensor={"agents": [1], "mode": "silent", "kind": "proximity"}, name="blind")
    fleet.ask(jam={"centre_m": [0, 0, 0], "radius_m": 2}, for_s=1)
    fleet.ask(netem={"loss_percent": 5})
    fleet.ask(sabotage={"kind": "spoof", "agents": [2]})
    fleet.ask(kill=["netem"], for_s=9)
    fleet.ask(disk_full=True)
    found = fleet.ask(restart=[4]).faults
    assert [(each.name, each.kind, each.until_s, each.agents, each.process) for each in found] == [
        ("kill-0", "kill", 3.5, (5,), None),
        ("clock-2", "clock", 3.0, (3,), None),
        ("blind", "sensor", None, (1,), None),
        ("jam-4", "jam", 2.0, None, None),
        ("netem-5", "netem", None, None, None),
        ("sabotage-6", "sabotage", None, (2,), None),
        ("kill-7", "kill", 10.0, None, "netem"),
        ("disk_full-8", "disk_full", None, None, None),
    ]
    assert [each.since_s for each in found] == [0.5] + [1.0] * 7
    assert found[1].values == {"offset_s": 3.0, "drift_ppm": 0.0}
    assert found[2].values == {"mode": "silent", "kind": "proximity"}
    fleet.fly(4.0)
    assert [each.number for each in fleet.ask().faults] == [3, 5, 6, 7, 8]


def test_a_fault_ends_early_by_its_name() -> None:
    fleet = OperatedFleet(event="[{ at_s = 0.5, kill = [4] }]")
    fleet.ask(jam={"centre_m": [0, 0, 0], "radius_m": 2}, for_s=9, name="storm")
    fleet.ask(jam={"centre_m": [9, 0, 0], "radius_m": 2})
    assert [each.name for each in fleet.ask().faults] == ["kill-0", "storm", "jam-3"]
    assert [event.kind for event in fleet.ask(end="storm").events] == ["jam"]
    assert [each.name for each in fleet.ask().faults] == ["kill-0", "jam-3"]
    assert [event.agent for event in fleet.ask(end="kill-0").events] == [4]
    fleet.fly(12.0)  # the jam's own end finds nothing to end
    assert [(each.kind, each.to_s) for each in fleet.loop.effects.faults.all] == [
        ("kill", 1.0),
        ("jam", 1.0),
        ("jam", None),
    ]
    for event, reason in (
        ({"end": "storm"}, "end: no fault 'storm' is in force; there are jam-3"),
        ({"end": "no"}, "end: no fault 'no' is in force; there are jam-3"),
        ({"kill": [1], "every_s": 0.01}, "every_s: 0.01; at most 1000 times in a run"),
        ({"kill": [1], "name": "storm"}, "name: 'storm' is the name of another event"),
    ):
        with pytest.raises(RequestError, match=re.escape(reason)):
            fleet.ask(**event)


def test_the_end_of_a_fault_whose_agents_another_one_holds_changes_nothing() -> None:
    fleet = OperatedFleet(event="[{ at_s = 0.5, kill = [4] }, { at_s = 0.6, kill = [4] }]")
    assert fleet.ask(end="kill-0").events == ()
    assert [event.kind for event in fleet.ask(end="kill-1").events] == ["restart"]


def test_the_answer_says_by_which_name_a_fault_can_be_ended() -> None:
    fleet = OperatedFleet()
    assert fleet.ask(kill=[2]).name == "kill-1"
    assert fleet.ask(pause=[3], name="freeze").name == "freeze"
    assert fleet.ask(resume=[3]).name is None
    assert fleet.ask(end="kill-1").name is None
    assert fleet.ask(pause=["world"], for_s=1).name is None, "it is over before an end can come"
    assert fleet.ask(kill=["world"]).name is None, "nothing ends it"


def test_a_fault_that_repeats_ends_for_good_between_two_of_its_times() -> None:
    fleet = OperatedFleet(event="[{ at_s = 0.5, kill = ['random:1'], for_s = 0.5, every_s = 5 }]")
    fleet.ask(pause=["random:1"], for_s=0.5, every_s=5, name="freeze")
    fleet.fly(3.0)
    assert fleet.ask(end="kill-0").events == ()
    assert fleet.ask(end="freeze").events == ()
    fleet.fly(8.0)
    assert [each.kind for each in fleet.loop.effects.faults.all] == ["kill", "pause"]
    with pytest.raises(RequestError, match=re.escape("no fault 'freeze' is in force")):
        fleet.ask(end="freeze")


def test_the_end_of_a_fault_that_repeats_undoes_each_of_its_times() -> None:
    fleet = OperatedFleet()
    fleet.ask(kill=["random:1"], every_s=1, name="loop")
    fleet.fly(3.5)
    assert [event.kind for event in fleet.ask(end="loop").events] == ["restart"] * 3
    assert [each.to_s for each in fleet.loop.effects.faults.all] == [3.5] * 3


def test_each_time_of_a_fault_that_repeats_is_by_who_asked_for_it() -> None:
    fleet = OperatedFleet(event="[{ at_s = 0.5, pause = [1], for_s = 0.1, every_s = 1 }]")
    fleet.ask(kill=[4], for_s=0.1, every_s=1.5)
    fleet.fly(3.0)
    rows = fleet.loop.effects.faults.all
    assert [(each.kind, each.by) for each in rows if each.kind == "kill"] == [
        ("kill", "operator")
    ] * 2
    assert {each.by for each in rows if each.kind == "pause"} == {None}


@pytest.mark.parametrize(
    "fault",
    [
        {"kill": [4]},
        {"leave": [4]},
        {"pause": [4]},
        {"sensor": {"agents": [4], "mode": "silent"}},
        {"slow": {"agents": [4], "delay_s": 0.2}},
        {"netem": {"loss_percent": 50}},
        {"partition": [[0], [1]]},
        {"kill": ["netem"]},
        {"disk_full": True},
    ],
    ids=lambda fault: next(iter(fault)),
)
def test_the_end_that_an_operator_gave_a_fault_is_by_the_operator(fault: dict[str, Any]) -> None:
    fleet = OperatedFleet()
    begun = fleet.ask(**fault, for_s=0.1).events
    before = len(fleet.loop.events)
    fleet.fly(fleet.loop.world.time_s + 0.2)
    own = (SlotChanged, QueueChanged, RoleChanged, Reconnected)
    ends = [each for each in fleet.loop.events[before:] if not isinstance(each, own)]
    assert len(ends) == len(begun) > 0
    assert {sentence(each)[-18:] for each in (*begun, *ends)} == {" (by the operator)"}


def test_a_fault_whose_agents_are_brought_back_has_ended() -> None:
    fleet = OperatedFleet()
    fleet.ask(pause=[1])
    fleet.ask(kill=[2, 3])
    fleet.fly(2.0)
    fleet.ask(resume=[1])
    fleet.ask(restart=[2])
    assert [each.to_s for each in fleet.loop.effects.faults.all] == [2.0, None]
    fleet.fly(3.0)
    fleet.ask(restart=[3])
    assert [each.to_s for each in fleet.loop.effects.faults.all] == [2.0, 3.0]


def test_an_answer_is_equal_after_encoding_and_decoding() -> None:
    answer = OperatedFleet().ask(kill=[3])
    assert msgspec.json.decode(msgspec.json.encode(answer), type=Answer) == answer


def test_processes_are_killed_and_restart() -> None:
    fleet = OperatedFleet()
    assert [event.agent for event in fleet.ask(kill=[3, 2], for_s=1.0).events] == [2, 3]
    fleet.fly(3.5)
    members = fleet.loop.members
    assert members.alive.all()
    assert (members.incarnations[2], members.incarnations[4]) == (1, 0)
    assert [event.kind for event in fleet.ask(pause=["random:2"]).events] == ["pause", "pause"]


def test_a_mission_is_given_to_the_requested_agent_and_spreads() -> None:
    fleet = OperatedFleet(8.0)
    (event,) = fleet.ask(to=4, formation=LINES).events
    assert isinstance(event, FormationGiven)
    assert (event.agent, event.formation) == (4, "three-horizontal-lines")
    fleet.fly(8.06)
    flown = [command.telemetry.mission for command in fleet.loop.world.latest if command]
    assert [agent for agent, key in enumerate(flown) if key] == [4]
    fleet.fly(25.0)
    assert fleet.loop.judge.phases[-1].converge_s is not None
    (turned,) = fleet.ask(to=0, version=7, frame={"yaw_deg": 90}).events
    assert isinstance(turned, FrameGiven)
    assert turned.mission == 7 * 2**16


def test_spare_rows_allow_more_joins_than_the_timeline_has() -> None:
    fleet = OperatedFleet(fleet__spare="2", event=JOINED)
    assert [event.agent for event in fleet.ask(join=2).events] == [9, 10]
    fleet.fly(16.5)
    assert fleet.loop.members.alive.all()


REJECTED = [
    ({"kill": [9]}, "kill[0]: no agent 9; 0 to 8"),
    ({"kill": ["vertex:V9"]}, "kill[0]: no vertex 'V9'"),
    ({"restart": [3]}, "restart: no agent to restart"),
    ({"resume": ["all"]}, "resume: no agent in ['all'] can do that now"),
    ({"join": 1}, "join: 1; fleet.spare leaves room for 0"),
    ({"heal": True}, "heal: no partition to heal"),
    ({"jam": {"centre_m": [0, 0, 0], "radius_m": -1}}, "jam.radius_m: got -1"),
    ({"flap": {"period_s": 2, "links": [[0, 9]]}}, "flap.links[0]: no agent 9"),
    ({"netem": {}}, "netem: no key to set"),
    ({"netem": {"rate_kbit": 1e-300}}, "netem.rate_kbit: got 1e-300; allowed: a number from 0.001"),
    ({"flap": {"period_s": 1e-300}}, "flap.period_s: got 1e-300; allowed: a number from 0.05"),
    ({"netem": {"loss_percent": nan}}, "netem.loss_percent: must be a finite number"),
    ({"netem": {"loss_percent": 5}, "for_s": nan}, "for_s: must be a finite number"),
    ({"jam": {"centre_m": [0, inf, 0], "radius_m": 1}}, "jam.centre_m[1]: must be a finite number"),
    ({"netem": {"distribution": "poisson"}}, "netem.distribution: "),
    ({"netem": {"gemodel": {"p_percent": 5, "r_percent": 500}}}, "netem.gemodel.r_percent: got 5"),
    ({"partition": [[0, 1], [1]]}, "partition[1]: agent 1 is named twice"),
    ({"netem": {"loss_percent": 101}}, "netem.loss_percent: got 101"),
    ({"netem": {"los_percent": 1}}, "netem.los_percent: unknown key"),
    ({"netem": {"link": [{"from": 0, "to": 9}]}}, "netem.link[0].to: no agent 9"),
    ({"formation": {**LINES, "name": ""}}, "formation.name: "),
    ({"formation": {**LINES, "vertices": {"V1": [0, 0, 0]}}}, "formation."),
    ({"frame": {"yaw_deg": 9}, "to": 9}, "to: no agent 9; 0 to 8"),
    ({"frame": {"yaw_deg": 9}, "version": 0}, "version: 0; above 0"),
    (
        {"frame": {"yaw_deg": 9}, "version": 2**31},
        "version: 2147483648; above 0 is allowed, up to 1010 by now",
    ),
    (
        {"formation": queue_of(["A", "B"], A=[0, 0, 0], B=[0, 0, 0])},
        "formation.queue 'Q', vertices: 'A' and 'B' are 0 m apart",
    ),
    (
        {"formation": queue_of(["A"], {"kind": "curve", "x": "1/s", "y": "0", "z": "0"})},
        "formation.queue 'Q', shape: '1/s' at s = 0",
    ),
    (
        {"formation": queue_of(["A"], {"kind": "curve", "x": "s*1e-7", "y": "0", "z": "0"})},
        "formation.queue 'Q', shape: after ",
    ),
    ({"formation": queue_of(["A"], RAY, A=[1e6, 0, 0])}, "formation: with up to 9 agents its"),
    (
        {"formation": {**queue_of(["A"], RAY), "vertices": {"A": [2e6, 0, 0]}}},
        "formation.vertices.A[0]: got 2000000",
    ),
    ({"frame": {"waypoints_m": [[1e6, 1e6, 0]]}}, "frame.waypoints_m[0][0]: got 1000000"),
    ({"kill": [1], "to": 2}, "kill: to and version go with a mission only"),
    ({"kill": [1], "leave": [2]}, "leave: not beside kill"),
    ({"heal": True, "for_s": 3}, "for_s: heal is not undone"),
    ({"explode": True}, "explode: unknown key"),
]


@pytest.mark.parametrize(("keys", "reason"), REJECTED, ids=[reason for _, reason in REJECTED])
def test_an_invalid_request_is_rejected_and_changes_nothing(
    keys: dict[str, Any], reason: str
) -> None:
    fleet = OperatedFleet()
    before, radio = len(fleet.loop.events), fleet.ask()
    with pytest.raises(RequestError) as error:
        fleet.ask(**keys)
    assert str(error.value).startswith(reason)
    assert "\n" not in str(error.value)
    assert len(fleet.loop.events) == before
    assert fleet.ask() == radio
    assert radio.faults == ()
    assert fleet.loop.members.running.all()


def test_a_fleet_flies_on_after_missions_that_cannot_be_flown() -> None:
    fleet = OperatedFleet()
    for keys, reason in REJECTED:
        if "formation" in keys or "frame" in keys:
            with pytest.raises(RequestError, match=re.escape(reason)):
                fleet.ask(**keys)
    fleet.ask(formation=queue_of(["A"], {"kind": "spline", "points_m": [[0] * 3, [1e6, 0, 0]]}))
    fleet.fly(3.0)
    assert all(each is not None and each.telemetry.mission for each in fleet.loop.world.latest)


def test_an_invented_mission_key_does_not_end_the_numbering() -> None:
    fleet = OperatedFleet(3.0)
    fleet.loop.effects.missions.report(8, 2**53 - 1, fleet.loop.world.time_s)
    (given,) = fleet.ask(frame={"yaw_deg": 90}).events
    assert isinstance(given, FrameGiven)
    assert given.mission == 2**16


def test_an_older_mission_version_is_rejected() -> None:
    fleet = OperatedFleet(8.0)
    fleet.ask(to=4, version=3, formation=LINES)
    with pytest.raises(RequestError, match="version: 3; above 3 is allowed"):
        fleet.ask(to=4, version=3, frame={"yaw_deg": 90})
    fleet.ask(kill=[4])
    with pytest.raises(RequestError, match=r"to: agent 4 is not running \(dead\)"):
        fleet.ask(to=4, frame={"yaw_deg": 90})


def test_without_a_launcher_only_the_radio_can_be_changed() -> None:
    fleet = OperatedFleet(launcher=False)
    with pytest.raises(RequestError, match="kill: this fleet has no launcher"):
        fleet.ask(kill=[2])
    assert len(fleet.ask(partition=[[0, 1]]).faults) == 1


MALFORMED = [b"", b"\xff", b"[]", b'{"event": 3}', bytes(MAX_REQUEST_B + 1)]
MALFORMED += [b'{"event":{"netem":' + b"[" * deep + b"]" * deep + b"}}" for deep in (400, 30_000)]


@pytest.mark.parametrize("data", MALFORMED, ids=range(len(MALFORMED)))
def test_a_malformed_request_is_rejected(data: bytes) -> None:
    fleet = OperatedFleet(0.0)
    with pytest.raises(RequestError):
        fleet.control.answer(data, fleet.carry_out)


@pytest.mark.parametrize(("strike", "undo"), [("kill", "restart"), ("pause", "resume")])
def test_an_operator_ends_every_outage_of_netem_of_one_kind(strike: str, undo: str) -> None:
    fleet = OperatedFleet()
    other = {"kill": "pause", "pause": "kill"}[strike]
    for action in (strike, other, strike):
        fleet.ask(**{action: ["netem"]})
    fleet.ask(**{undo: ["netem"]})
    assert list(fleet.loop.network.outages.values()) == [other]
    with pytest.raises(RequestError, match=f"^netem: no {strike} of it is in force$"):
        fleet.ask(**{undo: ["netem"]})
