"""The conditions between the keys of [[expect.property]]."""

from worldsim.scenario.problem import Problem
from worldsim.scenario.properties import Condition, Property
from worldsim.scenario.tables import Scenario

TIMED = ("eventually", "settle")
OF_TEAM = ("running", "parted")
"""Figures that the team has, not each agent."""


def properties_consistent(scenario: Scenario) -> Problem | None:
    """Return the problem of the first property that says too little, or contradicts itself."""
    titles: set[str] = set()
    for index, each in enumerate(scenario.expect.property):
        key = f"expect.property[{index}]"
        if f"{each.must} {each.title}" in titles:
            return Problem(f"{key}.name", f"another property is called {each.title!r} too")
        titles.add(f"{each.must} {each.title}")
        for at, condition in each.conditions():
            problem = _condition_problem(f"{key}{at}", condition, scenario)
            if problem is not None:
                return problem
        problem = _time_problem(key, each, scenario)
        if problem is not None:
            return problem
    return None


def _condition_problem(key: str, condition: Condition, scenario: Scenario) -> Problem | None:
    if (condition.signal is None) == (condition.figure is None):
        return Problem(key, "needs either a signal, of controllers, or a figure, of the judge")
    least, most = condition.at_least, condition.at_most
    if least is None and most is None:
        return Problem(key, "needs a bound: at_least, at_most or both")
    if least is not None and most is not None and least > most:
        return Problem(f"{key}.at_least", f"{least:g} is more than at_most = {most:g}")
    if condition.figure in OF_TEAM and condition.over != "each":
        return Problem(f"{key}.over", f"{condition.figure} is one figure of the team; leave it out")
    if condition.figure == "obstacle_distance_m" and not scenario.obstacle:
        return Problem(f"{key}.figure", "the scenario has no obstacles")
    return None


def _time_problem(key: str, given: Property, scenario: Scenario) -> Problem | None:
    if given.within_s is not None and given.must not in TIMED:
        return Problem(f"{key}.within_s", f"only for must = {' or '.join(map(repr, TIMED))}")
    if given.from_s >= scenario.duration_s:
        return Problem(f"{key}.from_s", f"{given.from_s:g} s is not before the end of the run")
    if given.to_s is not None and given.to_s <= given.from_s:
        return Problem(f"{key}.to_s", f"{given.to_s:g} s is not after from_s = {given.from_s:g}")
    if given.counted == "after" and not scenario.event:
        return Problem(f"{key}.counted", "'after' the last fault: the scenario has no event")
    return None
