"""A queue's members stand in their line wherever it is; the lead is theirs before the whole."""

from dataclasses import replace

import numpy as np
import pytest

from tests.recording.flights import straight_flight, wedge
from worldsim.judge.sub_formations import SHAPE_M
from worldsim.judge.verdict import Judge

SCENARIO = wedge(9, duration_s=12.0)
TICKS = list(straight_flight(SCENARIO))
PLACES = TICKS[0].place
SLOTS = TICKS[0].target.astype(float)
APEX = int(np.flatnonzero(np.all(PLACES == 0, axis=1))[0])
FIRST = [row for row in range(9) if PLACES[row, 0] == 0 and row != APEX]
AWAY = np.array([6.0, 0.0, 0.0])


def judged(position, change=lambda tick: tick):
    """Return what was found of a flight; position: of all agents at a time [m]."""
    judge = Judge(SCENARIO)
    for tick in TICKS:
        judge.see(change(replace(tick, position=position(tick.time_s))))
    (found,) = judge.sub_formations
    return found


def gathered(time_s):
    """All are in place from 8 s on, and before that their queues are displaced as a whole."""
    return SLOTS + AWAY * max(0.0, 1.0 - time_s / 8.0)


def scattered(time_s, until_s, rows):
    position = gathered(time_s).copy()
    if time_s < until_s:
        position[rows, 1] += 0.5
    return position


def test_queues_that_fly_as_a_whole_stand_from_the_start():
    found = judged(gathered)
    assert found.names == ("Q0", "Q1", "Q2", "Q3")
    assert found.stands_s == [0.0] * 4
    assert found.lead_s == pytest.approx(7.85, abs=0.06)
    assert found.row["stands_s"] == dict.fromkeys(found.names, 0.0)


def test_the_lead_is_that_of_the_last_queue():
    found = judged(lambda time_s: scattered(time_s, 3.0, FIRST[:1]))
    assert found.stands_s == [pytest.approx(3.0), 0.0, 0.0, 0.0]
    assert found.lead_s == pytest.approx(4.85, abs=0.06)


def test_a_line_that_breaks_counts_from_when_it_stands_again():
    def broken(time_s):
        return scattered(time_s, 6.0, FIRST[:1]) if time_s > 5.0 else gathered(time_s)

    assert judged(broken).stands_s[0] == pytest.approx(6.0)


def test_a_line_that_comes_with_the_whole_has_no_lead():
    """Its last agent is in place 2 s after all others."""
    found = judged(lambda time_s: scattered(time_s, 10.0, FIRST[:1]))
    assert found.stands_s[0] == pytest.approx(10.0)
    assert found.lead_s == pytest.approx(0.0, abs=0.06)


def test_agents_in_vertices_are_no_members_of_a_line():
    found = judged(lambda time_s: scattered(time_s, 6.0, [APEX]))
    assert found.stands_s == [0.0] * 4


@pytest.mark.parametrize(("error_m", "stands"), [(SHAPE_M - 0.01, True), (SHAPE_M + 0.01, False)])
def test_distances_count_up_to_a_bound(error_m, stands):
    """Agents are displaced along their queue, each for itself."""
    one, other = FIRST
    along = (SLOTS[other] - SLOTS[one]) / np.linalg.norm(SLOTS[other] - SLOTS[one])

    def stretched(time_s):
        position = gathered(time_s).copy()
        position[other] += error_m * along
        return position

    assert (judged(stretched).stands_s[0] is not None) == stands


def test_all_pairs_count_not_only_neighbours():
    """In a line of four bent at its middle, all neighbours keep their distance."""
    scenario = wedge(17, duration_s=2.0)
    ticks = list(straight_flight(scenario))
    judge = Judge(scenario)
    for tick in ticks:
        slots = ticks[0].target.astype(float)
        places = ticks[0].place
        rows = [r for r in range(17) if places[r, 0] == 0 and places[r, 1] > 0]
        rows.sort(key=lambda row: places[row, 1])
        step = slots[rows[1]] - slots[rows[0]]
        slots[rows[2]] = slots[rows[1]] + step * [1.0, -1.0, 1.0]
        slots[rows[3]] = slots[rows[2]] + step * [1.0, -1.0, 1.0]
        judge.see(replace(tick, position=slots))
    assert judge.sub_formations[0].stands_s == [None, 0.0, 0.0, 0.0]


def test_a_queue_of_one_member_has_no_line():
    scenario = wedge(5, duration_s=8.0)
    judge = Judge(scenario)
    for tick in straight_flight(scenario):
        judge.see(tick)
    assert judge.phases[0].converge_s is not None
    assert judge.sub_formations[0].stands_s == [None] * 4
    assert judge.sub_formations[0].lead_s is None


def test_without_convergence_there_is_no_lead():
    found = judged(lambda time_s: SLOTS + AWAY)
    assert found.stands_s == [0.0] * 4
    assert found.lead_s is None


def test_a_member_that_takes_its_place_later_is_waited_for():
    def unplaced(tick):
        place = tick.place.copy()
        place[FIRST[0]] = -1 if tick.time_s < 4.0 else place[FIRST[0]]
        return replace(tick, place=place)

    assert judged(gathered, unplaced).stands_s == [pytest.approx(4.0), 0.0, 0.0, 0.0]


def test_a_member_that_creeps_away_breaks_its_line_once_it_is_too_far():
    def creeping(time_s):
        position = SLOTS.copy()
        outward = SLOTS[FIRST[-1]] - SLOTS[FIRST[0]]
        position[FIRST[-1]] += 0.1 * max(0.0, time_s - 2.0) * outward
        return position

    found = judged(creeping)
    assert found.stands_s[0] is None
    assert found.stands_s[1:] == [0.0] * 3


def test_a_line_that_creeps_away_as_a_whole_stands():
    found = judged(lambda time_s: SLOTS + 0.1 * time_s * AWAY)
    assert found.stands_s == [0.0] * 4
