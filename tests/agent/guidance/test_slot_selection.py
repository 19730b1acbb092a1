"""When a place is chosen anew: after the news has settled, and never long after."""

import msgspec
import pytest

from agent.config import AgentSetup, Comms, Control, Vehicle
from agent.controller import Flown, Heard, Peer, Senses
from agent.guidance.slot_selection import ALONE_S, LISTEN_S, PATIENCE_S, Choice
from agent.messages import Place
from agent.qstructure.formation import Formation
from agent.qstructure.target_frame import Frame
from tests.agent.test_core import WEDGE

TICK_S = 0.05
HERE = (0.0, 0.0, 0.0)
MISSION = Flown(0, Formation(WEDGE, 1.0), Frame())
APEX = Place(0, 0)


def peer(who):
    """A member at its own slot, but for the apex's: who is 1 stands at the first one, and so on."""
    place = MISSION.formation.layout(6).places[who]
    return Peer(who, MISSION.formation.slot(place, 6).point, place)


def choice():
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
    return Choice(setup)


def senses(now_s, team, at=HERE, vehicles=(), blocked=(), silent=()):
    said = [Heard(each.id, 0.05, each.position, HERE, HERE, each.place) for each in team if each.id]
    return Senses(
        now_s=now_s,
        position=at,
        velocity=HERE,
        yaw=0.0,
        vehicles=tuple(vehicles),
        neighbours=tuple(said),
        team=lambda: tuple(team),
        mission=MISSION,
        silent=tuple(silent),
        blocked=frozenset(blocked),
    )


def first_made_s(mind, team, until_s=4.0):
    """Return when a place is first chosen [s]; None where none is by then."""
    for tick in range(round(until_s / TICK_S)):
        if mind.made(senses(tick * TICK_S, team)) is not None:
            return tick * TICK_S
    return None


def test_a_place_is_claimed_once_nobody_new_turned_up_for_a_while():
    assert first_made_s(choice(), [peer(who) for who in range(4)]) == pytest.approx(LISTEN_S)


def test_who_has_heard_nobody_waits_longer_before_it_takes_itself_for_the_team():
    assert first_made_s(choice(), [peer(0)]) == pytest.approx(ALONE_S)


def settled(team):
    mind = choice()
    for tick in range(40):
        mind.made(senses(tick * TICK_S, team))
    return mind, 40 * TICK_S


def test_a_place_is_kept_while_members_go_one_after_another():
    """Two of a queue go 0.3 s apart: it is chosen anew after the second, not after the first."""
    team = [Peer(0, peer(5).position, peer(5).place), *map(peer, range(1, 5)), peer(0)]
    team = [msgspec.structs.replace(each, id=who) for who, each in enumerate(team)]
    mind, now_s = settled(team)
    kept = mind.made(senses(now_s, team, at=team[0].position)).place
    places = []
    for tick in range(30):
        left = team[:-1] if tick < 6 else [each for each in team[:-1] if each.id != 1]
        made = mind.made(senses(now_s + tick * TICK_S, left, at=team[0].position))
        places.append(made.place)
    changed = next(tick for tick, place in enumerate(places) if place != kept)
    assert changed * TICK_S == pytest.approx(6 * TICK_S + LISTEN_S, abs=0.21)


def test_where_somebody_comes_or_goes_all_the_time_patience_ends():
    team = [peer(who) for who in range(6)]
    mind, now_s = settled(team)
    asked = []
    mind._choose = lambda *given: asked.append(given[0].now_s)
    for tick in range(40):
        mind.made(senses(now_s + tick * TICK_S, team[: 3 + tick % 3]))
    assert asked[0] - now_s == pytest.approx(PATIENCE_S, abs=TICK_S)


def test_a_place_that_others_call_blocked_is_free_where_one_sees_that_nobody_is_there():
    team = [peer(who) for who in range(6)]
    mind, now_s = settled(team)
    gone = MISSION.formation.slot(Place(0, 1), 6).point
    for vehicles, held in (((), APEX), ((gone,), APEX)):
        for tick in range(20):
            made = mind.made(senses(now_s + tick * TICK_S, team, vehicles=vehicles, blocked=[APEX]))
        assert made.place == held, "one stands there oneself: nobody else does"
        now_s += 1.0


def test_who_changes_its_place_time_after_time_does_so_ever_more_rarely():
    team = [peer(who) for who in range(6)]
    mind, now_s = settled(team)
    mind._moved_s = -10.0
    held = [mind._held_s(now_s + 0.1 * row, 0.05) for row in range(6)]
    assert held == pytest.approx([0.2, 0.4, 0.8, 1.6, 3.0, 3.0], abs=1e-6)
    assert mind._held_s(now_s + 10.0, 0.05) == pytest.approx(0.2, abs=1e-6), "calm since"
    assert mind._held_s(now_s + 20.0, 0.7) == pytest.approx(1.4, abs=1e-6), "word there and back"
