"""Rays lead to what agents sense; guiding lines bend away from surfaces (Fig. 7)."""

from dataclasses import replace

import msgspec
import numpy as np

from agent.config import SCANNERS, Vehicle
from agent.guidance.constellation import Constellation
from agent.messages import NO_ECHO_MM, Observation, Scan
from agent.sensing.ray_pattern import pattern_of
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.tick import Tick
from worldsim.recording import layout
from worldsim.recording.sensing_columns import SensingColumns
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario

SCENARIO = wedge(2, duration_s=0.5)
PLACES = ((0.0, 0.0, 1.0), (5.0, 0.0, 1.0))
WALL, AHEAD = (0.7, 0.0, 0.0), (3.0, 0.0, 0.0)


def tick(yaw: float = 0.0, alive: tuple[bool, bool] = (True, True)) -> Tick:
    attitude = np.array([[yaw, 0.0, 0.0]] * 2, dtype=np.float32)
    first = next(straight_flight(SCENARIO))
    return replace(first, position=np.array(PLACES), attitude=attitude, alive=np.array(alive))


def observation(index: int = 0, **sensed: object) -> Observation:
    """What an agent observes at a tick."""
    nothing = {"vehicles": (), "obstacles": (), "orders": (), "scans": ()}
    return Observation(
        slot=index * SLOTS_PER_TICK,
        time_s=0.0,
        position=PLACES[0],
        velocity=(0.0, 0.0, 0.0),
        yaw=0.0,
        **{**nothing, **sensed},
    )


def drawn(
    seen: dict[int, Observation], at: Tick, entity: str, scenario: Scenario = SCENARIO
) -> list[list[list[float]]]:
    """Return the lines or points that an entity draws at a tick."""
    columns = SensingColumns(scenario)
    columns.observe(list(seen.items()))
    return [
        shape
        for block in columns.blocks([at])
        if block.entity == entity
        for column in block.columns
        for row in column.as_arrow_array().to_pylist()
        for shape in row
    ]


def test_a_ray_leads_from_each_vehicle_to_all_that_it_senses() -> None:
    seen = {0: observation(vehicles=(AHEAD,), obstacles=(WALL,)), 1: observation(vehicles=(WALL,))}
    rays = np.array(drawn(seen, tick(), layout.RAYS))
    np.testing.assert_allclose(rays[:, 0], [PLACES[0], PLACES[0], PLACES[1]])
    np.testing.assert_allclose(rays[:, 1], [(3, 0, 1), (0.7, 0, 1), (5.7, 0, 1)], atol=1e-6)


def test_what_a_stopped_agent_observed_is_not_drawn() -> None:
    seen = {0: observation(obstacles=(WALL,)), 1: observation(obstacles=(WALL,))}
    rays = drawn(seen, tick(alive=(False, True)), layout.RAYS)
    assert [ray[0] for ray in rays] == [list(PLACES[1])]


def test_observations_of_other_ticks_are_not_drawn() -> None:
    assert not drawn({0: observation(index=1, obstacles=(WALL,))}, tick(), layout.RAYS)


def test_echoes_of_a_scan_turn_with_the_vehicle() -> None:
    scenario = msgspec.structs.replace(SCENARIO, vehicle=Vehicle(sensors=("sonar",)))
    pattern = pattern_of("sonar", scenario.sensor, scenario.fleet.tick_hz)
    ranges = np.full(len(pattern.axes), NO_ECHO_MM, dtype="<u2")
    beam = int(np.argmax([x for x, _, _ in pattern.axes]))
    ranges[beam] = 1500
    scan = Scan(SCANNERS.index("sonar"), ranges.tobytes())
    ahead = 1.5 * np.array(pattern.axes[beam])
    for yaw, turn in ((0.0, np.eye(3)), (np.pi / 2, np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]))):
        (ray,) = drawn({0: observation(scans=(scan,))}, tick(yaw), layout.RAYS, scenario)
        np.testing.assert_allclose(np.array(ray[1]) - PLACES[0], turn @ ahead, atol=1e-6)


def test_guiding_lines_keep_clear_of_a_wall_ahead() -> None:
    lines = np.array(drawn({0: observation(obstacles=(WALL,))}, tick(), layout.GUIDING_LINES))
    assert lines.shape == (8, 5, 3)
    free = np.array(Constellation(SCENARIO.control.safety_m).bent_lines(0.0, [])) + PLACES[0]
    assert lines[..., 0].max() < free[..., 0].max(), "they are drawn in"
    agents = drawn({0: observation(obstacles=(WALL,))}, tick(), layout.CONSTELLATION)
    np.testing.assert_allclose(np.array(agents).reshape(8, 5, 3), lines)


def test_vehicles_far_from_surfaces_have_no_guiding_lines() -> None:
    seen = {0: observation(obstacles=((1.9, 0.0, 0.0),), vehicles=(WALL,))}
    assert not drawn(seen, tick(), layout.GUIDING_LINES)
    assert len(drawn(seen, tick(), layout.RAYS)) == 2


def test_another_controller_or_avoidance_has_no_guiding_lines() -> None:
    seen = {0: observation(obstacles=(WALL,))}
    for key, value in (("controller", "flocking"), ("avoidance", "direct")):
        control = msgspec.structs.replace(SCENARIO.control, **{key: value})
        scenario = msgspec.structs.replace(SCENARIO, control=control)
        assert not drawn(seen, tick(), layout.GUIDING_LINES, scenario)
