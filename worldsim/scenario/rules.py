"""What must hold between the keys of a scenario, beyond each key's own bounds.

A rule is a function that returns what is broken, or None; a caution one that returns what is
allowed but unwise.
"""

from math import ceil, degrees, dist, hypot
from pathlib import Path
from typing import NamedTuple

from agent.guidance.potential import TARGET_FLOOR_M
from agent.qstructure.formation import Formation
from agent.qstructure.frame_path import tip_speed
from worldsim.scenario.obstacle_tables import obstacle_problem
from worldsim.scenario.start import BoxStart
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario
from worldsim.scenario.target_frame import broken_key, path_of
from worldsim.scenario.toml import ScenarioError

MAX_STEP_M = 0.1
"""docs/method.md: the safety filter holds for v_max H up to this, H a command's longest life."""


class Finding(NamedTuple):
    """What is wrong or unwise: the key, and in words what and what would do."""

    key: str
    detail: str


def check(scenario: Scenario, file: str | Path) -> None:
    """Raise ScenarioError for the first rule that a scenario breaks."""
    for rule in RULES:
        broken = rule(scenario)
        if broken is not None:
            raise ScenarioError(file, *broken)


def cautions(scenario: Scenario) -> list[Finding]:
    """Return what is allowed in a scenario but unwise."""
    found = (caution(scenario) for caution in CAUTIONS)
    return [finding for finding in found if finding is not None]


def too_fast(scenario: Scenario, command_ticks: int) -> Finding | None:
    """Say if vehicles outrun the safety filter where a command lives for ``command_ticks``."""
    speed = max(vehicle.max_speed_mps for vehicle in scenario.vehicles)
    step = speed * command_ticks / scenario.fleet.tick_hz
    if step <= MAX_STEP_M + 1e-9:
        return None
    needed = ceil(speed * command_ticks / MAX_STEP_M - 1e-9)
    return Finding(
        "vehicle.max_speed_mps",
        f"{speed:g} m/s moves {step:.3g} m while a command lives ({command_ticks} ticks), at most"
        f" {MAX_STEP_M:g} m are safe; fleet.tick_hz = {needed} would do",
    )


def _vertices_manned(scenario: Scenario) -> Finding | None:
    agents, vertices = scenario.fleet.agents, len(scenario.formation.vertices)
    if agents >= vertices:
        return None
    return Finding("fleet.agents", f"{agents} for {vertices} vertices; at least {vertices}")


def _lasts_a_tick(scenario: Scenario) -> Finding | None:
    if scenario.slots >= SLOTS_PER_TICK:
        return None
    return Finding("duration_s", f"at least one tick, {1 / scenario.fleet.tick_hz:g} s")


def _above_target_floor(scenario: Scenario) -> Finding | None:
    spacing, separation = scenario.control.spacing_m, scenario.control.separation_m
    if spacing >= separation + TARGET_FLOOR_M - 1e-9:
        return None
    return Finding(
        "control.spacing_m",
        f"{spacing:g} is too tight for separation_m = {separation:g};"
        f" at least {separation + TARGET_FLOOR_M:g} (separation_m + {TARGET_FLOOR_M:g})",
    )


def _start_apart(scenario: Scenario) -> Finding | None:
    start, separation = scenario.fleet.start, scenario.control.separation_m
    if isinstance(start, BoxStart):
        if start.spacing_m >= separation or scenario.fleet.agents == 1:
            return None
        return Finding(
            "fleet.start.spacing_m",
            f"{start.spacing_m:g}; at least control.separation_m = {separation:g}",
        )
    for i, here in enumerate(start.positions_m):
        for j, there in enumerate(start.positions_m[:i]):
            if dist(here, there) < separation:
                return Finding(
                    f"fleet.start.positions_m[{i}]",
                    f"{dist(here, there):.3g} m from agent {j};"
                    f" at least control.separation_m = {separation:g}",
                )
    return None


def _start_for_each(scenario: Scenario) -> Finding | None:
    start, agents = scenario.fleet.start, scenario.fleet.agents
    if isinstance(start, BoxStart):
        return None
    if len(start.positions_m) != agents:
        return Finding(
            "fleet.start.positions_m",
            f"{len(start.positions_m)} positions for fleet.agents = {agents}; one for each",
        )
    if start.yaws_deg is not None and len(start.yaws_deg) != agents:
        return Finding(
            "fleet.start.yaws_deg",
            f"{len(start.yaws_deg)} headings for fleet.agents = {agents}; one for each, or none",
        )
    return None


def _agents_of_the_fleet(scenario: Scenario) -> Finding | None:
    last = scenario.rows - 1
    for index, table in enumerate(scenario.agent):
        for agent in table.ids:
            if agent > last:
                return Finding(f"agent[{index}].ids", f"no agent {agent}; 0 to {last}")
    return None


def tilts_where_asked(scenario: Scenario, formation: Formation, team: int) -> Finding | None:
    """Say which vehicle cannot roll or pitch as far as a queue asks for in a team of that size."""
    least, agent = min((each.max_tilt_deg, i) for i, each in enumerate(scenario.vehicles))
    for place, slot in formation.layout(team).slots.items():
        asked = max(abs(degrees(angle or 0.0)) for angle in slot.attitude[1:])
        if asked > least + 1e-9:
            queue = formation.queues[place.queue].name
            return Finding(
                "vehicle.max_tilt_deg",
                f"agent {agent} tilts up to {least:g}; queue {queue!r} asks for {asked:.3g} at"
                f" {slot.arc_length:g} m along it",
            )
    return None


def _links_of_the_fleet(scenario: Scenario) -> Finding | None:
    seen: set[tuple[int, int]] = set()
    last = scenario.rows - 1
    for index, link in enumerate(scenario.netem.link):
        for name, agent in (("from", link.source), ("to", link.to)):
            if agent > last:
                return Finding(f"netem.link[{index}].{name}", f"no agent {agent}; 0 to {last}")
        if link.source == link.to:
            return Finding(f"netem.link[{index}].to", "a link to itself; another agent than 'from'")
        if (link.source, link.to) in seen:
            return Finding(f"netem.link[{index}]", "given before; one table for each directed link")
        seen.add((link.source, link.to))
    return None


def _cast_zone_open(scenario: Scenario) -> Finding | None:
    near, far = scenario.control.cast_near_m, scenario.control.cast_far_m
    if far is None or far >= 2.0 * near:
        return None
    return Finding("control.cast_far_m", f"{far:g}; at least 2 cast_near_m = {2 * near:g}")


def _sent_by_the_tick(scenario: Scenario) -> Finding | None:
    tick = scenario.fleet.tick_hz
    for name in ("local_hz", "multihop_hz"):
        rate = getattr(scenario.comms, name)
        if rate > tick:
            return Finding(f"comms.{name}", f"{rate:g}; at most fleet.tick_hz = {tick:g}")
    return None


def _cast_within_range(scenario: Scenario) -> Finding | None:
    reach, far = _local_range_m(scenario), scenario.control.cast_far_m
    spacing = scenario.control.spacing_m
    if reach is None or far is None or reach <= spacing:
        return None
    bound = 0.25 * (reach - spacing)
    if far <= bound + 1e-9:
        return None
    return Finding(
        "control.cast_far_m",
        f"{far:g} lets neighbours fly out of range (Lemma 7); at most {bound:.3g} for range_m ="
        f" {reach:g} and spacing_m = {spacing:g}, or leave it out",
    )


def _neighbours_in_range(scenario: Scenario) -> Finding | None:
    reach, spacing = _local_range_m(scenario), scenario.control.spacing_m
    if reach is None or reach > spacing:
        return None
    return Finding(
        "netem.range_m",
        f"{reach:g} is not above control.spacing_m = {spacing:g}: neighbours will not hear another",
    )


def _long_enough_to_converge(scenario: Scenario) -> Finding | None:
    within = scenario.expect.converge_within_s
    if within is None or within + 2.0 <= scenario.duration_s + 1e-9:
        return None
    return Finding(
        "expect.converge_within_s",
        f"{within:g} is not seen to the end: converged means 2 s in place, so duration_s ="
        f" {within + 2.0:g} at least",
    )


def _obstacles_sound(scenario: Scenario) -> Finding | None:
    for index, obstacle in enumerate(scenario.obstacle):
        broken = obstacle_problem(obstacle)
        if broken is not None:
            key, detail = broken
            return Finding(f"obstacle[{index}].{key}", detail)
    return None


def _frame_whole(scenario: Scenario) -> Finding | None:
    broken = broken_key(scenario.frame)
    return Finding(f"frame.{broken[0]}", broken[1]) if broken is not None else None


def _frame_followed(scenario: Scenario) -> Finding | None:
    """Say if the frame is faster than the slowest vehicle, or turns its slots faster than that."""
    slowest = min(vehicle.max_speed_mps for vehicle in scenario.vehicles)
    speed, turns_dps = scenario.frame.speed_mps or 0.0, scenario.frame.turn_dps
    if speed >= slowest:
        detail = f"{speed:g} leaves vehicles behind; below max_speed_mps = {slowest:g}"
        return Finding("frame.speed_mps", detail)
    reach_m = _reach_m(scenario)
    needed = tip_speed(path_of(scenario.frame), reach_m)
    if needed < slowest:
        return None
    return Finding(
        "frame.turn_dps",
        f"{turns_dps:g} moves a slot {reach_m:.3g} m off the axis at {needed:.3g} m/s;"
        f" below {degrees(slowest / reach_m):.3g}, for max_speed_mps = {slowest:g}",
    )


def _reach_m(scenario: Scenario) -> float:
    """Return how far from the frame's upright axis a slot is at most [m]."""
    formation = Formation(scenario.formation, scenario.control.spacing_m)
    slots = formation.layout(scenario.fleet.agents).slots.values()
    return max(hypot(slot.point[0], slot.point[1]) for slot in slots)


def _local_range_m(scenario: Scenario) -> float | None:
    own = scenario.netem.local.range_m
    return own if own is not None else scenario.netem.range_m


RULES = (
    _vertices_manned,
    _lasts_a_tick,
    _above_target_floor,
    _start_for_each,
    _start_apart,
    _agents_of_the_fleet,
    _links_of_the_fleet,
    _cast_zone_open,
    _sent_by_the_tick,
    _frame_whole,
    _obstacles_sound,
)
CAUTIONS = (_cast_within_range, _neighbours_in_range, _long_enough_to_converge, _frame_followed)
