"""The conditions between the keys of a scenario, beyond each key's own bounds.

A rule returns the problem of a scenario that breaks it, else None. A warning is a rule that a
scenario may break, at its own risk.
"""

from math import ceil, degrees, hypot
from pathlib import Path

from agent.config import LEAST
from agent.controller import COMMAND
from agent.guidance.bobber import MIN_CAST_RATIO
from agent.messages import MAX_SCAN_B
from agent.qstructure.formation import Formation, formation_of
from agent.qstructure.frame_path import tip_speed
from worldsim.scenario.events import EventTable
from worldsim.scenario.idle_keys import idle_keys
from worldsim.scenario.obstacle_tables import obstacle_problem
from worldsim.scenario.orientation_checks import yaws_not_held
from worldsim.scenario.problem import Problem
from worldsim.scenario.property_checks import properties_consistent
from worldsim.scenario.safety_checks import SAFETY_WARNINGS
from worldsim.scenario.start_checks import (
    start_for_each_agent,
    starts_inside,
    starts_separated,
)
from worldsim.scenario.tables import CONVERGED_S, SLOTS_PER_TICK, AgentTable, Scenario
from worldsim.scenario.target_frame import frame_problem, path_of
from worldsim.scenario.team_checks import empty_queues
from worldsim.scenario.toml import ScenarioError

MAX_STEP_M = 0.1
"""docs/method.md: the safety filter holds for v_max H up to this, H a command's longest life."""
SLACK = 1e-9


def check_rules(scenario: Scenario, file: str | Path) -> None:
    """Raise ScenarioError for the first rule that a scenario breaks."""
    for rule in RULES:
        problem = rule(scenario)
        if problem is not None:
            raise ScenarioError(file, problem.key, problem.detail)


def warnings_for(scenario: Scenario) -> list[Problem]:
    """Return what a scenario is allowed to ask for but should not."""
    found = (warning(scenario) for warning in WARNINGS)
    single = [problem for problem in found if problem is not None]
    several = (yaws_not_held, empty_queues, idle_keys)
    return [*single, *(problem for warning in several for problem in warning(scenario))]


def speed_problem(scenario: Scenario, command_ticks: int) -> Problem | None:
    """Return the problem of vehicles that are too fast for the safety filter, if they are.

    command_ticks: for how many ticks a command is valid.
    """
    speed = max(vehicle.max_speed_mps for vehicle in scenario.vehicles)
    step = speed * command_ticks / scenario.fleet.tick_hz
    if step <= MAX_STEP_M + SLACK:
        return None
    needed = ceil(speed * command_ticks / MAX_STEP_M - SLACK)
    return Problem(
        "vehicle.max_speed_mps",
        f"{speed:g} m/s moves a vehicle {step:.3g} m while a command is valid ({command_ticks}"
        f" ticks), and at most {MAX_STEP_M:g} m is safe; fleet.tick_hz = {needed} is enough",
    )


def tilt_problem(scenario: Scenario, formation: Formation, team: int) -> Problem | None:
    """Return the problem of a vehicle that cannot tilt as a formation of ``team`` agents asks."""
    least, agent = min((each.max_tilt_deg, i) for i, each in enumerate(scenario.vehicles))
    for place, slot in formation.layout(team).slots.items():
        asked = max(abs(degrees(angle or 0.0)) for angle in slot.attitude[1:])
        if asked > least + SLACK:
            queue = formation.queues[place.queue].name
            return Problem(
                "vehicle.max_tilt_deg",
                f"agent {agent} tilts up to {least:g}; queue {queue!r} asks for {asked:.3g} at"
                f" {slot.arc_length:g} m along it",
            )
    return None


def _enough_agents(scenario: Scenario) -> Problem | None:
    agents, vertices = scenario.fleet.agents, len(scenario.formation.vertices)
    if agents >= vertices:
        return None
    return Problem("fleet.agents", f"{agents} for {vertices} vertices; at least {vertices}")


def _at_least_one_tick(scenario: Scenario) -> Problem | None:
    if scenario.slots >= SLOTS_PER_TICK:
        return None
    tick_s = 1 / scenario.fleet.tick_hz
    return Problem("duration_s", f"{scenario.duration_s:g}; at least one tick, {tick_s:g} s")


def _spacing_leaves_equilibrium(scenario: Scenario) -> Problem | None:
    spacing, least = scenario.control.spacing_m, scenario.min_slot_distance_m
    if spacing >= least - SLACK:
        return None
    separation = scenario.control.separation_m
    return Problem(
        "control.spacing_m",
        f"{spacing:g} is too small for separation_m = {separation:g}; at least {least:g}"
        f" (separation_m + {least - separation:g})",
    )


def _known_agents(scenario: Scenario) -> Problem | None:
    for index, table in enumerate(scenario.agent):
        for agent in table.ids:
            if agent >= scenario.rows:
                return _unknown_agent(f"agent[{index}].ids", agent, scenario)
    return None


def _agents_differ(scenario: Scenario) -> Problem | None:
    for index, table in enumerate(scenario.agent):
        if table == AgentTable(ids=table.ids):
            return Problem(f"agent[{index}]", "changes nothing; give vehicle, command or both")
    return None


def _known_briefed(scenario: Scenario) -> Problem | None:
    agents, briefed = scenario.fleet.agents, scenario.fleet.briefed
    for index, agent in enumerate(briefed if briefed != "all" else ()):
        if agent >= agents:
            detail = f"no agent {agent} at the start; 0 to {agents - 1}"
            return Problem(f"fleet.briefed[{index}]", detail)
    return None


def _known_links(scenario: Scenario) -> Problem | None:
    seen: set[tuple[int, int]] = set()
    for index, link in enumerate(scenario.netem.link):
        for name, agent in (("from", link.source), ("to", link.to)):
            if agent >= scenario.rows:
                return _unknown_agent(f"netem.link[{index}].{name}", agent, scenario)
        if link.source == link.to:
            detail = "a link to itself; another agent than 'from'"
            return Problem(f"netem.link[{index}].to", detail)
        if (link.source, link.to) in seen:
            detail = "given before; one table for each directed link"
            return Problem(f"netem.link[{index}]", detail)
        seen.add((link.source, link.to))
    return None


def _unknown_agent(key: str, agent: int, scenario: Scenario) -> Problem:
    return Problem(key, f"no agent {agent}; 0 to {scenario.rows - 1}")


def _cast_zone_not_empty(scenario: Scenario) -> Problem | None:
    near, far = scenario.control.cast_near_m, scenario.control.cast_far_m
    if far is None or far >= MIN_CAST_RATIO * near:
        return None
    least = MIN_CAST_RATIO * near
    return Problem(
        "control.cast_far_m", f"{far:g}; at least {MIN_CAST_RATIO:g} cast_near_m = {least:g}"
    )


def _gathers_in_the_structure(scenario: Scenario) -> Problem | None:
    control = scenario.control
    if not control.gather:
        return None
    for key, needed in (("controller", "q_structure"), ("allocation", "structure")):
        given = getattr(control, key)
        if given != needed:
            detail = f"true needs control.{key} = {needed!r}, which is {given!r}"
            return Problem("control.gather", detail)
    return None


def _command_or_controller(scenario: Scenario) -> Problem | None:
    control = scenario.control
    if bool(control.command) == (control.controller == COMMAND):
        return None
    if control.command:
        detail = f"cannot be combined with control.controller = {control.controller!r}"
        return Problem("control.command", detail)
    return Problem("control.controller", f"{COMMAND!r} needs control.command: a program")


def _rates_up_to_tick_rate(scenario: Scenario) -> Problem | None:
    comms, tick_hz = scenario.comms, scenario.fleet.tick_hz
    for name, rate in (("local_hz", comms.local_hz), ("multihop_hz", comms.multihop_hz)):
        if rate > tick_hz:
            return Problem(f"comms.{name}", f"{rate:g}; at most fleet.tick_hz = {tick_hz:g}")
        if 0.0 < rate < LEAST:
            return Problem(f"comms.{name}", f"{rate:g}; at least {LEAST:g}, or 0 for off")
    return None


def _connected_at_most_by_all(scenario: Scenario) -> Problem | None:
    """Bound the algebraic connectivity by the number of the nodes (Fiedler 1973)."""
    wanted, most = scenario.expect.min_lambda2, scenario.rows
    if wanted is None or wanted <= most:
        return None
    detail = f"{wanted:g}; at most {most}, the number of agents, where each hears each"
    return Problem("expect.min_lambda2", detail)


def _frame_consistent(scenario: Scenario) -> Problem | None:
    problem = frame_problem(scenario.frame)
    return problem.within("frame") if problem is not None else None


def _obstacles_consistent(scenario: Scenario) -> Problem | None:
    for index, obstacle in enumerate(scenario.obstacle):
        problem = obstacle_problem(obstacle)
        if problem is not None:
            return problem.within(f"obstacle[{index}]")
    return None


def _cast_zone_within_range(scenario: Scenario) -> Problem | None:
    """Warn where bobbers may leave their neighbours' radio range (Lemma 7)."""
    bound, far = scenario.lemma_7_bound_m, scenario.control.cast_far_m
    if bound is None or bound <= 0.0 or far is None or far <= bound + SLACK:
        return None
    range_m, spacing = scenario.local_range_m, scenario.control.spacing_m
    return Problem(
        "control.cast_far_m",
        f"with {far:g}, neighbours may fly out of radio range (Lemma 7); at most {bound:.3g} for"
        f" range_m = {range_m:g} and spacing_m = {spacing:g}, or omit the key",
    )


def _neighbours_within_range(scenario: Scenario) -> Problem | None:
    range_m, spacing = scenario.local_range_m, scenario.control.spacing_m
    if range_m is None or range_m > spacing:
        return None
    return Problem(
        "netem.range_m",
        f"{range_m:g} is not above control.spacing_m = {spacing:g}: neighbours in a queue will not"
        " hear each other",
    )


def _long_enough_to_converge(scenario: Scenario) -> Problem | None:
    within = scenario.expect.converge_within_s
    if within is None or within + CONVERGED_S <= scenario.duration_s + SLACK:
        return None
    return Problem(
        "expect.converge_within_s",
        f"the run ends before {within:g} s can be judged: converged means {CONVERGED_S:g} s in"
        f" place, so duration_s must be at least {within + CONVERGED_S:g}",
    )


def _frame_slow_enough(scenario: Scenario) -> Problem | None:
    """Warn where the frame, or a slot that it turns, is faster than the slowest vehicle."""
    slowest = min(vehicle.max_speed_mps for vehicle in scenario.vehicles)
    speed = scenario.frame.speed_mps or 0.0
    if speed >= slowest:
        detail = f"{speed:g} leaves vehicles behind; below max_speed_mps = {slowest:g}"
        return Problem("frame.speed_mps", detail)
    radius_m = _formation_radius_m(scenario)
    needed = tip_speed(path_of(scenario.frame), radius_m)
    if needed < slowest:
        return None
    return Problem(
        "frame.turn_dps",
        f"{scenario.frame.turn_dps:g} moves a slot {radius_m:.3g} m from the axis at {needed:.3g}"
        f" m/s; below {degrees(slowest / radius_m):.3g}, for max_speed_mps = {slowest:g}",
    )


def _formation_radius_m(scenario: Scenario) -> float:
    """Return the largest distance of a slot from the frame's vertical axis [m]."""
    formation = formation_of(scenario.formation, scenario.control.spacing_m)
    slots = formation.layout(scenario.fleet.agents).slots.values()
    return max(hypot(slot.point[0], slot.point[1]) for slot in slots)


def _someone_knows_the_mission(scenario: Scenario) -> Problem | None:
    given = any(event.formation or event.frame for event in scenario.event)
    if scenario.fleet.briefed or given:
        return None
    detail = (
        "nobody knows the mission, and no event gives one; brief an agent, or add an event with"
        " formation or frame"
    )
    return Problem("fleet.briefed", detail)


def _slow_channel_is_on(scenario: Scenario) -> Problem | None:
    """Warn where agents need a channel that is off: for the mission, or for counts and orders."""
    if scenario.comms.multihop_hz > 0.0 or not scenario.expect.converge:
        return None
    unbriefed = [i for i in range(scenario.fleet.agents) if not scenario.is_briefed(i, 0)]
    if unbriefed or any(map(_starts_agents, scenario.event)):
        return Problem(
            "comms.multihop_hz",
            "the mission spreads on this channel, which is off: an agent that is not briefed, joins"
            " or restarts never learns it",
        )
    control = scenario.control
    if control.controller != "q_structure" or control.allocation != "structure":
        return None
    if scenario.rows == 1:
        return None
    return Problem(
        "comms.multihop_hz",
        "leaders count and order their queues on this channel, which is off: nobody but a leader"
        " takes a place; control.allocation = 'assignment' needs no leaders",
    )


def _starts_agents(event: EventTable) -> bool:
    """Return whether an event starts processes."""
    ended = event.kill or event.leave
    return bool(event.joiners or event.restart or (ended and event.for_s is not None))


def _laser_rings_apart(scenario: Scenario) -> Problem | None:
    laser = scenario.sensor.laser
    if laser.rings == 1 or laser.elevation_deg >= LEAST:
        return None
    detail = (
        f"{laser.rings} rings need elevation_deg of at least {LEAST:g};"
        " without it a laser has one ring"
    )
    return Problem("sensor.laser.rings", detail)


def _laser_fits_a_scan(scenario: Scenario) -> Problem | None:
    laser, most = scenario.sensor.laser, MAX_SCAN_B // 2
    if scenario.sensor.coverage == "planar" or laser.rays * laser.rings <= most:
        return None
    detail = f"{laser.rays} in each of {laser.rings} rings; at most {most} in all"
    return Problem("sensor.laser.rays", detail)


RULES = (
    _enough_agents,
    _at_least_one_tick,
    _spacing_leaves_equilibrium,
    start_for_each_agent,
    starts_inside,
    starts_separated,
    _known_agents,
    _agents_differ,
    _known_briefed,
    _known_links,
    _cast_zone_not_empty,
    _gathers_in_the_structure,
    _command_or_controller,
    _rates_up_to_tick_rate,
    _laser_rings_apart,
    _laser_fits_a_scan,
    _connected_at_most_by_all,
    _frame_consistent,
    _obstacles_consistent,
    properties_consistent,
)
WARNINGS = (
    _cast_zone_within_range,
    _neighbours_within_range,
    _long_enough_to_converge,
    _frame_slow_enough,
    _someone_knows_the_mission,
    _slow_channel_is_on,
    *SAFETY_WARNINGS,
)
