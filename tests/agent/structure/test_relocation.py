"""A team keeps its order from one mission to the next: each finds the same plan by itself."""

from math import dist, radians

import pytest

from agent.controller import Flown
from agent.messages import Place
from agent.qstructure.target_frame import Frame
from agent.structure.longest_way import MOST_MEMBERS
from agent.structure.relocation import Held, Relocated, relocated
from tests.agent.structure.builders import LIBRARY, LINE, TWO, library, lines, rays
from tests.agent.structure.team import Team

SPACING_M = 1.0
WEDGE = rays((-1, 1, 1), (-1, -1, 1), (-1, 1, -1), (-1, -1, -1))
MAPS = [LINE, TWO, WEDGE, lines((0.0, 0.0, 0.0), (0.0, 3.0, 0.0)), *map(library, LIBRARY)]
ASIDE = Frame((3.0, -2.0, 1.0), radians(20.0))


def flown(formation, frame, key=0):
    return Flown(key, formation.formation, frame, key)


def plan(before, after, old, new, members, *, now_s=0.0):
    """Return the new place of each old one."""
    places = before.formation.layout(members).places
    mission = flown(after, new, 1)
    held = [Held(place, members, frozenset(), flown(before, old), 0.0) for place in places]
    return {each.place: relocated(each, mission, now_s, SPACING_M) for each in held}


@pytest.mark.parametrize("before", MAPS)
@pytest.mark.parametrize("after", [LINE, WEDGE])
def test_each_member_gets_a_place_of_its_own(before, after):
    members = min(9, before.formation.layout(9).places.__len__())
    found = plan(before, after, Frame(), ASIDE, members)
    assert {each.place for each in found.values()} == set(after.formation.layout(members).places)
    assert {each.members for each in found.values()} == {members}


@pytest.mark.parametrize("formation", [LINE, TWO, WEDGE])
def test_a_team_that_is_displaced_keeps_its_places(formation):
    found = plan(formation, formation, Frame(), Frame((30.0, 5.0, -2.0), radians(10.0)), 9)
    assert all(each.place == place for place, each in found.items())


def test_a_plan_heeds_where_places_are_and_not_what_they_are_called():
    """Two lines exchange their names; a bonus for names would exchange the members, too.

    They are too many for exchanges that shorten the longest ways.
    """
    first, second = (0.0, 0.0, 0.0), (0.0, 0.6, 0.0)
    found = plan(lines(first, second), lines(second, first), Frame(), Frame(), 2 * MOST_MEMBERS)
    assert {(place, each.place) for place, each in found.items()} == {
        (Place(q, k), Place(1 - q, k)) for q in range(2) for k in range(MOST_MEMBERS)
    }


def test_a_line_that_turns_back_is_led_by_its_last():
    found = plan(LINE, LINE, Frame(), Frame((-7.0, 0.0, 0.0), radians(180.0)), 8)
    assert [found[Place(0, k)].place.rank for k in range(8)] == [7, 6, 5, 4, 3, 2, 1, 0]


def test_one_moving_frame_known_at_two_times_is_one_frame():
    before, later = Frame((1.0, 0.0, 0.0), 0.3, (0.2, 0.0, 0.0)), Frame((1.4, 0.0, 0.0), 0.3)
    found = plan(LINE, TWO, before, later, 6, now_s=2.0)
    assert {each.place for each in found.values()} == set(TWO.formation.layout(6).places)


@pytest.mark.parametrize("moving", [0, 1])
def test_no_place_follows_from_a_frame_that_moves_otherwise(moving):
    """Each learns of it at another time, and would find another plan."""
    frames = [Frame(), ASIDE]
    frames[moving] = Frame((5.0, 0.0, 0.0), 0.0, (0.2, 0.0, 0.0))
    assert set(plan(LINE, LINE, *frames, 6).values()) == {None}


def test_no_place_follows_where_the_new_queues_have_no_room():
    held = Held(Place(0, 40), 41, frozenset(), flown(LINE, Frame()), 0.0)
    closed = next(m for m in map(library, LIBRARY) if all(m.closed))
    assert relocated(held, flown(closed, Frame(), 1), 0.0, SPACING_M) is None


def test_where_the_places_stay_nobody_is_sent_into_a_blocked_one():
    blocked = frozenset({Place(0, 0)})
    for place in LINE.formation.layout(6, blocked).places:
        held = Held(place, 6, blocked, flown(LINE, ASIDE), 0.0)
        assert relocated(held, flown(LINE, ASIDE, 1), 0.0, SPACING_M) == Relocated(place, 6)


@pytest.mark.parametrize("after", [TWO, WEDGE])
def test_in_another_formation_nobody_is_sent_to_a_vehicle_that_hovers_there(after):
    """The vertex is at the same point of the world, though not of the frame."""
    blocked, ahead = frozenset({Place(0, 0)}), Frame((2.0, 0.0, 0.0))
    to_the_side = lines((-2.0, 0.0, 0.0)).formation
    for before in (LINE.formation, to_the_side):
        places = before.layout(6, blocked).places
        frame = ahead if before is to_the_side else Frame()
        mission = Flown(0, before, frame)
        held = [Held(place, 6, blocked, mission, 0.0) for place in places]
        found = {relocated(each, flown(after, Frame(), 1), 0.0, SPACING_M).place for each in held}
        assert found == set(after.formation.layout(6, blocked).places)


def test_a_team_all_of_whose_places_are_blocked_has_no_plan():
    closed = next(m for m in map(library, LIBRARY) if all(m.closed))
    blocked = frozenset(Place(q, k) for q in range(closed.queues) for k in range(200))
    held = Held(Place(0, 0), 6, blocked, flown(closed, Frame()), 0.0)
    assert relocated(held, flown(LINE, ASIDE, 1), 0.0, SPACING_M) is None


def test_a_place_beyond_the_team_is_none_of_its_places():
    held = Held(Place(0, 6), 6, frozenset(), flown(LINE, Frame()), 0.0)
    assert relocated(held, flown(LINE, ASIDE, 1), 0.0, SPACING_M) is None
    first = Held(Place(0, 0), 6, frozenset(), flown(LINE, Frame()), 0.0)
    assert relocated(first, flown(LINE, ASIDE, 1), 0.0, SPACING_M) == Relocated(Place(0, 0), 6)


@pytest.mark.parametrize("loss", [0.0, 0.3])
def test_a_line_that_turns_on_the_spot_neither_tears_nor_counts_anew(loss):
    """Its radio reaches two places on. Each member changes its place once, and none is lost."""
    team = Team(
        LINE, [(-float(k), 0.1 * (k % 2), 0.0) for k in range(12)], 1, range_m=2.5, loss=loss
    )
    assert team.until_formed(30.0)
    team.fly(Frame((-5.5, 5.5, 0.0), radians(90.0)))
    before = [member.changes for member in team.members.values()]
    started_s = team.now_s
    assert team.until_formed(20.0)
    assert team.now_s - started_s < 12.5, "the best plan takes 11 s, the old places 15.6 s"
    after = [member.changes for member in team.members.values()]
    assert max(b - a for a, b in zip(before, after, strict=True)) <= 1


def test_a_member_that_is_lost_on_the_way_leaves_no_gap():
    team = Team(LINE, [(-float(k), 0.0, 0.0) for k in range(8)])
    assert team.until_formed(20.0)
    team.fly(Frame((10.0, 0.0, 0.0)))
    team.run(2.0)
    team.members = {k: m for k, m in team.members.items() if not m.leads}
    assert team.until_formed(40.0)
    assert all(dist(m.at, (0.0, 0.0, 0.0)) > 2.0 for m in team.members.values())


@pytest.mark.parametrize("ahead_s", [0.2, 1.5, 5.0])
def test_where_a_frame_comes_before_its_mission_all_go_on_from_places_of_one_time(ahead_s):
    """In the new frame no vehicle hovers in the vertex, so the team would take other places."""
    team = Team(LINE, [(-float(k), 0.1, 0.0) for k in range(1, 7)])
    team.silent = ((0.0, 0.0, 0.0),)
    team.run(15.0)
    blocked = frozenset({Place(0, 0)})
    assert set(team.places()) == set(LINE.formation.layout(6, blocked).places)
    team.hear_frame(ASIDE)
    team.run(ahead_s)
    team.fly(ASIDE)
    team.run(0.2)
    assert set(team.places()) == set(LINE.formation.layout(6).places)
    assert team.until_formed(20.0)


@pytest.mark.parametrize("formation", [LINE, TWO, WEDGE])
def test_who_leads_keeps_a_queue_to_stand_in_while_its_vertex_is_taken(formation):
    team = Team(formation, [(-float(k), 0.2 * (k % 3), 0.0) for k in range(8)])
    assert team.until_formed(20.0)
    team.fly(Frame((3.0, 0.0, 0.0)))
    team.run(0.5)
    leaders = [member for member in team.members.values() if member.leads]
    assert len(leaders) == formation.vertices
    assert all(member.words.standing.queue >= 0 for member in leaders)
