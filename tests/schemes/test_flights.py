"""Each scheme flies the wedge as any controller does, and its figures are measured."""

import pytest

from tests.scheme_figures import SCHEMES, LinkWatcher, scenario_of
from worldsim.engine.virtual import fly


def flown(scheme, seed, lasts_s):
    scenario = scenario_of(scheme, "wedge-9", "clean", seed, lasts_s)
    watcher = LinkWatcher(scenario, SCHEMES[scheme].links_needed)
    flight = fly(scenario, watcher, should_stop=lambda: watcher.settled)
    return flight.loop.judge, watcher


@pytest.mark.parametrize("scheme", ["leader_follower", "virtual_structure", "former_q_structure"])
def test_a_scheme_forms_the_wedge(scheme):
    judge, watcher = flown(scheme, seed=1, lasts_s=30.0)
    assert watcher.stages()[-1]["converge_s"] is not None
    assert not judge.invariants()["I1"].violations
    assert judge.min_separation_m > 0.25
    most = max(needed for _, needed, _, _ in watcher.counts)
    assert most == {"leader_follower": 1, "virtual_structure": 8, "former_q_structure": 8}[scheme]


def test_the_printed_paper_sends_four_to_the_apex():
    judge, watcher = flown("printed_q_structure", seed=1, lasts_s=12.0)
    assert watcher.stages()[-1]["converge_s"] is None
    assert judge.min_separation_m > 0.25
