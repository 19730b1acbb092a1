"""Places beyond the world's edge are refused by their key; up to it, a fleet flies."""

import pytest

from agent.messages import FLIGHT_M, FRAME_M
from tests.small_scenario import SMALL
from worldsim.engine.virtual import fly
from worldsim.scenario.file import parse
from worldsim.scenario.toml import ScenarioError

TOO_FAR = {
    "fleet.start.centre_m": {
        "fleet.start": "{ kind = 'box', centre_m = [1000000, 1000000, 0], size_m = [6, 6, 3] }"
    },
    "fleet.start.centre_m[0]": {
        "fleet.start": f"{{ kind = 'box', centre_m = [{FLIGHT_M}, 0, 0], size_m = [6, 6, 3] }}"
    },
    "fleet.start.positions_m[1]": {
        "fleet.start": "{ kind = 'list', positions_m = [[0, 0, 0], [0, 0, 986000]] }"
    },
    "frame.waypoints_m": {"frame.waypoints_m": "[[1000000, 0, 0]]"},
    "event[0].frame.waypoints_m": {
        "event": "[{ at_s = 1, frame = { waypoints_m = [[1000000, 1000000, 0]] } }]"
    },
    "event[0].join.start.centre_m": {
        "event": "[{ at_s = 1, join = { count = 1, start = { kind = 'box',"
        f" centre_m = [{-FLIGHT_M}, 0, 0] }} }} }}]"
    },
    "formation": {"formation.vertices.V1": "[90000, 0, 0]"},
    "frame.turn_dps": {
        "formation.vertices.V1": "[40000, 0, 0]",
        "frame": "{ waypoints_m = [[0, 0, 0], [9, 0, 0]], speed_mps = 0.1, yaw = 'path',"
        " turn_dps = 1 }",
    },
    "event[0].frame.waypoints_m[1]": {
        "event": "[{ at_s = 1, frame = { waypoints_m = [[1, 0, 0], [1, 0, 0]], speed_mps = 1 } }]"
    },
}


@pytest.mark.parametrize(("key", "overrides"), TOO_FAR.items(), ids=TOO_FAR)
def test_a_place_outside_the_world_is_refused_by_its_key(
    key: str, overrides: dict[str, str]
) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse(SMALL, overrides=overrides)
    assert caught.value.key.startswith(key)


@pytest.mark.parametrize("corner", [1.0, -1.0])
def test_a_fleet_flies_at_the_edge_of_the_world(corner: float) -> None:
    far, frame = corner * FLIGHT_M, corner * FRAME_M
    scenario = parse(
        SMALL,
        overrides={
            "fleet.start": f"{{ kind = 'list', positions_m = [[{far}, {far}, {far}],"
            f" [{far}, {far - corner}, {far}]] }}",
            "frame.waypoints_m": f"[[{frame}, {frame}, {frame}]]",
            "formation.vertices.V1": f"[{corner * 28_000}, {corner * 28_000}, {corner * 28_000}]",
            "duration_s": "1",
            "expect.converge": "false",
        },
    )
    assert fly(scenario).rejected == 0


def test_a_vehicle_does_not_fly_past_the_edge() -> None:
    scenario = parse(
        SMALL,
        overrides={
            "fleet.start": f"{{ kind = 'list', positions_m = [[{FLIGHT_M}, 0, 0],"
            f" [{FLIGHT_M - 0.4}, 0, 0]] }}",
            "control.controller": "flocking",
            "expect.converge": "false",
        },
    )
    flight = fly(scenario)
    assert abs(flight.loop.world.vehicles.position).max() <= FLIGHT_M
    assert flight.rejected == 0
