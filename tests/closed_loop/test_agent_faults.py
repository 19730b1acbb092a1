"""Faults of single agents whose processes go on: the others are unaffected, and nobody collides."""

from collections.abc import Sequence

import numpy as np
import pytest

from agent.messages import Believed, Observation
from tests.closed_loop.test_faults import (
    BAD,
    check_safety,
    flown,
    reformed_s,
    scenario,
    violated,
)
from worldsim.engine.virtual import Flight, fly
from worldsim.judge.run_events import RunEvent
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures

STRUCK = 4


def others_stand(flight: Flight) -> bool:
    """Return whether all but the struck agent hold places of their own."""
    found = [place for agent, place in enumerate(flight.loop.effects.places) if agent != STRUCK]
    return None not in found and len(set(found)) == 8


def breaches(flight: Flight) -> list[str]:
    """Return the violated ones of the invariants whose premise held."""
    found = flight.loop.judge.invariants()
    return [name for name, tally in found.items() if tally.violations]


@pytest.mark.parametrize(("radio", "offset_s"), [({}, -3.0), ({}, 100.0), (BAD, 3.0)])
def test_an_agent_with_a_wrong_clock_is_left_out_and_comes_back(
    radio: dict[str, str], offset_s: float
) -> None:
    fault = f"at_s = 15, for_s = 15, clock = {{ agents = [{STRUCK}], offset_s = {offset_s} }}"
    flight = flown(1, 60, fault, **radio)
    assert breaches(flight) == []
    assert max(reformed_s(flight)) <= 15.0
    rejected = flight.loop.rejections.by_cause()
    assert rejected["future" if abs(offset_s) < 5.0 else "old"] > 100


@pytest.mark.parametrize("offset_s", [3.0, -3.0])
def test_the_others_keep_places_of_their_own_while_a_clock_is_wrong(offset_s: float) -> None:
    fault = f"at_s = 15, clock = {{ agents = [{STRUCK}], offset_s = {offset_s} }}"
    flight = flown(1, 40, fault)
    assert violated(flight) == []
    assert others_stand(flight)


def test_a_clock_that_is_off_by_a_tick_changes_nothing_of_note() -> None:
    flight = flown(1, 40, f"at_s = 15, clock = {{ agents = [{STRUCK}], offset_s = 0.05 }}")
    assert violated(flight) == []
    assert flight.loop.judge.phases[0].residual_m is not None
    assert flight.loop.judge.phases[0].residual_m < 0.05


def test_vehicles_without_a_sensor_keep_apart_while_clocks_are_wrong() -> None:
    """The jump at the end would make old reports seem fresh, if the agent kept them."""
    for offset_s in (3.0, -3.0, 0.09):
        flight = flown(
            3,
            25,
            f"at_s = 1, for_s = 4, clock = {{ agents = [1, 5], offset_s = {max(offset_s, -1.0)} }}",
            f"at_s = 8, for_s = 4, clock = {{ agents = [2], offset_s = {offset_s} }}",
            **{"vehicle.sensors": "[]"},
        )
        check_safety(flight)
        assert np.isfinite(flight.loop.world.vehicles.position).all()


POSES = {
    "off by a tenth": "bias_m = [0.1, 0, 0]",
    "on another's place": "bias_m = [-0.577, 0.577, 0.577]",
    "far off": "bias_m = [5, 0, 0]",
    "noisy": "noise_m = 0.3",
    "turned": "bias_yaw_deg = 30",
}


@pytest.mark.parametrize("pose", POSES.values(), ids=POSES)
def test_an_agent_with_a_wrong_pose_collides_with_nobody_and_comes_back(pose: str) -> None:
    fault = f"at_s = 15, for_s = 15, pose = {{ agents = [{STRUCK}], {pose} }}"
    flight = flown(1, 45, fault)
    assert breaches(flight) == []
    assert max(reformed_s(flight)) <= 10.0
    residual_m = flight.loop.judge.phases[0].residual_m
    assert residual_m is not None
    assert residual_m < 0.05


def test_half_a_team_with_wrong_poses_converges_without_a_collision() -> None:
    """It is struck while vehicles cross each other's ways."""
    wrong = "agents = [0, 2, 4, 6], bias_m = [0.4, -0.4, 0.3], noise_m = 0.1, bias_yaw_deg = 40"
    flight = flown(2, 30, f"at_s = 1, for_s = 12, pose = {{ {wrong} }}")
    assert breaches(flight) == []
    assert max(reformed_s(flight)) <= 10.0


def test_convergence_is_judged_by_where_vehicles_are() -> None:
    flight = flown(1, 25, f"at_s = 12, pose = {{ agents = [{STRUCK}], bias_m = [0.3, 0, 0] }}")
    residual_m = flight.loop.judge.phases[0].residual_m
    assert residual_m == pytest.approx(0.3, abs=0.02)


@pytest.mark.parametrize("delay_s", [0.2, 2.0])
def test_slow_agents_collide_with_nobody_and_the_team_forms_again(delay_s: float) -> None:
    """They are struck while they fly to their places, and once more in them."""
    slow = f"slow = {{ agents = [0, 3, {STRUCK}], delay_s = {delay_s} }}"
    flight = flown(1, 40, f"at_s = 1, for_s = 5, {slow}", f"at_s = 22, for_s = 5, {slow}")
    assert breaches(flight) == []
    assert reformed_s(flight)[-1] <= 10.0
    assert (flight.loop.world.discarded > 0) == (delay_s > 0.05)


def test_no_agent_that_is_slow_by_half_a_second_counts_as_dead() -> None:
    flight = flown(1, 40, f"at_s = 15, for_s = 20, slow = {{ agents = [{STRUCK}], delay_s = 0.5 }}")
    assert breaches(flight) == []
    moved = [e for e in flight.loop.events if e.kind in {"slot", "role"} and e.t_s > 15.0]
    assert moved == []


class Heard:
    """Records how many others each agent hears, by time."""

    records_ticks = True

    def __init__(self) -> None:
        self.least = dict.fromkeys(range(9), 8)

    def tick(self, tick: Tick, figures: Figures) -> None:
        if tick.time_s > 12.0:
            for agent, heard in enumerate(np.bincount(tick.links[:, 0], minlength=9).tolist()):
                self.least[agent] = min(self.least[agent], heard)

    def observe(self, observations: Sequence[tuple[int, Observation]]) -> None:
        """What agents observe is not looked at."""

    def believe(self, agent: int, slot: int, believed: Believed) -> None:
        """What agents believe is not looked at."""

    def event(self, event: RunEvent) -> None:
        """The loop keeps the events itself."""


@pytest.mark.parametrize("starved", ["[4]", "['all']"])
def test_no_agent_of_a_starved_team_counts_as_dead(starved: str) -> None:
    fault = f"at_s = 15, for_s = 20, starve = {{ agents = {starved}, cpu_percent = 20 }}"
    heard = Heard()
    flight = fly(scenario(1, 45, fault), heard)
    check_safety(flight)
    assert breaches(flight) == []
    assert set(heard.least.values()) == {8}
    moved = [e for e in flight.loop.events if e.kind in {"slot", "role"} and e.t_s > 15.0]
    assert moved == []
    assert flight.loop.judge.in_formation_fraction == 1.0


def test_a_team_starved_while_it_forms_collides_with_nobody_and_forms() -> None:
    flight = flown(2, 45, "at_s = 1, for_s = 20, starve = { agents = ['all'], cpu_percent = 20 }")
    assert breaches(flight) == []
    assert max(reformed_s(flight)) <= 25.0
