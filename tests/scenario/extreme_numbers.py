"""Scenarios whose numbers are as small, as large and as odd as a file can hold.

``check`` answers for each in bounded time, and what it accepts flies without an exception:

    python -m tests.scenario.extreme_numbers 0 1000    # base and count
"""

import random
import sys
from collections.abc import Iterator
from copy import deepcopy
from time import process_time
from typing import Any

import msgspec
import tomli_w

from agent.codec import encode
from agent.config import AgentSetup
from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS, admit
from worldsim.engine.virtual import VirtualFleet
from worldsim.scenario.file import dump, parse
from worldsim.scenario.rules import warnings_for
from worldsim.scenario.tables import Scenario
from worldsim.scenario.toml import ScenarioError

Data = dict[str, Any]
Spot = tuple[str | int, ...]

SLOTS = 60
"""Slots flown of each scenario that is accepted."""
AMOUNTS = (
    *(0.0, 5e-324, 1e-310, 1e-160, 1e-9, 1e-5, 0.001, 0.0011, 0.01, 0.1, 0.3, 1.0, 2.0, 3.0),
    *(15.0, 45.0, 60.0, 85.0, 90.0, 100.0, 120.0, 350.0, 360.0, 720.0, 1e3, 5e3, 1e4, 86_400.0),
    *(1e5, 9.3e5, 9.85e5, 1e6, 1e9, 2.0**53, 1e18, 1e160, 1.7e308),
)
TEXTS = (
    *("s*1e-7", "1e5*s", "s", "0", "1/(3-s)", "tan(s)", "sin(1e4*s)", "exp(s)", "s**9", "1e300*s"),
    *("1e-300*s", "sqrt(4-s)", "floor(s)", "1/d", "1/(d-1)", "1e300*d", "log(d)", "tan(d)"),
)
SHAPES: tuple[Data, ...] = (
    {"kind": "ray", "direction": [-1.0, 1.0, 1.0]},
    {"kind": "polyline", "points_m": [[0.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [-2.0, 5.0, 0.0]]},
    {"kind": "arc", "radius_m": 3.0, "sweep_deg": 120.0, "heading_deg": 20.0},
    {"kind": "helix", "radius_m": 1.5, "pitch_m": 2.0, "heading_deg": 20.0},
    {"kind": "spline", "points_m": [[0.0, 0.0, 0.0], [-2.0, 1.0, 0.0], [-4.0, 0.0, 1.0]]},
    {"kind": "curve", "x": "2*cos(s)", "y": "2*sin(s)", "z": "0.3*s"},
)
FRAMES: tuple[Data, ...] = (
    {"waypoints_m": [[0.0, 0.0, 0.0]], "yaw_deg": 10.0},
    {
        "waypoints_m": [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 3.0, 0.0]],
        "speed_mps": 0.2,
        "start_s": 0.2,
        "yaw": "path",
        "turn_dps": 20.0,
        "pauses_s": [0.0, 1.0, 0.0],
    },
)
OBSTACLES: tuple[Data, ...] = (
    {"shape": "sphere", "centre_m": [8.0, 1.0, 0.0], "radius_m": 0.5},
    {"shape": "box", "centre_m": [8.0, 1.0, 0.0], "size_m": [1.0, 1.0, 2.0], "yaw_deg": 10.0},
    {
        "shape": "cylinder",
        "waypoints_m": [[8.0, 1.0, 0.0], [8.0, 5.0, 0.0]],
        "speed_mps": 0.5,
        "radius_m": 0.5,
        "height_m": 2.0,
        "from_s": 0.1,
    },
    {
        "shape": "wall",
        "from_m": [8.0, 1.0, 0.0],
        "to_m": [8.0, 5.0, 0.0],
        "height_m": 2.0,
        "thickness_m": 0.1,
    },
)
FIELDS: tuple[Data, ...] = tuple(
    {
        "centre_m": [20.0, 0.0, 0.0],
        "size_m": [20.0, 20.0, 5.0],
        "count": 3,
        "shape": shape,
        "radius_m": [0.3, 0.6],
        "corridor_m": 1.7,
        "clear_of_start_m": 1.0,
    }
    for shape in ("sphere", "cylinder")
)
EVENTS: tuple[Data, ...] = (
    {"kill": [1], "for_s": 0.2},
    {"leave": [1], "for_s": 0.2},
    {"join": {"count": 1}},
    {"jam": {"centre_m": [0.0, 0.0, 0.0], "radius_m": 2.0}, "for_s": 0.2},
    {"flap": {"period_s": 0.2}, "for_s": 0.2},
    {"sabotage": {"kind": "garbage", "agents": [1], "per_s": 20.0}, "for_s": 0.2},
    {"intruder": {"agents": [1], "per_s": 20.0}, "for_s": 0.2},
    {"sabotage": {"kind": "replay", "agents": [1], "delay_s": 0.1}, "for_s": 0.2},
    {"netem": {"loss_percent": 50.0, "delay_ms": 100.0}, "for_s": 0.2},
    {"frame": {"waypoints_m": [[1.0, 0.0, 0.0]], "yaw_deg": 90.0}},
    {"frame": {"waypoints_m": [[1.0, 0.0, 0.0], [3.0, 0.0, 0.0]], "speed_mps": 0.3}},
    {"sensor": {"agents": [1], "mode": "wrong"}, "for_s": 0.2},
)
SCANNERS: Data = {
    "laser": {
        "range_m": 4.0,
        "field_deg": 180.0,
        "rays": 21,
        "elevation_deg": 30.0,
        "rings": 3,
        "rate_hz": 10.0,
        "noise_m": 0.02,
        "dropout_percent": 5.0,
    },
    "sonar": {"range_m": 2.0, "ring": 8, "up_down": True, "beam_deg": 22.5, "rate_hz": 10.0},
    "proximity": {"noise_m": 0.01},
}
LINK: Data = {
    "range_m": 6.0,
    "delay_ms": 20.0,
    "jitter_ms": 5.0,
    "delay_correlation_percent": 25.0,
    "loss_percent": 10.0,
    "duplicate_percent": 1.0,
    "corrupt_percent": 1.0,
    "reorder_percent": 1.0,
    "rate_kbit": 400.0,
    "rate_overhead_b": 40,
    "limit": 100,
    "gemodel": {"p_percent": 2.0, "r_percent": 25.0},
    "path_loss": {
        "exponent": 3.0,
        "reference_loss_db": 40.0,
        "budget_db": 66.0,
        "reference_distance_m": 1.0,
        "shadowing_db": 4.0,
    },
}


def base(draw: random.Random) -> Data:
    """Return a sound scenario with one of each kind of table, drawn."""
    field = {"obstacle_field": draw.choice(FIELDS)} if draw.random() < 0.3 else {}
    queue: Data = {"name": "Q", "vertices": ["V"], "shape": deepcopy(draw.choice(SHAPES))}
    if draw.random() < 0.3:
        queue["orientation"] = {"yaw_deg": "10*d", "pitch_deg": 3.0}
    closed = {"name": "C", "vertices": ["V", "W"], "capacity": 0.3}
    return deepcopy(
        {
            "seed": 1,
            "duration_s": 2.0,
            "fleet": {
                "agents": 4,
                "tick_hz": 20.0,
                "boot_s": 0.1,
                "start": {
                    "kind": "box",
                    "centre_m": [0.0, 0.0, 0.0],
                    "size_m": [5.0, 5.0, 3.0],
                    "spacing_m": 0.6,
                },
            },
            "formation": {
                "name": "f",
                "vertices": {"V": [0.0, 0.0, 0.0], "W": [5.0, 0.0, 0.0]},
                "queue": [{**queue, "capacity": 0.7}, closed],
            },
            "vehicle": {
                "kind": draw.choice(("kinematic", "accelerating", "forward")),
                "radius_m": 0.1,
                "max_speed_mps": 0.5,
                "max_climb_mps": 0.5,
                "max_accel_mps2": 2.0,
                "max_yaw_rate_dps": 180.0,
                "max_turn_deg": 45.0,
                "max_turn_left_deg": 30.0,
                "max_tilt_deg": 90.0,
                "sensors": draw.choice((["proximity"], ["laser"], ["sonar", "proximity"], [])),
            },
            "sensor": SCANNERS,
            "control": {
                "controller": draw.choice(("q_structure", "q_structure", "flocking")),
                "spacing_m": 1.0,
                "separation_m": 0.25,
                "safety_m": 0.6,
                "clearance_m": 0.5,
                "cast_near_m": 0.05,
                "cast_far_m": 0.5,
                "avoidance": draw.choice(("constellation", "direct", "none")),
            },
            "comms": {"local_hz": 20.0, "multihop_hz": 2.0},
            "netem": {**LINK, "distribution": draw.choice(("uniform", "normal", "pareto"))},
            "frame": draw.choice(FRAMES),
            "obstacle": [draw.choice(OBSTACLES)],
            **field,
            "event": [{"at_s": 0.5, **draw.choice(EVENTS)}],
            "expect": {"converge_within_s": 1.0, "reform_within_s": 1.0},
        }
    )


def spots(data: Any, spot: Spot = ()) -> Iterator[Spot]:
    """Yield the place of every number and every expression in the data."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data):
        if isinstance(value, dict | list):
            yield from spots(value, (*spot, key))
        elif key in {"x", "y", "z", "yaw_deg", "pitch_deg"} or not isinstance(value, str | bool):
            yield (*spot, key)


def extreme(draw: random.Random) -> Data:
    """Return a scenario with one to three extreme numbers."""
    data = base(draw)
    for _ in range(draw.choice((1, 1, 2, 3))):
        *where, last = draw.choice(list(spots(data)))
        table: Any = data
        for key in where:
            table = table[key]
        table[last] = _other(draw, table[last])
    return data


def _other(draw: random.Random, value: Any) -> Any:
    if isinstance(value, str):
        return draw.choice(TEXTS)
    amount = draw.choice(AMOUNTS) * draw.choice((1.0, 1.0, -1.0))
    return int(amount) if isinstance(value, int) and abs(amount) < 2.0**63 else amount


def checked(data: Data) -> Scenario | None:
    """Return the scenario as ``check`` accepts it, or None if it is refused.

    What is accepted is accepted again as it is written into a run's folder.
    """
    text = tomli_w.dumps(data)
    try:
        scenario = parse(text, "extreme.toml")
        admit(scenario, "extreme.toml", VIRTUAL_COMMAND_TICKS)
    except ScenarioError as error:
        assert "\n" not in str(error)
        return None
    warnings_for(scenario)
    assert parse(dump(scenario), "resolved.toml") == scenario
    return scenario


def fly(scenario: Scenario) -> None:
    """Fly a scenario's first slots, its agents configured as processes are."""
    for agent in range(scenario.fleet.agents):
        setup = scenario.agent_setup(agent, 0, VIRTUAL_COMMAND_TICKS)
        assert msgspec.msgpack.decode(encode(setup), type=AgentSetup) == setup
    fleet = VirtualFleet(scenario)
    for _ in range(min(SLOTS, scenario.slots)):
        fleet.slot()
    fleet.loop.finish()


def main(first: int, count: int) -> None:
    """Check and fly ``count`` scenarios, the seeds from ``first`` on."""
    flown, slowest = 0, (0.0, 0)
    for seed in range(first, first + count):
        began = process_time()
        try:
            scenario = checked(extreme(random.Random(seed)))
            slowest = max(slowest, (process_time() - began, seed))
            if scenario is not None:
                flown += 1
                fly(scenario)
        except Exception as error:
            print(f"seed {seed}: {type(error).__name__}: {error}")
    print(
        f"{count} scenarios, {flown} flown; slowest check {slowest[0]:.2f} s of seed {slowest[1]}"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
