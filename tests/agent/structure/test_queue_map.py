"""Numbers and places of the library's formations: open, closed and with several vertices."""

from math import dist

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.messages import Place
from agent.qstructure.formation import Formation, FormationSpec, QueueSpec
from agent.structure.queue_map import QueueMap
from tests.agent.structure.builders import LIBRARY, TWO, leader_summary, library, view

BRIDGE = FormationSpec(
    "bridge",
    {"A": (0.0, 0.0, 0.0), "B": (9.0, 0.0, 0.0), "C": (9.0, 7.0, 0.0)},
    (
        QueueSpec("through", ("A", "B", "C"), capacity=0.6),
        QueueSpec("back", ("A", "C"), capacity=0.4),
    ),
)
MAPS = {path.stem: library(path) for path in LIBRARY}
MAPS["bridge"] = QueueMap(Formation(BRIDGE, 1.0))
ALL = pytest.mark.parametrize("formation", MAPS.values(), ids=MAPS)


@ALL
def test_numbers_and_places_are_the_same_thing(formation):
    for queue in range(formation.queues):
        for number in range(1, 60):
            place = formation.place(queue, number)
            assert formation.number(place) == number
            assert place not in formation.vertex_of
    for place in formation.vertex_places:
        assert formation.number(place) < 1
    assert formation.number((-1, 3)) == formation.number((formation.queues, 3)) == 0


@ALL
def test_each_queue_begins_at_its_home(formation):
    for queue in range(formation.queues):
        assert queue in formation.homed[formation.home[queue]]
        assert formation.home[queue] in formation.vertices_of[queue]
    assert sorted(j for homed in formation.homed for j in homed) == list(range(formation.queues))


def members_of(formation, layout):
    """Return the places of a layout that are no vertices."""
    return [place for place in layout.places if formation.number(place) > 0]


def known(formation, agents, blocked=()):
    """Return a view of an agent that knows the size of the team."""
    steady = [leader_summary(total=agents)] * formation.vertices
    return view(formation, 1.0, summaries=steady, blocked=blocked)


def check_against_layout(formation, agents, blocked=frozenset()):
    """Check that an agent that knows the team finds every place where the layout has it."""
    layout = formation.formation.layout(agents, blocked)
    seen = known(formation, agents, blocked)
    found = members_of(formation, layout)
    for place in found:
        slot = formation.slot(
            place.queue,
            formation.number(place),
            seen.extent(place.queue, formation.number(place)),
        )
        assert slot is not None
        assert slot.point == pytest.approx(layout.slots[place].point, abs=1e-9), place
    for queue in range(formation.queues):
        share = sum(place.queue == queue for place in found)
        assert formation.members(agents, blocked)[queue] == share


@ALL
def test_every_place_of_a_layout_is_found_by_its_number(formation):
    for agents in range(formation.vertices, 31):
        if not formation.formation.layout(agents).unplaced:
            check_against_layout(formation, agents)


@settings(derandomize=True, deadline=None, max_examples=200)
@given(st.sampled_from(sorted(MAPS)), st.integers(6, 20), st.data())
def test_every_place_is_found_beside_blocked_ones(name, agents, data):
    formation = MAPS[name]
    places = formation.formation.layout(agents).places
    blocked = frozenset(data.draw(st.lists(st.sampled_from(places), max_size=3)))
    if not formation.formation.layout(agents, blocked).unplaced:
        check_against_layout(formation, agents, blocked)


@ALL
def test_only_members_have_blocked_numbers(formation):
    vertices = formation.vertex_places
    behind = [formation.place(queue, 2) for queue in range(formation.queues)]
    for queue in range(formation.queues):
        assert formation.blocked_numbers(queue, frozenset([*vertices, *behind])) == {2}


@ALL
def test_the_nearest_place_is_the_nearest(formation):
    for queue in range(formation.queues):
        wanted = 5 if not formation.closed[queue] else 3
        for number in range(1, wanted + 1):
            slot = formation.slot(queue, number, wanted)
            if slot is not None:
                found = formation.nearest(queue, wanted, slot.point)
                assert found.away_m == pytest.approx(0.0, abs=1e-9)


@ALL
@settings(derandomize=True, deadline=None, max_examples=30)
@given(data=st.data())
def test_no_place_is_nearer_than_the_nearest(formation, data):
    """Of places at the same distance it is the first."""
    coordinate = st.floats(-30.0, 30.0) | st.integers(-9, 9).map(float)
    here = data.draw(st.tuples(coordinate, coordinate, coordinate))
    members = data.draw(st.integers(1, 70))
    for queue in range(formation.queues):
        slots = [formation.slot(queue, number, members) for number in range(1, members + 1)]
        ways_m = [dist(slot.point, here) for slot in slots if slot is not None]
        found = formation.nearest(queue, members, here)
        assert found == (ways_m.index(min(ways_m)) + 1, min(ways_m))


def test_a_closed_queue_without_room_has_no_places():
    """Its vertices are its only places."""
    short = FormationSpec(
        "short", {"A": (0.0, 0.0, 0.0), "B": (1.5, 0.0, 0.0)}, (QueueSpec("Q", ("A", "B")),)
    )
    formation = QueueMap(Formation(short, 1.0))
    assert [formation.slot(0, number, 3) for number in (1, 2)] == [None, None]
    assert formation.nearest(0, 3, (0.0, 0.0, 0.0)) is None
    assert known(formation, 2).point(0, 1) is None


def test_there_is_no_place_without_a_number():
    assert TWO.slot(0, 0, 5) is None
    assert TWO.slot(0, -3, 5) is None


def test_a_vertex_without_a_leader_wants_one_member_in_one_of_its_queues():
    bridge = MAPS["bridge"]
    shares = (3, 2)
    assert bridge.with_vacancies(shares, (0, 0), [1]) == (4, 2)
    assert bridge.with_vacancies(shares, (0, 0), [0, 2]) == (5, 2)
    assert bridge.with_vacancies(shares, (0, 1), [0, 1]) == (4, 2), "the one in Q2 stands for A"
    assert bridge.with_vacancies(shares, (1, 0), [0, 1, 2]) == shares


def test_a_shared_vertex_is_common_and_of_all_its_queues():
    assert TWO.is_common(0)
    assert TWO.vertices_of == [[0], [0]]
    assert TWO.vertex_places == [Place(0, 0)]
    bridge = MAPS["bridge"]
    assert [bridge.is_common(v) for v in range(3)] == [True, False, True]
    assert bridge.homed == [[0, 1], [], []]
