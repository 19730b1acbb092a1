"""What an operator asks for: done at once, told as the operator's, or refused with a reason."""

from math import inf, nan
from pathlib import Path
from typing import Any

import msgspec
import pytest

from worldsim.engine.step import Deed
from worldsim.engine.virtual import VirtualFleet
from worldsim.fleet.control import MAX_REQUEST_B, Answer, Control, Request, RequestError
from worldsim.scenario.file import formation_tables, load

DEPLOY = Path("deploy")
WEDGE = DEPLOY / "scenarios/wedge-9.toml"
LINES = formation_tables(DEPLOY / "formations/three-horizontal-lines.toml")
NOTHING: dict[str, list[Any]] = {"partition": [], "jam": [], "flap": []}
JOINED = "[{ at_s = 15, join = 1 }]"


class Operated:
    """A fleet in virtual time, and an operator at its control."""

    def __init__(self, until_s: float = 1.0, launcher: bool = True, **overrides: str) -> None:
        keys = {key.replace("__", "."): value for key, value in overrides.items()}
        scenario = load(WEDGE, {"duration_s": "60", **keys})
        self.fleet = VirtualFleet(scenario)
        self.loop = self.fleet.loop
        self.control = Control(scenario, self.loop, launcher)
        self.fly(until_s)

    def fly(self, until_s: float) -> None:
        while self.loop.world.time_s < until_s:
            self.fleet.slot()

    def ask(self, to: int | None = None, version: int | None = None, **event: Any) -> Answer:
        request = Request(event or None, to, version)
        return self.control.answer(msgspec.json.encode(request), self._do)

    def _do(self, deed: Deed) -> None:
        self.fleet.do(deed)
        self.loop.take(deed, by="operator")


def test_a_change_of_the_radio_holds_and_is_undone() -> None:
    operated = Operated()
    assert operated.ask().conditions == {"range_m": 6.0}
    told = operated.ask(netem={"loss_percent": 50}, for_s=0.5)
    (event,) = told.events
    assert (event["kind"], event["by"], event["planned"]) == ("netem", "operator", True)
    assert told.conditions["loss_percent"] == 50.0
    operated.fly(2.0)
    assert "loss_percent" not in operated.ask().conditions
    assert operated.fleet.medium_counters.fates["dropped_loss"] > 0


def test_what_stands_between_radios_is_told_while_it_does() -> None:
    operated = Operated(
        event="[{ at_s = 0.5, jam = { centre_m = [0, 0, 0], radius_m = 2 }, for_s = 3 }]"
    )
    operated.ask(flap={"period_s": 2, "links": [[0, 1]]}, for_s=1)
    operated.ask(flap={"period_s": 3})
    told = operated.ask(partition=[[0, 1], [2]]).barriers
    assert told["partition"][0]["groups"] == ((0, 1), (2,))
    assert [jam["since_s"] for jam in told["jam"]] == [0.5]
    assert [(flap["period_s"], flap["links"]) for flap in told["flap"]] == [
        (2.0, ((0, 1),)),
        (3.0, ()),
    ]
    operated.fly(2.5)
    ring = operated.ask(partition={"kind": "ring", "groups": [[0, 1, 2, 3]]}, for_s=0.5).barriers
    assert [each["kind"] for each in ring["partition"]] == ["ring"]
    assert [flap["period_s"] for flap in ring["flap"]] == [3.0]
    operated.fly(4.0)
    left = operated.ask().barriers
    assert (left["partition"], left["jam"], len(left["flap"])) == ([], [], 1)


def test_processes_are_struck_and_come_back() -> None:
    operated = Operated()
    assert [e["agent"] for e in operated.ask(kill=[3, 2], for_s=1.0).events] == [2, 3]
    operated.fly(3.5)
    team = operated.loop.team
    assert team.alive.all()
    assert (team.incarnations[2], team.incarnations[4]) == (1, 0)
    assert [e["kind"] for e in operated.ask(pause=["random:2"]).events] == ["pause", "pause"]


def test_a_mission_goes_to_the_agent_that_was_named_and_spreads() -> None:
    operated = Operated(8.0)
    (event,) = operated.ask(to=4, formation=LINES).events
    assert (event["agent"], event["formation"]) == (4, "three-horizontal-lines")
    operated.fly(8.06)
    flown = [command.telemetry.mission for command in operated.loop.world.latest if command]
    assert [agent for agent, key in enumerate(flown) if key] == [4]
    operated.fly(25.0)
    assert operated.loop.judge.phases[-1].converge_s is not None
    (turned,) = operated.ask(to=0, version=7, frame={"yaw_deg": 90}).events
    assert turned["mission"] == 7 * 2**16


def test_spare_rows_are_for_joiners_beyond_the_timelines() -> None:
    operated = Operated(fleet__spare="2", event=JOINED)
    assert [event["agent"] for event in operated.ask(join=2).events] == [9, 10]
    operated.fly(16.5)
    assert operated.loop.team.alive.all()


REFUSED = [
    ({"kill": [9]}, "kill[0]: no agent 9; 0 to 8"),
    ({"kill": ["vertex:V9"]}, "kill[0]: no vertex 'V9'"),
    ({"restart": [3]}, "restart: nobody to come back"),
    ({"resume": ["all"]}, "resume: nobody there whom ['all'] means"),
    ({"join": 1}, "join: 1; fleet.spare leaves room for 0"),
    ({"heal": True}, "heal: no partition to heal"),
    ({"jam": {"centre_m": [0, 0, 0], "radius_m": -1}}, "jam.radius_m: got -1"),
    ({"flap": {"period_s": 2, "links": [[0, 9]]}}, "flap.links[0]: no agent 9"),
    ({"netem": {}}, "netem: no key to set"),
    ({"netem": {"rate_kbit": 1e-300}}, "netem.rate_kbit: got 1e-300; allowed: a number from 0.001"),
    ({"flap": {"period_s": 1e-300}}, "flap.period_s: got 1e-300; allowed: a number from 0.05"),
    ({"netem": {"loss_percent": nan}}, "netem.loss_percent: nothing, or a number that is not"),
    ({"netem": {"loss_percent": 5}, "for_s": nan}, "for_s: nothing, or a number that is not"),
    ({"jam": {"centre_m": [0, inf, 0], "radius_m": 1}}, "jam.centre_m[1]: nothing, or a number"),
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
    ({"kill": [1], "to": 2}, "kill: is no mission"),
    ({"kill": [1], "leave": [2]}, "leave: not beside kill"),
    ({"heal": True, "for_s": 3}, "for_s: heal is not undone"),
    ({"explode": True}, "explode: unknown key"),
]


@pytest.mark.parametrize(("asked", "reason"), REFUSED, ids=[reason for _, reason in REFUSED])
def test_what_cannot_be_is_refused_and_changes_nothing(asked: dict[str, Any], reason: str) -> None:
    operated = Operated()
    before, radio = len(operated.loop.events), operated.ask()
    with pytest.raises(RequestError) as refusal:
        operated.ask(**asked)
    assert str(refusal.value).startswith(reason)
    assert "\n" not in str(refusal.value)
    assert len(operated.loop.events) == before
    assert operated.ask() == radio
    assert radio.barriers == NOTHING
    assert operated.loop.team.awake.all()


def test_an_older_version_is_refused() -> None:
    operated = Operated(8.0)
    operated.ask(to=4, version=3, formation=LINES)
    with pytest.raises(RequestError, match="version: 3; above 3, which flies already"):
        operated.ask(to=4, version=3, frame={"yaw_deg": 90})
    operated.ask(kill=[4])
    with pytest.raises(RequestError, match="agent 4 takes no part at present"):
        operated.ask(to=4, frame={"yaw_deg": 90})


def test_by_hand_processes_are_left_alone_and_the_radio_is_not() -> None:
    operated = Operated(launcher=False)
    with pytest.raises(RequestError, match="kill: this fleet has no launcher"):
        operated.ask(kill=[2])
    assert operated.ask(partition=[[0, 1]]).barriers["partition"]


JUNK = [b"", b"\xff", b"[]", b'{"event": 3}', bytes(MAX_REQUEST_B + 1)]
JUNK += [b'{"event":{"netem":' + b"[" * deep + b"]" * deep + b"}}" for deep in (400, 30_000)]


@pytest.mark.parametrize("asked", JUNK, ids=range(len(JUNK)))
def test_what_is_no_request_is_refused(asked: bytes) -> None:
    operated = Operated(0.0)
    with pytest.raises(RequestError):
        operated.control.answer(asked, operated.fleet.do)
