"""Occupied places: an agent that stands in one keeps it; one that was left is not free at once."""

import pytest

from agent.controller import Flown, Senses
from agent.messages import MAX_PLACES, Place
from agent.places.occupied_slots import FREED_S, GROWN_S, STALE_S, OccupiedSlots
from agent.places.place_points import PlacePoints
from agent.qstructure.formation import Formation, FormationSpec, QueueSpec
from agent.qstructure.shape import Ray
from agent.qstructure.target_frame import Frame

LINE = Formation(
    FormationSpec(
        "line",
        {"V1": (0.0, 0.0, 0.0)},
        (QueueSpec(name="Q1", vertices=("V1",), shape=Ray(direction=(-1.0, 0.0, 0.0))),),
    ),
    1.0,
)
MISSION = Flown(key=0, formation=LINE, frame=Frame())
SECOND, THIRD = Place(0, 1), Place(0, 2)
ME = Place(0, 0), (0.0, 0.0, 0.0)
FAR = THIRD, (-5.0, 0.0, 0.0)
START_S = 10.0


def senses(now_s, unidentified=(), vehicles=(), at=ME[1]):
    return Senses(
        now_s=now_s,
        position=at,
        velocity=(0.0, 0.0, 0.0),
        yaw=0.0,
        vehicles=tuple(vehicles),
        neighbours=(),
        team=tuple,
        mission=MISSION,
        silent=tuple(unidentified),
    )


def update(occupied, near, team=(ME, FAR), reported=frozenset(), mission=MISSION):
    """Return the places that are not available. team: place and position of each member."""
    return occupied.update(near, mission, team, len(team), frozenset(reported))


@pytest.fixture
def occupied():
    made = OccupiedSlots(PlacePoints(1.0), senses_vehicles=True)
    assert update(made, senses(START_S - GROWN_S)) == frozenset()
    return made


def test_a_vehicle_near_a_place_takes_it(occupied):
    assert update(occupied, senses(START_S, unidentified=[(-1.1, 0.3, 0.0)])) == {SECOND}
    assert occupied.seen == (SECOND,)


def test_places_beyond_those_that_others_report_are_examined_too(occupied):
    """The team of two fills the first and the third place, once the second is reported."""
    vehicles = [(-1.0, 0.0, 0.0), (-2.0, 0.0, 0.0)]
    near = senses(START_S, [vehicles[1]], vehicles)
    assert update(occupied, near, reported={SECOND}) == {SECOND, THIRD}
    assert occupied.seen == (THIRD,)


def test_all_seen_places_count_and_the_first_to_fill_are_reported():
    made = OccupiedSlots(PlacePoints(1.0), senses_vehicles=True)
    team = ((None, (9.0, 0.0, 0.0)),)
    update(made, senses(START_S - GROWN_S), team)
    line = [(-float(rank), 0.0, 0.0) for rank in range(MAX_PLACES + 3)]
    for at in ((9.0, 0.0, 0.0), (-30.0, 0.0, 0.0)):
        found = update(made, senses(START_S, unidentified=line, at=at), team)
        assert found == {Place(0, rank) for rank in range(MAX_PLACES + 3)}
        assert made.seen == tuple(Place(0, rank) for rank in range(MAX_PLACES))


def test_an_agent_that_stands_in_its_place_keeps_it(occupied):
    holder = SECOND, (-1.05, 0.0, 0.0)
    near = senses(START_S, unidentified=[(-1.2, 0.3, 0.0)])
    assert update(occupied, near, (ME, holder), {SECOND}) == frozenset()
    assert occupied.seen == ()


def test_a_place_that_a_vehicle_has_left_is_not_free_at_once(occupied):
    update(occupied, senses(START_S, unidentified=[(-1.0, 0.0, 0.0)]))
    assert update(occupied, senses(START_S + 0.9 * FREED_S)) == {SECOND}
    assert occupied.seen == ()
    assert update(occupied, senses(START_S + 1.1 * FREED_S)) == frozenset()


def test_in_a_new_mission_the_places_at_the_same_points_are_taken(occupied):
    """A neighbour has reported the vehicle; in the new mission it has not spoken yet."""
    far_off, farther = (9.0, 0.0, 0.0), (8.0, 0.0, 0.0)
    team = ((None, far_off), (None, farther))
    update(occupied, senses(START_S, at=far_off), team, {SECOND})
    new = Flown(1, LINE, Frame((-1.2, 0.0, 0.0)))
    assert update(occupied, senses(START_S + 0.1, at=far_off), team, mission=new) == {ME[0]}
    elsewhere = Flown(1, LINE, Frame((-9.0, 0.0, 0.0)), frame_key=2)
    assert update(occupied, senses(START_S + 0.2, at=far_off), team, mission=elsewhere) == set()


def test_new_missions_do_not_hold_a_place_that_a_vehicle_has_left(occupied):
    """The vehicle in the vertex stays; each mission comes before the other place is free."""
    team = ((None, (9.0, 0.0, 0.0)), FAR)
    hovering, leaving = (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
    both = senses(START_S, [hovering, leaving], at=(9.0, 0.0, 0.0))
    assert update(occupied, both, team) == {ME[0], SECOND}
    for step, found in ((1, {ME[0], SECOND}), (2, {ME[0]})):
        near = senses(START_S + 0.6 * step * FREED_S, [hovering], at=(9.0, 0.0, 0.0))
        assert update(occupied, near, team, mission=Flown(step, LINE, Frame())) == found


def test_a_place_is_not_free_while_an_unknown_vehicle_is_near(occupied):
    update(occupied, senses(START_S, unidentified=[(-1.0, 0.0, 0.0)]))
    for step in range(1, 5):
        coming = senses(START_S + 0.5 * step * FREED_S, vehicles=[(-1.4, 0.0, 0.0)])
        assert update(occupied, coming) == {SECOND}
        assert occupied.seen == (SECOND,)


def test_a_vehicle_that_turns_out_to_be_a_member_blocks_nothing(occupied):
    update(occupied, senses(START_S, unidentified=[(-1.0, 0.0, 0.0)]))
    grown = (ME, FAR, (None, (-1.0, 0.0, 0.0)))
    assert update(occupied, senses(START_S + 0.2), grown) == frozenset()


@pytest.mark.parametrize("reported", [frozenset(), {SECOND}])
def test_a_known_member_that_is_heard_again_blocks_nothing(occupied, reported):
    """The team has not grown: the member was told of by others, and not heard itself."""
    there = (-1.0, 0.0, 0.0)
    update(occupied, senses(START_S, unidentified=[there]), reported=reported)
    near = senses(START_S + 0.2, vehicles=[there])
    assert update(occupied, near, (ME, (THIRD, there)), reported) == frozenset()
    assert occupied.seen == ()
    assert update(occupied, senses(START_S + 0.5), (ME, FAR), reported) == frozenset(), "left"
    later = senses(START_S + 0.3 + STALE_S, at=(9.0, 0.0, 0.0))
    assert update(occupied, later, (ME, FAR), reported) == reported, "another one is there"


def test_a_reported_vehicle_is_believed_unless_the_agent_sees_the_place_empty(occupied):
    assert update(occupied, senses(START_S), reported={SECOND, THIRD}) == {THIRD}
