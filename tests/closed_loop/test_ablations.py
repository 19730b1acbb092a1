"""What the Q-structure carries: without a part of it, agents get no places (docs/method.md)."""

from pathlib import Path

import pytest

from worldsim.engine.virtual import Flight, fly
from worldsim.scenario.file import load

WEDGE = Path(__file__).parents[2] / "deploy" / "scenarios" / "wedge-9.toml"
AGENTS = 9
APEX = (0, 0)
PLAIN: dict[str, str] = {}
WITHOUT_TIERS = {"control.controller": "tests.closed_loop.ablated:WithoutTiers"}
MUTE_LEADERS = {"control.controller": "tests.closed_loop.ablated:MuteLeaders"}
MULTIHOP_OFF = {"comms.multihop_hz": "0"}
ONE_BRIEFED = {"fleet.briefed": "[0]"}
SEEDS = (0, 1)


def flown(seed: int, switched: dict[str, str], range_m: float = 6.0) -> Flight:
    given = {"seed": str(seed), "duration_s": "20", "netem.range_m": str(range_m)}
    return fly(load(WEDGE, given | switched))


def places_of(flight: Flight) -> list[tuple[int, int]]:
    """Return the places that agents claim at the end."""
    telemetry = [command.telemetry for command in flight.loop.world.latest]
    return [tuple(each.place) for each in telemetry if each.place is not None]


def missions_of(flight: Flight) -> set[int]:
    """Return the keys of the missions that agents fly at the end."""
    return {command.telemetry.mission for command in flight.loop.world.latest}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("switched", "range_m"),
    [(PLAIN, 3.0), (ONE_BRIEFED, 3.0), (ONE_BRIEFED, 6.0)],
    ids=["plain at 3 m", "one briefed at 3 m", "one briefed at 6 m"],
)
def test_the_whole_structure_fills_the_formation(
    switched: dict[str, str], seed: int, range_m: float
) -> None:
    """The plain one at 6 m is flown in test_wedge.py."""
    flight = flown(seed, switched, range_m)
    assert flight.loop.judge.phases[0].converge_s is not None
    assert len(set(places_of(flight))) == AGENTS


@pytest.mark.parametrize(
    "switched",
    [WITHOUT_TIERS, MUTE_LEADERS, MULTIHOP_OFF, ONE_BRIEFED | WITHOUT_TIERS],
    ids=["without tiers", "mute leaders", "multihop off", "one briefed, without tiers"],
)
@pytest.mark.pure
def test_without_a_part_all_have_the_mission_and_only_the_leader_a_place(
    switched: dict[str, str],
) -> None:
    """Nobody else hears that the team is counted, even where each agent hears all others."""
    flight = flown(0, switched)
    assert missions_of(flight) == {0}
    assert flight.loop.judge.phases[0].converge_s is None
    assert places_of(flight) == [APEX]
    assert "converge pyramidal-wedge" in flight.loop.judge.shortcomings().missed
    assert flight.loop.judge.invariants()["I1"].violations == 0


def test_missions_need_the_multihop_channel() -> None:
    assert missions_of(flown(0, ONE_BRIEFED | MULTIHOP_OFF)) == {-1, 0}
