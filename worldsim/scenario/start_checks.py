"""Conditions on where and how a fleet starts."""

from collections.abc import Sequence
from math import dist
from typing import assert_never

from agent.messages import FLIGHT_M, Position
from worldsim.scenario.problem import Problem
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.tables import Scenario


def starts_separated(scenario: Scenario) -> Problem | None:
    """Refuse agents that start nearer to each other than they may ever be."""
    start, separation = scenario.fleet.start, scenario.control.separation_m
    match start:
        case BoxStart():
            if start.spacing_m >= separation or scenario.fleet.agents == 1:
                return None
            detail = f"{start.spacing_m:g}; at least control.separation_m = {separation:g}"
            return Problem("fleet.start.spacing_m", detail)
        case ListStart():
            return _listed_too_close(start.positions_m, separation)
        case _:
            assert_never(start)


def _listed_too_close(positions_m: Sequence[Position], separation: float) -> Problem | None:
    for i, here in enumerate(positions_m):
        for j, there in enumerate(positions_m[:i]):
            if dist(here, there) < separation:
                return Problem(
                    f"fleet.start.positions_m[{i}]",
                    f"{dist(here, there):.3g} m from agent {j};"
                    f" at least control.separation_m = {separation:g}",
                )
    return None


def starts_inside(scenario: Scenario) -> Problem | None:
    """Refuse a start outside of the world."""
    problem = start_problem(scenario.fleet.start)
    return problem.within("fleet.start") if problem is not None else None


def start_problem(start: BoxStart | ListStart) -> Problem | None:
    """Return the problem of a start box that sticks out of the world."""
    match start:
        case ListStart():
            return None
        case BoxStart():
            for axis, (centre, size) in enumerate(zip(start.centre_m, start.size_m, strict=True)):
                if abs(centre) + 0.5 * size > FLIGHT_M:
                    detail = f"the box reaches beyond {FLIGHT_M:g} m, the edge of the world"
                    return Problem(f"centre_m[{axis}]", detail)
            return None
        case _:
            assert_never(start)


def start_for_each_agent(scenario: Scenario) -> Problem | None:
    """Refuse a list of starts that is not one for each agent."""
    start = scenario.fleet.start
    match start:
        case BoxStart():
            return None
        case ListStart():
            return _list_of_wrong_length(start, scenario.fleet.agents)
        case _:
            assert_never(start)


def _list_of_wrong_length(start: ListStart, agents: int) -> Problem | None:
    if len(start.positions_m) != agents:
        detail = f"{len(start.positions_m)} positions for fleet.agents = {agents}; one for each"
        return Problem("fleet.start.positions_m", detail)
    if start.yaws_deg is not None and len(start.yaws_deg) != agents:
        detail = (
            f"{len(start.yaws_deg)} headings for fleet.agents = {agents}; one for each, or none"
        )
        return Problem("fleet.start.yaws_deg", detail)
    return None
