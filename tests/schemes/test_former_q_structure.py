"""The earlier Q-structure: spacing by repulsion, queues by capacity, the link to the vertex."""

from math import sqrt
from random import Random

import pytest

from agent.controller import HeardSummary
from agent.messages import Place
from agent.schemes.former_q_structure import (
    REPULSION_HZ,
    SLOPE_MPS,
    FormerQStructure,
    emptier_queue,
    links_needed,
    sliding_mps,
)
from agent.schemes.links import NOBODY, Situation
from agent.schemes.queue_points import nearest, on_sphere
from tests.schemes.situations import LINES, WEDGE, heard, senses, setup

APEX = WEDGE.layout(9).places[0]
FAR_UP = (-4.0, 4.0, 4.0)


def decided(own, position, neighbours, ticks_s=(0.0, 1.0)):
    controller = FormerQStructure(setup(own))
    for now_s in ticks_s:
        intent = controller.decide(senses(position, neighbours, now_s))
    return intent


@pytest.mark.parametrize("members", [1, 2, 5])
def test_members_come_to_rest_about_d_ir_apart(members):
    s = [3.0 + 0.4 * k for k in range(members)]
    for _ in range(2000):
        ahead = [0.0, *s[:-1]]
        s = [a + 0.05 * sliding_mps(a, b, 1.0) for a, b in zip(s, ahead, strict=True)]
    gap = 1.0 - SLOPE_MPS / REPULSION_HZ
    assert s == pytest.approx([gap * (k + 1) for k in range(members)], abs=1e-6)
    assert abs(s[-1] - members) < 0.12


def test_who_has_nobody_ahead_comes_to_rest_at_the_vertex():
    s = 2.0
    for _ in range(1000):
        s += 0.05 * sliding_mps(s, None, 1.0)
    assert abs(s) < 1e-3


@pytest.mark.parametrize("team", [9, 12, 20, 7])
def test_queues_fill_as_the_layout_does(team):
    random = Random(team)
    wanted = list(WEDGE.divide(team))
    for _ in range(30):
        counts = [0] * 4
        for _ in range(team - 1):
            counts[random.randrange(4)] += 1
        for _ in range(100):
            own = random.choice([j for j in range(4) if counts[j]])
            best = emptier_queue(own, counts, WEDGE.capacities)
            counts[own] -= 1
            counts[best] += 1
        assert counts == wanted


def test_the_nearest_takes_the_vertex_and_of_two_holders_the_nearer_stays():
    near, far = (0.3, 0.0, 0.0), (1.0, 0.0, 0.0)
    assert decided(1, near, [heard(0, far)]).place == APEX
    assert decided(1, far, [heard(0, near)]).place is None
    assert decided(1, near, [heard(0, far, APEX)]).place != APEX
    controller = FormerQStructure(setup(1))
    claims = []
    for now_s, others in (
        (0.0, [heard(0, far)]),
        (1.0, [heard(0, far)]),
        (1.1, [heard(0, (0.33, 0.0, 0.0), APEX), heard(2, far)]),
        (1.2, [heard(2, far)]),
    ):
        claims.append(controller.decide(senses(near, others, now_s)).place == APEX)
    assert claims == [False, True, False, True]


def test_who_does_not_hear_the_vertex_agent_flies_to_the_vertex_without_a_place():
    others = [heard(2, (-3.0, 3.0, 3.0), Place(0, 3))]
    intent = decided(1, FAR_UP, others)
    assert intent.place is None
    assert intent.wanted == pytest.approx(tuple(-0.5 / sqrt(3) * a for a in (-1, 1, 1)))


def test_the_trench_draws_to_the_queue_and_ranks_by_who_is_ahead():
    others = [heard(0, (0.0, 0.0, 0.0), APEX), heard(2, (-0.6, 0.6, 0.6), Place(0, 1))]
    intent = decided(1, (-1.0, 2.0, 1.4), others)
    assert intent.place == Place(0, 2)
    assert intent.wanted[1] < 0.0


def test_the_vertex_agent_counts_and_the_last_of_a_full_queue_leaves_it_in_its_turn():
    queue = [(-0.5 * k, 0.5 * k, 0.5 * k) for k in range(4)]
    others = [heard(k, queue[k], Place(0, k)) for k in (1, 2, 3)]
    vertex, last, middle = (FormerQStructure(setup(own)) for own in (0, 3, 2))
    told = [vertex.decide(senses(queue[0], others, now_s)) for now_s in (0.0, 1.0, 1.05)]
    assert [each.words.summary is not None for each in told] == [False, True, False]
    summary = told[1].words.summary
    assert summary.trees[0].down.counts == (3, 0, 0, 0)
    moved = {}
    for controller, own in ((last, 3), (middle, 2)):
        around = [heard(k, queue[k], APEX if k == 0 else Place(0, k)) for k in range(4) if k != own]
        for tick in range(40):
            now_s = 0.05 * tick
            news = (HeardSummary(0, now_s, summary),) if tick % 5 == 0 else ()
            place = controller.decide(senses(queue[own], around, now_s, summaries=news)).place
            moved.setdefault(own, []).append(place.queue if place else None)
    assert moved[3][29] == 0
    assert moved[3][30:] == [1] * 10
    assert 1 not in moved[2]


def test_a_vertex_agent_counts_in_the_queue_that_alone_begins_at_its_vertex():
    layout = LINES.layout(6)
    apart = [layout.slots[place].point for place in layout.places]
    others = [heard(k, apart[k], layout.places[k]) for k in range(1, 6)]
    vertex = FormerQStructure(setup(0))
    for now_s in (0.0, 1.0):
        said = vertex.decide(senses(apart[0], others, now_s, formation=LINES)).words.summary
    assert said.trees[0].down.counts == (2, 2, 2)


def test_it_needs_its_queue_and_the_vertex_agent():
    at = Situation(5, frozenset(range(9)), frozenset({3, 4}), leader=1, vertex_agent=0)
    assert links_needed(at) == {0, 3, 4}
    assert links_needed(at._replace(vertex_agent=NOBODY)) == {3, 4}
    assert links_needed(at._replace(own=0)) == {3, 4}


def test_points_of_a_queue_are_found():
    queue, unit = WEDGE.queues[0], 1.0 / sqrt(3)
    for near in (None, 1.0, 6.0):
        s = nearest(queue, (-2.0, 2.3, 1.9), 8.0, near)
        assert s == pytest.approx(6.2 * unit, abs=0.003)
    assert nearest(queue, (3.0, -3.0, -3.0), 8.0) == 0.0
    (found,) = on_sphere(queue, (0.0, 0.0, 0.0), 1.5, 8.0)
    assert found == pytest.approx((-1.5 * unit, 1.5 * unit, 1.5 * unit), abs=0.003)
    assert len(on_sphere(queue, (-2.0, 2.0, 2.0), 0.5, 8.0)) == 2
