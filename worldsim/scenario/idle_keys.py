"""Keys of a scenario that have no effect: each is a warning with the key's name.

A key counts as set where it differs from its default.
"""

from collections.abc import Iterator
from math import inf
from typing import Any, NamedTuple

from agent.config import SCANNERS, Control, Sensors, Vehicle
from agent.qstructure.formation import FormationSpec
from netem.link_parameters import Conditions, LinkKeys
from worldsim.scenario.events import EventTable
from worldsim.scenario.faults import SabotageFault
from worldsim.scenario.obstacle_tables import Movable
from worldsim.scenario.problem import Problem
from worldsim.scenario.tables import Expectations, Scenario
from worldsim.scenario.target_frame import FrameTable

Q_STRUCTURE_KEYS = ("cast_near_m", "cast_far_m", "avoidance")
"""Keys of [control] that only the controller q_structure reads, of those that come along."""


class Partner(NamedTuple):
    """A link's key that needs another one."""

    key: str
    needs: tuple[str, ...]  # one of them
    detail: str


PARTNERS = (
    Partner(
        "reorder_percent",
        ("delay_ms", "jitter_ms"),
        "without delay_ms no frame is late, so none can overtake it",
    ),
    Partner("distribution", ("jitter_ms",), "it is the shape of jitter_ms, which is 0"),
    Partner(
        "delay_correlation_percent",
        ("jitter_ms",),
        "it is the correlation of jitter_ms, which is 0",
    ),
    Partner("rate_overhead_b", ("rate_kbit",), "it counts for rate_kbit, which is not set"),
    Partner(
        "limit",
        ("rate_kbit",),
        "it is the length of the queue before rate_kbit, which is not set; unlike tc's limit it"
        " does not count the frames that delay_ms holds back",
    ),
)


class _LinkTable(NamedTuple):
    """A table with keys of links."""

    key: str
    table: LinkKeys
    channel: str | None  # None: of both


def idle_keys(scenario: Scenario) -> Iterator[Problem]:
    """Yield a problem for each key that is set and has no effect."""
    yield from _of_links(scenario)
    yield from _of_sensors(scenario)
    yield from _of_saboteurs(scenario)
    yield from _of_vehicles(scenario)
    yield from _of_control(scenario)
    yield from _of_frame(scenario)
    yield from _of_obstacles(scenario)
    yield from _of_expectations(scenario)
    yield from _of_times(scenario)


def _of_links(scenario: Scenario) -> Iterator[Problem]:
    found = list(_link_tables(scenario))
    for each in found:
        for partner in PARTNERS:
            given = getattr(each.table, partner.key)
            # Another table of the same channel, or an event, may give what the key needs.
            near = [other.table for other in found if _meet(each.channel, other.channel)]
            if given and not any(getattr(table, key) for table in near for key in partner.needs):
                yield Problem(f"{each.key}.{partner.key}", f"no effect: {partner.detail}")
    if scenario.comms.multihop_hz == 0.0 and scenario.netem.multihop != LinkKeys():
        yield Problem("netem.multihop", "no effect: comms.multihop_hz is 0, so the channel is off")


def _meet(one: str | None, other: str | None) -> bool:
    return one is None or other is None or one == other


def _link_tables(scenario: Scenario) -> Iterator[_LinkTable]:
    yield from _tables_of(scenario.netem, "netem")
    for index, event in enumerate(scenario.event):
        if event.netem is not None:
            yield from _tables_of(event.netem, f"event[{index}].netem")


def _tables_of(conditions: Conditions, key: str) -> Iterator[_LinkTable]:
    yield _LinkTable(key, conditions, None)
    yield _LinkTable(f"{key}.local", conditions.local, "local")
    yield _LinkTable(f"{key}.multihop", conditions.multihop, "multihop")
    for index, link in enumerate(conditions.link):
        yield _LinkTable(f"{key}.link[{index}]", link, None)


def _of_sensors(scenario: Scenario) -> Iterator[Problem]:
    carried = {kind for vehicle in scenario.vehicles for kind in vehicle.sensors}
    for kind in ("proximity", *SCANNERS):
        if kind not in carried and getattr(scenario.sensor, kind) != getattr(Sensors(), kind):
            yield Problem(f"sensor.{kind}", f"no effect: no vehicle's sensors have {kind!r}")
    laser = scenario.sensor.laser
    if "laser" in carried and laser.rings == 1 and laser.elevation_deg > 0.0:
        detail = "no effect: the one ring of the laser is level; set rings as well"
        yield Problem("sensor.laser.elevation_deg", detail)
    for index, event in enumerate(scenario.event):
        kind_given = event.sensor.kind if event.sensor is not None else None
        if kind_given is not None and kind_given not in carried:
            detail = f"no effect: no vehicle's sensors have {kind_given!r}"
            yield Problem(f"event[{index}].sensor.kind", detail)


def _of_saboteurs(scenario: Scenario) -> Iterator[Problem]:
    for index, event in enumerate(scenario.event):
        table = event.sabotage
        if table is None:
            continue
        replays = table.kind == "replay"
        default = SabotageFault(kind=table.kind, agents=table.agents)
        key = "per_s" if replays else "delay_s"
        if _is_set(table, default, key):
            detail = "a replay sends each frame once more" if replays else "only a replay is late"
            yield Problem(f"event[{index}].sabotage.{key}", f"no effect: {detail}")


def _of_vehicles(scenario: Scenario) -> Iterator[Problem]:
    own, vehicles = scenario.vehicle, scenario.vehicles
    kinds = {vehicle.kind for vehicle in vehicles}
    if "accelerating" not in kinds and _is_set(own, Vehicle(), "max_accel_mps2"):
        yield Problem("vehicle.max_accel_mps2", "no effect: no vehicle's kind is 'accelerating'")
    both = own.max_turn_left_deg is not None and own.max_turn_right_deg is not None
    if both and not scenario.agent and _is_set(own, Vehicle(), "max_turn_deg"):
        detail = "no effect: max_turn_left_deg and max_turn_right_deg are both given"
        yield Problem("vehicle.max_turn_deg", detail)


def _of_control(scenario: Scenario) -> Iterator[Problem]:
    if scenario.control.controller == "flocking":
        for key in Q_STRUCTURE_KEYS:
            if _is_set(scenario.control, Control(), key):
                yield Problem(f"control.{key}", "no effect: the controller 'flocking' ignores it")


def _of_frame(scenario: Scenario) -> Iterator[Problem]:
    changed = any(event.frame is not None for event in scenario.event)
    fixed = scenario.frame.yaw == "fixed" and not changed
    if fixed and _is_set(scenario.frame, FrameTable(), "turn_dps"):
        yield Problem("frame.turn_dps", "no effect: yaw is 'fixed', so the frame never turns")


def _of_obstacles(scenario: Scenario) -> Iterator[Problem]:
    for index, obstacle in enumerate(scenario.obstacle):
        if isinstance(obstacle, Movable) and obstacle.waypoints_m is None:
            for key in ("from_s", "at_end"):
                if _is_set(obstacle, Movable(), key):
                    detail = "no effect: the obstacle rests; waypoints_m let it move"
                    yield Problem(f"obstacle[{index}].{key}", detail)


def _of_expectations(scenario: Scenario) -> Iterator[Problem]:
    expect = scenario.expect
    if not expect.converge and _is_set(expect, Expectations(), "converge_within_s"):
        yield Problem("expect.converge_within_s", "no effect: expect.converge is false")
    if not scenario.obstacle and expect.min_obstacle_distance_m is not None:
        yield Problem("expect.min_obstacle_distance_m", "no effect: there is no obstacle")
    if expect.attitude_within_deg is not None and not any(
        each.oriented for each in _specs(scenario)
    ):
        yield Problem("expect.attitude_within_deg", "no effect: no queue has an orientation")
    if expect.idle_faults and not any(each.is_fault for each in scenario.event):
        yield Problem("expect.idle_faults", "no effect: no event is a fault")


def _of_times(scenario: Scenario) -> Iterator[Problem]:
    last_s = (scenario.slots - 1) / scenario.slot_hz
    killed_s = min((each.at_s for each in scenario.event if _kills_world(each)), default=inf)
    for index, event in enumerate(scenario.event):
        if round(event.at_s - last_s, 9) > 0.0:
            detail = f"no effect: the last slot begins at {last_s:g} s"
            yield Problem(f"event[{index}].at_s", detail)
        elif event.at_s > killed_s:
            detail = f"no effect: the world is killed at {killed_s:g} s"
            yield Problem(f"event[{index}].at_s", detail)
        if event.every_s is not None and round(event.at_s + event.every_s - last_s, 9) > 0.0:
            detail = "no effect: the run is over before it happens again"
            yield Problem(f"event[{index}].every_s", detail)


def _kills_world(event: EventTable) -> bool:
    return event.kill is not None and event.process == "world"


def _specs(scenario: Scenario) -> Iterator[FormationSpec]:
    """Yield every formation of a scenario."""
    yield scenario.formation
    for event in scenario.event:
        if event.formation is not None:
            yield event.formation


def _is_set(table: Any, default: Any, key: str) -> bool:
    return bool(getattr(table, key) != getattr(default, key))
