"""The strength of the network: lambda_2 of known graphs, and as an expectation of a run."""

from dataclasses import replace
from itertools import pairwise
from math import cos, pi

import msgspec
import numpy as np
import pytest

from netem.link_parameters import Conditions, DirectedLink
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.finding import Expectation
from worldsim.judge.network_strength import algebraic_connectivity
from worldsim.judge.verdict import Judge
from worldsim.scenario.tables import Expectations, Scenario


def graph(agents: int, *edges: tuple[int, int]) -> np.ndarray:
    linked = np.zeros((agents, agents), dtype=bool)
    for a, b in edges:
        linked[a, b] = linked[b, a] = True
    return linked


@pytest.mark.parametrize("agents", [2, 3, 9])
def test_it_is_that_of_known_graphs(agents: int) -> None:
    line = list(pairwise(range(agents)))
    assert algebraic_connectivity(~np.eye(agents, dtype=bool)) == agents
    assert algebraic_connectivity(graph(agents, *line)) == pytest.approx(2 - 2 * cos(pi / agents))
    assert algebraic_connectivity(graph(agents, *line[1:])) == 0.0


def test_one_agent_has_no_network() -> None:
    assert algebraic_connectivity(graph(1)) is None


def expectation(radio: Conditions, wanted: float = 1.0, alive: int = 5) -> Expectation:
    """Return how a line of five agents, 1 m apart, meets an expectation of lambda_2."""
    expect = Expectations(min_separation_m=0.0, min_lambda2=wanted)
    scenario: Scenario = msgspec.structs.replace(
        wedge(5, duration_s=12.0), expect=expect, netem=radio
    )
    judge, runs = Judge(scenario), np.arange(5) < alive
    for tick in straight_flight(scenario):
        place = np.where(runs[:, None], tick.place, -1).astype(np.int16)
        judge.see(replace(tick, alive=runs, place=place))
    (row,) = [each for each in judge.expectations() if each.name == "min_lambda2"]
    return row


def test_a_run_is_held_to_it_once_the_team_has_converged() -> None:
    assert expectation(Conditions()).got == 5.0
    assert expectation(Conditions()).margin == 4.0
    assert expectation(Conditions(range_m=0.1)).got == 0.0
    assert expectation(Conditions(range_m=0.1)).held is False


def test_a_link_in_one_direction_holds_nothing_together() -> None:
    one_way = tuple(DirectedLink(source=0, to=to, loss_percent=100.0) for to in range(1, 5))
    assert expectation(Conditions(link=one_way)).got == 0.0
    without_one = tuple(DirectedLink(source=0, to=to, loss_percent=100.0) for to in range(2, 5))
    assert 0.0 < (expectation(Conditions(link=without_one)).got or 0.0) < 5.0


def test_a_team_that_never_converges_is_not_judged_by_it() -> None:
    assert expectation(Conditions(), alive=1).held is None
