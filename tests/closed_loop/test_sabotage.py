"""Sabotage in flight: what a saboteur sends is rejected and counted, and nobody flies otherwise."""

from functools import cache

import pytest

from tests.scenario.test_timeline import LINE
from worldsim.campaign.pool import finished
from worldsim.engine.virtual import Flight, fly
from worldsim.results.summary import summarise
from worldsim.scenario.file import parse
from worldsim.scenario.tables import Scenario

REJECTED = {
    "replay": {"replay"},
    "spoof": {"spoofed"},
    "garbage": {"corrupt", "garbage", "invalid"},
    "flood": {"replay"},
}
"""The causes for which agents reject what a saboteur of each kind sends."""
OLD = ("replay", "spoof", "garbage")
"""Kinds that tell nobody anything new. A flood does: a copy may arrive where the frame is lost."""
CLEAN = ""
ROUGH = "loss_percent = 30\ndelay_ms = 60\njitter_ms = 20\nduplicate_percent = 5"


def scenario(radio: str, *events: str) -> Scenario:
    tables = "\n".join(f"[[event]]\n{event}" for event in events)
    text = f"duration_s = 7\nformation = {LINE}\n[fleet]\nagents = 4\n[netem]\n{radio}\n{tables}\n"
    return parse(text)


def sabotage(kind: str) -> str:
    return f"at_s = 1.0\nsabotage = {{ kind = '{kind}', agents = [1, 2] }}"


@cache
def flown(kind: str, radio: str = CLEAN) -> Flight:
    return fly(scenario(radio, sabotage(kind)) if kind else scenario(radio))


@pytest.mark.parametrize(
    ("kind", "radio"), [*((kind, CLEAN) for kind in REJECTED), *((kind, ROUGH) for kind in OLD)]
)
def test_no_agent_flies_or_says_anything_else_than_without_the_saboteur(
    kind: str, radio: str
) -> None:
    """Nothing that it sends gets into anybody's state: nothing is applied twice, or believed."""
    alone, beside = flown("", radio).loop, flown(kind, radio).loop
    assert (alone.world.vehicles.position == beside.world.vehicles.position).all()
    for own, same in zip(alone.world.latest, beside.world.latest, strict=True):
        assert own is not None
        assert same is not None
        assert own.velocity == same.velocity
        assert own.telemetry.place == same.telemetry.place
        assert own.telemetry.heard == same.telemetry.heard
        assert own.telemetry.record_age_s == same.telemetry.record_age_s


@pytest.mark.parametrize("kind", REJECTED)
def test_an_agent_that_falls_silent_is_missed_as_without_the_saboteur(kind: str) -> None:
    """Its frames go on, but none of them is news."""
    silent = "at_s = 2.5\npause = [1]"
    alone, beside = (
        fly(scenario(CLEAN, silent)).loop,
        fly(scenario(CLEAN, silent, sabotage(kind))).loop,
    )
    assert (alone.world.vehicles.position == beside.world.vehicles.position).all()
    for agent in (0, 2, 3):
        own, same = alone.world.latest[agent], beside.world.latest[agent]
        assert own is not None
        assert same is not None
        assert own.telemetry.heard == same.telemetry.heard
        assert 1 not in same.telemetry.heard


@pytest.mark.parametrize("kind", REJECTED)
def test_what_a_saboteur_sends_is_rejected_by_its_cause(kind: str) -> None:
    found = flown(kind).loop.rejections.by_cause()
    assert set(found) == REJECTED[kind]
    received = dict(flown(kind).medium_counters.struck)[0]
    assert sum(found.values()) > 0.45 * received


def test_a_fault_says_how_many_frames_of_a_saboteur_were_received() -> None:
    flown_with = scenario(CLEAN, sabotage("garbage"))
    summary = summarise(flown_with, finished(flown("garbage"), flown_with))
    (row,) = summary["faults"]
    assert (row["kind"], row["agents"], row["from_s"]) == ("sabotage", [1, 2], 1.0)
    assert row["frames"] == pytest.approx(2 * 3 * 6 * 200, rel=0.01)
    rejected = summary["rejected_by_cause"]["agents"]
    assert sum(rejected.values()) == pytest.approx(row["frames"], rel=0.01)


def test_sabotage_by_nobodys_radio_strikes_nothing() -> None:
    flight = fly(scenario(CLEAN, "at_s = 0.5\nkill = [1, 2]", sabotage("garbage")))
    assert [each.agents for each in flight.loop.effects.faults.all] == [[1, 2], [1, 2]]
    assert (flight.medium_counters.struck, flight.rejected) == ((), 0), "their radios are off"
