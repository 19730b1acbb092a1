"""Ticks share what agents claim until a claim changes; then each keeps its own."""

from pathlib import Path

import msgspec
import numpy as np

from agent.messages import Place
from tests.small_scenario import SMALL
from worldsim.engine.step import world_of
from worldsim.engine.telemetry import NO_TELEMETRY, FleetTelemetry
from worldsim.judge.tick import Tick, same_claims
from worldsim.scenario.file import parse

WORLD = world_of(parse(SMALL, Path("small.toml")), command_ticks=3)
BOTH, FIRST = np.array([True, True]), np.array([True, False])


def tick(telemetry: FleetTelemetry, running: np.ndarray, recorded: bool = False) -> Tick:
    return telemetry.tick(WORLD, running, recorded, {})


def claim(telemetry: FleetTelemetry, place: Place, force: float = 1.0) -> None:
    said = msgspec.structs.replace(NO_TELEMETRY, place=place, force=force, mission=0)
    telemetry.update(1, said, heading=0.0)


def test_ticks_share_their_claims_until_one_changes() -> None:
    telemetry = FleetTelemetry(2)
    claim(telemetry, Place(0, 1))
    first = tick(telemetry, BOTH)
    claim(telemetry, Place(0, 1), force=2.0)
    again = tick(telemetry, BOTH)
    assert again.place is first.place
    claim(telemetry, Place(0, 2))
    changed = tick(telemetry, BOTH)
    assert not same_claims(first, changed)
    assert first.place.tolist() == [[-1, -1], [0, 1]]
    assert changed.place.tolist() == [[-1, -1], [0, 2]]


def test_an_agent_that_stops_claims_nothing_until_it_runs_again() -> None:
    telemetry, running = FleetTelemetry(2), BOTH.copy()
    claim(telemetry, Place(0, 1))
    before = tick(telemetry, running)
    running[1] = False  # the membership changes its own rows
    without = tick(telemetry, running)
    assert before.alive.tolist() == [True, True]
    assert without.place.tolist() == [[-1, -1], [-1, -1]]
    assert same_claims(before, tick(telemetry, BOTH))


def test_reasons_are_told_where_ticks_are_recorded() -> None:
    telemetry = FleetTelemetry(2)
    claim(telemetry, Place(0, 1), force=2.0)
    assert np.isnan(tick(telemetry, BOTH).force).all()
    assert tick(telemetry, FIRST, recorded=True).force.tolist()[1:] != [2.0]
    assert tick(telemetry, BOTH, recorded=True).force.tolist()[1:] == [2.0]


def test_what_the_safety_filter_does_is_told_where_ticks_are_recorded() -> None:
    telemetry = FleetTelemetry(2)
    said = msgspec.structs.replace(NO_TELEMETRY, filter_mps=0.5)
    telemetry.update(1, said, heading=0.0)
    assert tick(telemetry, BOTH).filtered_mps is None
    filtered = tick(telemetry, BOTH, recorded=True).filtered_mps
    assert filtered is not None
    np.testing.assert_allclose(filtered, [np.nan, 0.5], atol=1e-6)
    telemetry.forget(1)
    gone = tick(telemetry, BOTH, recorded=True).filtered_mps
    assert gone is not None
    assert np.isnan(gone).all()
