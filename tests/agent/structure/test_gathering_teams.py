"""Whole teams gather in their queues' lines, which then fly to their vertices (Sec. 3.1)."""

from math import dist
from random import Random

import pytest

from agent.messages import ZERO
from agent.structure.gathering import GATHER_S
from tests.agent.structure.builders import lines, rays, replace
from tests.agent.structure.team import Team

THREE = lines((0.0, -1.5, 0.0), ZERO, (0.0, 1.5, 0.0))
WEDGE = rays((-1, 1, 1), (-1, -1, 1), (-1, 1, -1), (-1, -1, -1))
RADIOS = {"clean": {}, "half lost": {"loss": 0.5, "latency_s": 0.2}}
RADIO = pytest.mark.parametrize("radio", RADIOS.values(), ids=RADIOS)
AWAY = (-8.0, 0.0, 0.0)


def team(formation, agents=12, seed=0, kind=Team, **options):
    """Return a team that starts mixed up, 8 m from the first vertex."""
    random = Random(seed)
    sides = (2.5, 2.5, 1.5)
    points = [
        tuple(x + random.uniform(-side, side) for x, side in zip(AWAY, sides, strict=True))
        for _ in range(agents)
    ]
    return kind(formation, points, seed, **options)


def stand_in_lines(flown):
    """Whether the members of each queue keep the distances of their slots."""
    layout = flown.map.formation.layout(len(flown.members))
    held = [m for m in flown.members.values() if m.place in layout.slots and not m.leads]
    if len(held) + flown.map.vertices < len(flown.members):
        return False
    return all(
        abs(dist(a.at, b.at) - dist(layout.slots[a.place].point, layout.slots[b.place].point)) < 0.3
        for a in held
        for b in held
        if a.place.queue == b.place.queue
    )


def lead_s(flown, seconds=45.0):
    """Fly until the team has formed; return how long before its queues stood, without a break."""
    since_s = None
    while not flown.formed():
        assert flown.now_s < seconds
        flown.step()
        if not stand_in_lines(flown):
            since_s = None
        elif since_s is None:
            since_s = flown.now_s
    return flown.now_s - since_s


@RADIO
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("formation", [THREE, WEDGE], ids=["three lines", "wedge"])
def test_queues_stand_in_their_lines_long_before_the_whole_formation(formation, seed, radio):
    flown = team(formation, seed=seed, gather=True, **radio)
    assert lead_s(flown) > 10.0
    assert flown.run(8.0) == 0
    assert flown.formed()


@pytest.mark.parametrize("formation", [THREE, WEDGE], ids=["three lines", "wedge"])
def test_without_gathering_they_stand_when_the_whole_formation_does(formation):
    assert lead_s(team(formation)) < 3.0


def test_a_leader_flies_to_its_vertex_at_once():
    flown = team(THREE, gather=True)
    flown.run(3.0)
    leaders = [member for member in flown.members.values() if member.leads]
    flown.run(12.0)
    assert len(leaders) == 3
    for leader in leaders:
        assert dist(leader.at, THREE.vertex_points[THREE.vertex_of[leader.place]]) < 0.01
    assert not flown.formed()


@RADIO
def test_a_team_forms_though_all_its_leaders_leave_while_it_gathers(radio):
    flown = team(THREE, gather=True, **radio)
    flown.run(4.0)
    for leader in [k for k, member in flown.members.items() if member.leads]:
        del flown.members[leader]
    assert flown.until_formed(60.0)
    assert flown.run(8.0) == 0


class NeverReady(Team):
    """A team of which no member reports that it is in its place of the line."""

    def _send(self, member):
        said = member.words.summary
        if said is not None and said.lines is not None:
            parts = tuple(part._replace(ready=0) for part in said.lines.parts)
            said = replace(said, lines=replace(said.lines, parts=parts))
            member.words = member.words._replace(summary=said)
        super()._send(member)


def test_a_line_leaves_though_nobody_reports_that_it_is_ready():
    """Each agent knows from the start when the line leaves at the latest."""
    ready, never = (lead_s(team(THREE, kind=kind, gather=True)) for kind in (Team, NeverReady))
    assert ready > 10.0
    assert ready < never < ready + GATHER_S + 12.0 / 0.5


def test_who_joins_while_the_line_flies_goes_straight_to_its_slot():
    flown = team(THREE, gather=True)
    flown.run(12.0)
    flown.join((-8.0, 6.0, 0.0))
    joiner = flown.members[max(flown.members)]
    flown.run(6.0)
    place = joiner.place
    assert place is not None
    straight_m = dist(joiner.at, flown.map.formation.slot(place, 13).point)
    flown.run(4.0)
    moved_m = straight_m - dist(joiner.at, flown.map.formation.slot(place, 13).point)
    assert joiner.place != place or moved_m == pytest.approx(2.0, abs=0.01)
    assert flown.until_formed(60.0)
