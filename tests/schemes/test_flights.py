"""Each scheme flies the wedge as any controller does, and its figures are measured."""

import pytest

from tests.random_flights.children import Answer
from tests.remark_5_figures import measured
from tests.scheme_figures import (
    HEADINGS,
    SCHEMES,
    Kept,
    LinkWatcher,
    line_of,
    scenario_of,
    watched_m,
)
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


def test_agents_come_nearer_where_the_filter_only_watches():
    """In this flight the filter acts: without it, the followers of a graph collide."""
    scenario = scenario_of("leader_follower", "wedge-9", "clean", seed=0, lasts_s=10.0)
    flight = fly(scenario)
    assert watched_m(scenario, flight.loop.world.slot) < 0.25 < flight.loop.judge.min_separation_m
    assert max(flight.loop.controllers.filter_use().acted_fraction) > 0.0


def test_remark_5_a_wedge_with_a_radio_range_of_one_spacing():
    """One leads the vertex, the first of each queue is a sub-vertex, the last a member."""
    formed = measured(SCHEMES["q_structure"], 1.05, seed=1)
    assert formed["converge_s"] is not None
    assert [round(9 * share) for share in formed["roles"]] == [4, 4, 1, 0]
    assert sorted(formed["tiers"]) == [0, *[1] * 4, *[2] * 4]
    assert formed["heard"] == formed["needed"] == pytest.approx(16 / 9), (
        "somebody hears more than parent and children"
    )


def test_a_flight_that_is_kept_is_not_flown_again(tmp_path, monkeypatch):
    calls = []

    def flown(*row):
        calls.append(row)
        return {"converge_s": [1.5], "separation_m": 0.5, "watched_m": 0.25, "acted": 0.125} | {
            "mean": [8, 2, 2, 1],
            "most": [8, 8, 8, 8],
            "bytes_per_s": 4000.0,
        }

    path, row = tmp_path / "flights.jsonl", ("wedge-9", "clean", "q_structure")
    monkeypatch.setattr("tests.scheme_figures.answers", in_this_process)
    monkeypatch.setattr("tests.scheme_figures.measured", flown)
    first = Kept(path).flown(row, range(1), 1)
    again = Kept(path).flown(row, range(2), 1)
    assert calls == [("q_structure", "wedge-9", "clean", seed) for seed in (0, 1)]
    assert first == again[:1]
    cells = line_of(row, again).split(" | ")
    assert len(cells) == len(HEADINGS.split(" | "))
    assert cells[3:8] == ["2 of 2", "1.5, 1.5", "0.50", "0.25", "12.5"]


def in_this_process(numbers, work, jobs, deadline_s):
    return [Answer(number, work(number)) for number in numbers]
