"""Slot selection: a place is chosen anew once knowledge has settled, and not much later."""

from dataclasses import replace

import pytest

from agent.assignment.slot_selection import ALONE_S, PATIENCE_S, SETTLED_S, SlotSelection
from agent.config import AgentSetup, Comms, Control, Vehicle
from agent.controller import Flown, Heard, Peer, Senses
from agent.messages import Place
from agent.qstructure.formation import Formation
from agent.qstructure.target_frame import Frame
from tests.agent.test_core import WEDGE

TICK_S = 0.05
HERE = (0.0, 0.0, 0.0)
MISSION = Flown(key=0, formation=Formation(WEDGE, 1.0), frame=Frame())
APEX = Place(0, 0)


def peer(number):
    """Return a member that stands in the place of that number, in the order in which they fill."""
    place = MISSION.formation.layout(6).places[number]
    return Peer(id=number, position=MISSION.formation.slot(place, 6).point, place=place)


def selection():
    setup = AgentSetup(
        id=0,
        incarnation=0,
        tick_hz=1.0 / TICK_S,
        slots_per_tick=4,
        command_ticks=1,
        vehicle=Vehicle(),
        fleet_max_speed_mps=0.5,
        control=Control(),
        comms=Comms(),
        formation=WEDGE,
    )
    return SlotSelection(setup)


def senses(now_s, team, at=HERE, vehicles=(), blocked=()):
    heard = [
        Heard(
            id=each.id,
            age_s=0.05,
            position=each.position,
            velocity=HERE,
            target=HERE,
            place=each.place,
        )
        for each in team
        if each.id
    ]
    return Senses(
        now_s=now_s,
        position=at,
        velocity=HERE,
        yaw=0.0,
        vehicles=tuple(vehicles),
        neighbours=tuple(heard),
        team=lambda: tuple(team),
        mission=MISSION,
        blocked=frozenset(blocked),
    )


def first_choice_s(made, team, until_s=4.0):
    """Return when a place is first chosen [s]; None if none is chosen by ``until_s``."""
    for tick in range(round(until_s / TICK_S)):
        if made.select(senses(tick * TICK_S, team)) is not None:
            return tick * TICK_S
    return None


def test_a_place_is_claimed_once_no_new_member_turned_up_for_a_while():
    assert first_choice_s(selection(), [peer(number) for number in range(4)]) == pytest.approx(
        SETTLED_S
    )


def test_an_agent_that_has_heard_no_other_waits_longer():
    assert first_choice_s(selection(), [peer(0)]) == pytest.approx(ALONE_S)


def settled(team):
    made = selection()
    for tick in range(40):
        made.select(senses(tick * TICK_S, team))
    return made, 40 * TICK_S


def test_a_place_is_kept_while_members_go_one_after_another():
    """Two members of a queue leave 0.3 s apart: the place is chosen anew after the second only."""
    team = [peer(5), *map(peer, range(1, 5)), peer(0)]
    team = [replace(each, id=number) for number, each in enumerate(team)]
    made, now_s = settled(team)
    kept = made.select(senses(now_s, team, at=team[0].position)).place
    places = []
    for tick in range(30):
        left = team[:-1] if tick < 6 else [each for each in team[:-1] if each.id != 1]
        own = made.select(senses(now_s + tick * TICK_S, left, at=team[0].position))
        places.append(own.place)
    changed = next(tick for tick, place in enumerate(places) if place != kept)
    assert changed * TICK_S == pytest.approx(6 * TICK_S + SETTLED_S, abs=0.21)


def test_an_agent_with_a_place_does_not_wait_for_ever():
    team = [peer(number) for number in range(6)]
    made, now_s = settled(team)
    asked = []
    made._choose = lambda *given: asked.append(given[0].now_s)
    for tick in range(40):
        made.select(senses(now_s + tick * TICK_S, team[: 3 + tick % 3]))
    assert asked[0] - now_s == pytest.approx(PATIENCE_S, abs=TICK_S)


def test_a_place_reported_as_blocked_is_free_if_the_agent_sees_it_empty():
    team = [peer(number) for number in range(6)]
    made, now_s = settled(team)
    gone = MISSION.formation.slot(Place(0, 1), 6).point
    for vehicles, held in (((), APEX), ((gone,), APEX)):
        for tick in range(20):
            own = made.select(
                senses(now_s + tick * TICK_S, team, vehicles=vehicles, blocked=[APEX])
            )
        assert own.place == held, "the agent itself stands there"
        now_s += 1.0


def test_repeated_changes_of_place_become_ever_rarer():
    team = [peer(number) for number in range(6)]
    made, now_s = settled(team)
    made._moved_s = -10.0
    held = [made._hold_s(now_s + 0.1 * row, 0.05) for row in range(6)]
    assert held == pytest.approx([0.2, 0.4, 0.8, 1.6, 3.0, 3.0], abs=1e-6)
    assert made._hold_s(now_s + 10.0, 0.05) == pytest.approx(0.2, abs=1e-6), (
        "a calm time does not end the count of changes"
    )
    assert made._hold_s(now_s + 20.0, 0.7) == pytest.approx(1.4, abs=1e-6), (
        "a place is not kept for a message there and one back"
    )
