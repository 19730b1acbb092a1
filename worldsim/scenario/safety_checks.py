"""Warnings where the safety filter cannot keep what a scenario asks of it, or only by standing.

Each names what the vehicles lack. Without these warnings, no controller makes vehicles touch one
another, or come nearer to an obstacle than ``control.clearance_m``.
"""

from collections.abc import Iterator
from itertools import combinations
from math import ceil, dist, inf
from typing import assert_never

from agent.config import SCANNERS, Vehicle
from agent.controller import BUILT_IN
from agent.guidance.sight import (
    braking_of,
    scanners_of,
    speed_cap_mps,
    surface_margin_m,
    vehicle_margin_m,
)
from agent.messages import PROXIMITY_RANGE_M
from netem.faults import Flap, Jam, Outage, Partition
from netem.link_parameters import Conditions
from worldsim.scenario.faults import Join, Kill, Leave, Pause, Restart, SensorFault
from worldsim.scenario.obstacle_tables import Obstacle, Wall
from worldsim.scenario.problem import Problem
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.tables import Scenario

SILENCING = (Kill, Leave, Pause, Restart, Join, Partition, Jam, Flap, Outage)
"""Faults after which an agent may be silent, or not know of another one."""
STOPPING = (Kill, Pause, Restart, Join, SensorFault, Outage)
"""Faults by which a vehicle hovers for a while or for good, so that it gives way to nothing."""
LOSS_OF_SILENCE = 80.0
"""From this loss on, a radio is silent for seconds at a time [%]."""
ELEVATION_DEG = 75.0
FIELD_DEG = 330.0
"""From these angles on, laser and sonars together leave no direction unseen."""
FLOWN_ELEVATION_DEG = 30.0
FLOWN_FIELD_DEG = 180.0
"""Enough for the built-in controllers, which fly where they look (docs/method.md)."""
GAP_DEG = 12.0
"""Widest gap between two rays through which no obstacle of 0.1 m is missed at 1 m."""
MOST_DROPOUT_PERCENT = 30.0


def vehicles_seen_by_radio_alone(scenario: Scenario) -> Problem | None:
    """Warn of agents without a proximity sensor where members may fall silent."""
    blind = [i for i, each in enumerate(scenario.vehicles) if "proximity" not in each.sensors]
    if not blind or scenario.rows == 1 or not _may_be_silent(scenario):
        return None
    return Problem(
        "vehicle.sensors",
        f"{_agents(blind)} without 'proximity' know other vehicles by radio alone: they stand still"
        " as soon as a silent one may be near, and do not know of one that was never heard",
    )


def obstacles_seen(scenario: Scenario) -> Problem | None:
    """Warn of agents that cannot see obstacles."""
    unable = [i for i, each in enumerate(scenario.vehicles) if not each.sensors]
    if not unable or not scenario.obstacle:
        return None
    return Problem(
        "vehicle.sensors",
        f"{_agents(unable)} without a sensor cannot see obstacles; 'proximity' sees them all round",
    )


def scanners_see_all_round(scenario: Scenario) -> Problem | None:
    """Warn of scanning sensors that leave directions unseen, where there are obstacles."""
    if not scenario.obstacle or not any(_scans_alone(each) for each in scenario.vehicles):
        return None
    if any("laser" not in each.sensors for each in _scanning_alone(scenario)):
        return Problem(
            "vehicle.sensors",
            "sonars alone see a ring: no distance is kept to what is above or below it; add 'laser'"
            " or 'proximity'",
        )
    if scenario.sensor.coverage == "planar":
        return Problem(
            "sensor.coverage",
            "'planar' sees one level slice: no distance is kept to what is above or below it, and"
            " vehicles may touch it; 'full' sees all round",
        )
    return _laser_sees_all_round(scenario)


def _laser_sees_all_round(scenario: Scenario) -> Problem | None:
    laser, controller = scenario.sensor.laser, scenario.control.controller
    built_in = controller in BUILT_IN
    elevation_deg = FLOWN_ELEVATION_DEG if built_in else ELEVATION_DEG
    field_deg = FLOWN_FIELD_DEG if built_in else FIELD_DEG
    needs = (
        ("elevation_deg", laser.elevation_deg, elevation_deg, "seen above and below"),
        ("field_deg", laser.field_deg, field_deg, "seen round about"),
        ("rays", laser.rays, ceil(laser.field_deg / GAP_DEG) + 1, "seen between two rays"),
        ("rings", laser.rings, ceil(2 * laser.elevation_deg / GAP_DEG) + 1, "seen between rings"),
    )
    for key, value, least, seen in needs:
        if value < least:
            return Problem(
                f"sensor.laser.{key}",
                f"{value:g}; at least {least:g} for all that is {seen} under the controller"
                f" {controller!r}: from the rest no distance is kept",
            )
    if laser.dropout_percent <= MOST_DROPOUT_PERCENT:
        return None
    return Problem(
        "sensor.laser.dropout_percent",
        f"{laser.dropout_percent:g}; up to {MOST_DROPOUT_PERCENT:g} a surface is seen in time",
    )


def seen_early_enough(scenario: Scenario) -> Problem | None:
    """Warn where the safety filter caps a vehicle's speed to what it sees, and name the cap."""
    for agent, vehicle in enumerate(scenario.vehicles):
        braking = braking_of(vehicle, 1.0 / scenario.fleet.tick_hz)
        cap = speed_cap_mps(vehicle, scenario.control, scenario.sensor, braking)
        if cap < vehicle.max_speed_mps:
            stops_m = braking.stopping_m(vehicle.max_speed_mps)
            return Problem(
                "vehicle.max_speed_mps",
                f"agent {agent} stops within {stops_m:.2g} m from {vehicle.max_speed_mps:g} m/s and"
                f" sees at most {PROXIMITY_RANGE_M:g} m ahead: the safety filter caps its speed at"
                f" {cap:.2g} m/s",
            )
    return None


def room_for_margins(scenario: Scenario) -> Problem | None:
    """Warn where a sensor's noise asks for more distance than there is."""
    control, sensor = scenario.control, scenario.sensor
    keeps_m = control.separation_m + vehicle_margin_m(sensor)
    ranging = any("proximity" in each.sensors for each in scenario.vehicles)
    if ranging and sensor.proximity.noise_m > 0.0 and keeps_m > control.spacing_m:
        return Problem(
            "sensor.proximity.noise_m",
            f"with {sensor.proximity.noise_m:g}, vehicles keep {keeps_m:.3g} m apart, and"
            f" control.spacing_m is {control.spacing_m:g}: they may not reach their places",
        )
    if not scenario.obstacle:
        return None
    margin_m = max(surface_margin_m(each, sensor) for each in scenario.vehicles)
    if control.clearance_m + margin_m < _sight_m(scenario):
        return None
    return Problem(
        "control.clearance_m",
        f"{control.clearance_m:g} and a margin of {margin_m:.2g} m for noise are not seen in time:"
        f" the sensors see {_sight_m(scenario):g} m",
    )


def starts_beyond_the_noise(scenario: Scenario) -> Problem | None:
    """Warn of vehicles that start nearer to one another than noise lets them fly."""
    margin_m = vehicle_margin_m(scenario.sensor)
    ranging = any("proximity" in each.sensors for each in scenario.vehicles)
    if margin_m == 0.0 or not ranging or scenario.rows == 1:
        return None
    keeps_m = scenario.control.separation_m + margin_m
    for key, start in _starts(scenario):
        least_m = _least_distance_m(start)
        if least_m < keeps_m:
            return Problem(
                key,
                f"vehicles start {least_m:.3g} m apart; within {keeps_m:.3g} m, for"
                f" sensor.proximity.noise_m = {scenario.sensor.proximity.noise_m:g}, they hardly"
                " move, and give way to nothing",
            )
    return None


def _starts(scenario: Scenario) -> Iterator[tuple[str, BoxStart | ListStart]]:
    """Yield the starts of the fleet and of those that join, with their keys."""
    yield "fleet.start", scenario.fleet.start
    for index, event in enumerate(scenario.event):
        if isinstance(event.action, Join) and event.action.start is not None:
            yield f"event[{index}].join.start", event.action.start


def _least_distance_m(start: BoxStart | ListStart) -> float:
    match start:
        case BoxStart():
            return start.spacing_m
        case ListStart():
            pairs = combinations(start.positions_m, 2)
            return min((dist(here, there) for here, there in pairs), default=inf)
        case _:
            assert_never(start)


def expectations_within_the_filter(scenario: Scenario) -> Problem | None:
    """Warn of distances to expect that are larger than those that the safety filter keeps."""
    expected, control = scenario.expect, scenario.control
    pairs = (
        ("min_separation_m", expected.min_separation_m, "separation_m", control.separation_m),
        (
            "min_obstacle_distance_m",
            expected.min_obstacle_distance_m,
            "clearance_m",
            control.clearance_m,
        ),
    )
    for key, asked, kept_key, kept in pairs:
        if asked is not None and asked > kept:
            return Problem(
                f"expect.{key}", f"{asked:g} is more than control.{kept_key} = {kept:g} keeps"
            )
    return None


def obstacles_give_way(scenario: Scenario) -> Problem | None:
    """Warn of moving obstacles that vehicles cannot evade."""
    return next(_obstacles_not_evaded(scenario), None)


def sensor_faults_noticed(scenario: Scenario) -> Problem | None:
    """Warn of sensor faults that agents cannot notice, for lack of reports to compare with."""
    if not _may_be_silent(scenario):
        return None
    for index, event in enumerate(scenario.event):
        if isinstance(event.action, SensorFault):
            return Problem(
                f"event[{index}].sensor",
                "an agent notices that its sensor fails by the reports of others; where those are"
                " silent, it may fly into what it does not see",
            )
    return None


def poses_right_without_a_sensor(scenario: Scenario) -> Problem | None:
    """Warn of wrong poses in a fleet in which some vehicle knows others by their reports alone."""
    unable = [i for i, each in enumerate(scenario.vehicles) if "proximity" not in each.sensors]
    for index, event in enumerate(scenario.event):
        if event.pose is not None and unable:
            return Problem(
                f"event[{index}].pose",
                f"{_agents(unable)} without 'proximity': reports alone keep nobody from a vehicle"
                " that reports itself elsewhere",
            )
    return None


def _obstacles_not_evaded(scenario: Scenario) -> Iterator[Problem]:
    for index, obstacle in enumerate(scenario.obstacle):
        if _speed_mps(obstacle) > 0.0:
            yield from _not_evaded(scenario, obstacle, f"obstacle[{index}]")


def _not_evaded(scenario: Scenario, obstacle: Obstacle, key: str) -> Iterator[Problem]:
    speed = _speed_mps(obstacle)
    if scenario.rows > 1 and scenario.control.controller not in BUILT_IN:
        yield Problem(
            key,
            "moves, and may reach a vehicle that others hold in its way: only the built-in"
            " controllers are known to make room",
        )
    if _from_s(obstacle) > 0.0:
        surprise_m = 2.0 * speed / scenario.fleet.tick_hz
        yield Problem(
            f"{key}.from_s",
            f"a vehicle beside it sees it start two ticks late, when it is {surprise_m:.2g} m"
            " nearer: clearance_m may be missed by that much",
        )
    for agent, vehicle in enumerate(scenario.vehicles):
        evading = _evading_mps(vehicle)
        if speed >= evading:
            yield Problem(
                f"{key}.speed_mps",
                f"{speed:g} is not below the {evading:.3g} m/s at which agent {agent} gives way",
            )
        if _scans_alone(vehicle):
            yield Problem(
                key, f"moves, and agent {agent} takes what it scans for at rest; fit 'proximity'"
            )
    for number, event in enumerate(scenario.event):
        if isinstance(event.action, STOPPING):
            yield Problem(
                key, f"may hit vehicles that hover after event[{number}]: they cannot give way"
            )


def _from_s(obstacle: Obstacle) -> float:
    return 0.0 if isinstance(obstacle, Wall) else obstacle.from_s


def _evading_mps(vehicle: Vehicle) -> float:
    """Return the speed below which a vehicle of its kind evades an obstacle [m/s]."""
    least = min(vehicle.max_speed_mps, vehicle.max_climb_mps)
    return least if vehicle.kind == "forward" else vehicle.max_speed_mps


def _speed_mps(obstacle: Obstacle) -> float:
    if isinstance(obstacle, Wall) or obstacle.waypoints_m is None:
        return 0.0
    return obstacle.speed_mps or 0.0


def _may_be_silent(scenario: Scenario) -> bool:
    """Whether agents may be silent, or unknown to others, for longer than the radio explains."""
    worst = max([scenario.netem.loss_percent or 0.0, *_losses(scenario)])
    return worst >= LOSS_OF_SILENCE or any(
        isinstance(event.action, SILENCING) for event in scenario.event
    )


def _losses(scenario: Scenario) -> Iterator[float]:
    """Yield the losses of single links, and those of events [%]."""
    for link in scenario.netem.link:
        yield link.loss_percent or 0.0
    for event in scenario.event:
        if isinstance(event.action, Conditions):
            yield event.action.loss_percent or 0.0


def _scans_alone(vehicle: Vehicle) -> bool:
    return bool(scanners_of(vehicle)) and "proximity" not in vehicle.sensors


def _scanning_alone(scenario: Scenario) -> list[Vehicle]:
    return [each for each in scenario.vehicles if _scans_alone(each)]


def _sight_m(scenario: Scenario) -> float:
    """Return the least distance at which every vehicle sees a surface [m]."""
    ranges = {kind: scenario.sensor.scanner(kind).range_m for kind in SCANNERS}
    scanned = [ranges[kind] for each in _scanning_alone(scenario) for kind in scanners_of(each)]
    return min(PROXIMITY_RANGE_M, *scanned, inf)


def _agents(ids: list[int]) -> str:
    return f"agent {ids[0]}" if len(ids) == 1 else f"{len(ids)} agents"


SAFETY_WARNINGS = (
    vehicles_seen_by_radio_alone,
    obstacles_seen,
    scanners_see_all_round,
    seen_early_enough,
    room_for_margins,
    starts_beyond_the_noise,
    expectations_within_the_filter,
    obstacles_give_way,
    sensor_faults_noticed,
    poses_right_without_a_sensor,
)
