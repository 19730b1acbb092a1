"""Division of a team over its queues: vertices first, then by capacity, within the room."""

from itertools import pairwise
from math import dist, inf

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from agent.messages import Place
from agent.qstructure.formation import Formation, FormationSpec, QueueSpec
from agent.qstructure.shape import Ray

AWAY = Ray((0.0, 0.0, 1.0))


@st.composite
def formations(draw, closed=True):
    """Return a formation of open and closed queues, with own or shared vertices."""
    vertices, queues = {}, []
    weights = draw(st.lists(st.integers(1, 20), min_size=1, max_size=6))
    for j, weight in enumerate(weights):
        names = tuple(f"V{j}.{k}" for k in range(draw(st.integers(1, 4 if closed else 1))))
        at = 0.0
        for name in names:
            vertices[name] = (at, 20.0 * j, 0.0)
            at += draw(st.floats(1.0, 5.0))
        if draw(st.booleans()) and queues:
            names = (queues[0].vertices[0],) if len(names) == 1 else names
        queues.append(
            QueueSpec(f"Q{j}", names, AWAY if len(names) == 1 else None, weight / sum(weights))
        )
    used = {name for queue in queues for name in queue.vertices}
    kept = {name: at for name, at in vertices.items() if name in used}
    return Formation(FormationSpec("f", kept, tuple(queues)), 1.0)


def room(formation):
    """Return each queue's own vertices, and how many agents it can hold besides shared vertices."""
    common = set(formation.common)
    owned = [
        sum(
            place == Place(j, rank) and place not in common
            for rank in range(len(queue.stations))
            for place in formation.vertex_places.values()
        )
        for j, queue in enumerate(formation.queues)
    ]
    most = [
        inf if queue.room is None else own + queue.room
        for own, queue in zip(owned, formation.queues, strict=True)
    ]
    return owned, most


TEAMS = st.integers(0, 80)


@given(formations(), TEAMS)
@settings(deadline=None)
def test_every_agent_has_one_place_or_all_queues_are_full(formation, agents):
    _, most = room(formation)
    counts, layout = formation.divide(agents), formation.layout(agents)
    common = min(agents, len(formation.common))
    assert sum(counts) == min(agents - common, sum(most))
    assert all(0 <= count <= limit for count, limit in zip(counts, most, strict=True))
    assert len(set(layout.places)) == len(layout.places) == agents - layout.unplaced
    assert layout.unplaced == agents - common - sum(counts)
    assert set(layout.places) == layout.slots.keys()


@given(formations(), TEAMS)
@settings(deadline=None)
def test_vertices_are_filled_first(formation, agents):
    owned, _ = room(formation)
    free = agents - len(formation.common)
    assume(free >= sum(owned))
    assert all(count >= own for count, own in zip(formation.divide(agents), owned, strict=True))
    vertices = set(formation.vertex_places.values())
    assert set(formation.layout(agents).places[: len(vertices)]) == vertices


@given(formations(closed=False), st.integers(130, 300))
@settings(deadline=None)
def test_shares_are_within_one_of_capacity_where_nothing_binds(formation, agents):
    """The team is so large that even the least share exceeds its queue's vertex."""
    free = agents - len(formation.common)
    for capacity, count in zip(formation.capacities, formation.divide(agents), strict=True):
        assert abs(count - capacity * free) < 1.0 + 1e-6


@given(formations(), TEAMS)
@settings(deadline=None)
def test_agents_that_do_not_fit_go_to_open_queues(formation, agents):
    _, most = room(formation)
    assume(inf in most)
    assert formation.layout(agents).unplaced == 0


@given(formations(), TEAMS)
@settings(deadline=None)
def test_no_two_slots_of_a_queue_are_nearer_than_d_ir_along_it(formation, agents):
    slots = formation.layout(agents).slots
    for j in range(len(formation.queues)):
        along = sorted(slot.arc_length for place, slot in slots.items() if place.queue == j)
        assert all(b - a >= 1.0 - 1e-6 for a, b in pairwise(along))


def test_a_shared_vertex_has_one_place_and_one_point():
    """V2 lies on both queues: at the end of the first, and in the middle of the second."""
    vertices = {
        "V1": (0.0, 0.0, 0.0),
        "V2": (4.0, 0.0, 0.0),
        "V3": (4.0, -3.0, 0.0),
        "V4": (4.0, 3.0, 0.0),
    }
    queues = (QueueSpec("along", ("V1", "V2")), QueueSpec("across", ("V3", "V2", "V4")))
    formation = Formation(FormationSpec("T", vertices, queues), 1.0)
    assert formation.common == (Place(0, 1),)
    layout = formation.layout(8)
    assert Place(1, 1) not in layout.slots
    assert layout.slots[Place(0, 1)].point == pytest.approx((4.0, 0.0, 0.0))
    points = [slot.point for slot in layout.slots.values()]
    assert all(dist(a, b) >= 1.0 - 1e-9 for i, a in enumerate(points) for b in points[:i])
    assert len(points) == 8


def test_a_place_on_an_open_queue_does_not_depend_on_the_team():
    formation = Formation(
        FormationSpec("line", {"V1": (1.0, 0.0, 0.0)}, (QueueSpec("Q1", ("V1",), AWAY),)), 0.8
    )
    for agents in (3, 7, 20):
        assert formation.slot(Place(0, 2), agents).point == pytest.approx((1.0, 0.0, 1.6))
    assert formation.slot(Place(0, 9), 3).arc_length == pytest.approx(7.2)
    assert formation.slot(Place(1, 0), 3) is None
