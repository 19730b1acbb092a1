"""``check`` warns of a queue whose yaw vehicles cannot hold while its slots move."""

import pytest

from worldsim.scenario.file import parse
from worldsim.scenario.rules import warnings_for

LINE = """
duration_s = 60.0
[fleet]
agents = 4
[formation]
name = "two"
vertices = { V1 = [0, 0, 0] }
[[formation.queue]]
name = "free"
vertices = ["V1"]
shape = { kind = "ray", direction = [1, 0, 0] }
[[formation.queue]]
name = "tail"
vertices = ["V1"]
shape = { kind = "ray", direction = [-1, 0, 0] }
orientation = { yaw_deg = "30*d" }
"""
AHEAD = {"frame.waypoints_m": "[[0, 0, 0], [3, 0, 0]]", "frame.speed_mps": "0.3"}
KEY = "formation.queue[1].orientation.yaw_deg"


def warned(overrides: dict[str, str], text: str = LINE) -> list[tuple[str, str]]:
    found = warnings_for(parse(text, overrides=overrides))
    return [(each.key, each.detail) for each in found if "orientation" in each.key]


def test_a_frame_at_rest_lets_any_yaw_be_held() -> None:
    assert warned({}) == []


def test_a_slot_that_moves_outside_the_cone_of_its_yaw_is_named() -> None:
    ((key, detail),) = warned({**AHEAD, "frame.start_s": "12", "fleet.agents": "6"})
    assert key == KEY
    assert detail.startswith(
        "queue 'tail': from 12 s on, its slot at 2 m moves 60 degrees off this yaw, and vehicles"
        " fly at most 45 off their heading"
    )


@pytest.mark.parametrize(
    ("overrides", "is_warned"),
    [
        (AHEAD, False),
        ({**AHEAD, "vehicle.max_turn_deg": "29"}, True),
        ({**AHEAD, "vehicle.max_turn_left_deg": "20"}, False),
        ({**AHEAD, "vehicle.max_turn_right_deg": "20"}, True),
        ({**AHEAD, "agent": "[{ ids = [2], vehicle = { max_turn_deg = 20 } }]"}, True),
        ({**AHEAD, "vehicle.kind": "forward"}, True),
        ({**AHEAD, "frame.waypoints_m": "[[0, 0, 0], [0, 0, 3]]"}, False),
        ({**AHEAD, "frame.waypoints_m": "[[0, 0, 0], [0, 3, 0]]"}, True),
        ({**AHEAD, "frame.waypoints_m": "[[0, 0, 0], [0, 3, 0]]", "frame.yaw": "path"}, False),
        ({**AHEAD, "frame.start_s": "59.9"}, False),
    ],
)
def test_the_cone_is_that_of_the_vehicles_on_the_way_that_is_flown(overrides, is_warned) -> None:
    assert bool(warned({**overrides, "fleet.agents": "3"})) is is_warned


def test_a_frame_that_turns_moves_its_slots_sideways() -> None:
    corner = {
        "frame.waypoints_m": "[[0, 0, 0], [3, 0, 0], [3, 3, 0]]",
        "frame.speed_mps": "0.3",
        "frame.yaw": "path",
    }
    ((_, detail),) = warned({**corner, "fleet.agents": "3"})
    assert "from 10 s on, its slot at 1 m moves 120 degrees off this yaw" in detail


@pytest.mark.parametrize("begins_s", [20, 59])
def test_missions_of_the_timeline_are_looked_at_from_their_time_on(begins_s) -> None:
    event = f"[{{ at_s = {begins_s}, frame = {{ waypoints_m = [[0, 0, 0], [-3, 0, 0]],"
    ((key, detail),) = warned({"event": event + " speed_mps = 0.3 } }]"})
    assert key == KEY
    assert f"from {begins_s} s on" in detail


def test_a_formation_of_the_timeline_is_named_by_its_event() -> None:
    turned = LINE[LINE.index("name =") :].replace("formation.queue", "event.formation.queue")
    text = LINE.replace('orientation = { yaw_deg = "30*d" }', "") + "\n[[event]]\nat_s = 2\n"
    text += "[event.formation]\n" + turned
    ((key, _),) = warned({**AHEAD, "fleet.agents": "6"}, text)
    assert key == "event[0].formation.queue[1].orientation.yaw_deg"


def test_a_path_that_another_one_replaces_in_time_is_not_flown() -> None:
    event = "[{ at_s = 20, frame = { waypoints_m = [[0, 0, 0]] } }]"
    overrides = {**AHEAD, "fleet.agents": "6", "event": event}
    assert warned({**overrides, "frame.start_s": "20"}) == []
    assert warned({**overrides, "frame.start_s": "19"}) != []
