"""Silent bodies: what hovers without a word is found, remembered, and explained by old word."""

import pytest

from agent.comms.unidentified_vehicles import (
    MEMORY_S,
    SILENCE_S,
    Departed,
    Member,
    UnidentifiedVehicles,
)
from tests.agent.comms.making import ORIGIN, beacon

BODY = (1.0, 0.0, 0.0)
FAR_MEMBER = Member((-2.0, 0.0, 0.0), 0.0)
HEARD = [beacon(5, 1, 10.0, at=FAR_MEMBER.position)]


def looked(bodies, now_s, sensed=(BODY,), team=(FAR_MEMBER,), departed=(), here=ORIGIN):
    return bodies.look(now_s, here, sensed, HEARD, team, departed)


def test_a_body_is_silent_once_nothing_was_heard_of_it_for_long():
    bodies = UnidentifiedVehicles(0.5)
    assert looked(bodies, 10.0) == ()
    assert looked(bodies, 10.0 + SILENCE_S - 0.1) == ()
    assert looked(bodies, 10.0 + SILENCE_S) == (BODY,)


def test_a_member_that_fell_silent_where_its_body_hovers_is_silent_at_once():
    bodies = UnidentifiedVehicles(0.5)
    assert looked(bodies, 10.0, team=(FAR_MEMBER, Member(BODY, 1.4))) == ()
    assert looked(bodies, 10.2, departed=[Departed(BODY, 8.6)]) == (BODY,)


def test_a_member_that_fell_silent_elsewhere_explains_no_body():
    bodies = UnidentifiedVehicles(0.5)
    assert looked(bodies, 10.0, departed=[Departed((1.0, 0.5, 0.0), 8.0)]) == ()


def test_a_member_explains_a_body_as_far_as_it_may_have_flown_since():
    bodies = UnidentifiedVehicles(0.5)
    old = Member((2.0, 0.0, 0.0), 1.5)
    for now_s in (10.0, 12.0, 14.0):
        assert looked(bodies, now_s, team=(FAR_MEMBER, old)) == ()


def test_a_body_beyond_whom_one_hears_may_be_out_of_the_radios_range():
    bodies = UnidentifiedVehicles(0.5)
    for now_s in (10.0, 12.0, 14.0):
        assert (
            bodies.look(
                now_s, ORIGIN, [BODY], [beacon(5, 1, 10.0, at=(0.5, 0.0, 0.0))], (FAR_MEMBER,)
            )
            == ()
        )


@pytest.mark.parametrize(
    ("away", "remembered"), [((3.0, 0.0, 0.0), True), ((0.5, 0.0, 0.0), False)]
)
def test_a_body_is_remembered_out_of_sight_but_not_where_it_would_be_seen(away, remembered):
    bodies = UnidentifiedVehicles(0.5)
    for now_s in (10.0, 12.0):
        looked(bodies, now_s)
    assert looked(bodies, 12.2, sensed=(), here=away) == ((BODY,) if remembered else ())
    assert looked(bodies, 12.4 + MEMORY_S, sensed=(), here=away) == ()


def test_a_body_that_flies_past_is_not_remembered_where_it_was_seen_last():
    bodies = UnidentifiedVehicles(0.5)
    gone = [Departed((1.0, 0.0, 0.0), 8.0)]
    assert looked(bodies, 10.0, departed=gone) == (BODY,)
    for step in range(1, 12):
        assert looked(bodies, 10.0 + 0.2 * step, sensed=[(1.0, 0.1 * step, 0.0)]) in ((BODY,), ())
    assert looked(bodies, 12.4, sensed=(), here=(-1.0, 0.0, 0.0)) == ()


@pytest.mark.parametrize("tells", [True, False])
def test_a_neighbour_who_would_see_a_remembered_body_and_tells_of_none_is_believed(tells):
    bodies = UnidentifiedVehicles(0.5)
    for now_s in (10.0, 12.0):
        looked(bodies, now_s)
    witness = beacon(5, 1, 12.2, at=(1.0, 1.0, 0.0))
    remembered = bodies.look(
        12.2, (3.0, 0.0, 0.0), (), [witness], (FAR_MEMBER,), (), lambda *_: tells
    )
    assert remembered == ((BODY,) if tells else ())
