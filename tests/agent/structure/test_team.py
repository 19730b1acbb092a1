"""Small teams by the whole structure: they form the layout exactly, and then keep still."""

from collections import Counter
from dataclasses import replace
from math import dist
from random import Random

import pytest

from agent.assignment.allocation import allocate
from agent.controller import Peer
from agent.messages import Place
from agent.structure.label_code import queue_of_code
from tests.agent.structure.builders import LIBRARY, LINE, TWO, library, lines, rays
from tests.agent.structure.team import Team

WEDGE = rays((-1, 1, 1), (-1, -1, 1), (-1, 1, -1), (-1, -1, -1))
THREE_LINES = lines((0.0, 0.0, 0.0), (0.0, 3.0, 0.0), (0.0, 6.0, 0.0))
FIGURES = {path.stem: library(path) for path in LIBRARY if path.stem.startswith("figure")}
MAPS = {"line": LINE, "two": TWO, "wedge": WEDGE, "three lines": THREE_LINES, **FIGURES}
RADIOS = {
    "clean": {},
    "clean, short": {"range_m": 6.0},
    "half lost": {"loss": 0.5, "latency_s": 0.2},
    "half lost, short": {"loss": 0.5, "latency_s": 0.2, "range_m": 6.0},
}
RADIO = pytest.mark.parametrize("radio", RADIOS.values(), ids=RADIOS)


def team(formation, agents, seed=0, **radio):
    """Return a team scattered around the origin."""
    random = Random(seed)
    sides = (4.0, 4.0, 2.0)
    points = [tuple(random.uniform(-side, side) for side in sides) for _ in range(agents)]
    return Team(formation, points, seed, **radio)


def check_stays(flown, seconds=8.0):
    """Check that no agent changes its place any more."""
    assert flown.run(seconds) == 0
    assert flown.formed()


@RADIO
@pytest.mark.parametrize("name", MAPS)
def test_a_team_forms_and_keeps_still(name, radio):
    flown = team(MAPS[name], 10, **radio)
    assert flown.until_formed(30.0)
    check_stays(flown)


@pytest.mark.parametrize("name", MAPS)
def test_the_first_beacon_tells_the_queue(name):
    """Else the news of it would go through the team twice: as a member, then with its queue."""
    flown = team(MAPS[name], 6)
    flown.step()
    for member in flown.members.values():
        said = member.words.standing
        assert said.queue >= 0
        assert queue_of_code(said.code, flown.map.queues) == said.queue or said.leads >= 0


@pytest.mark.parametrize("radio", [{}, RADIOS["half lost, short"]], ids=["clean", "half lost"])
@pytest.mark.parametrize(
    ("name", "agents"),
    [("figure-1a", 5), ("figure-1a", 6), ("figure-1b", 6), ("three lines", 3), ("three lines", 5)],
)
def test_a_team_hardly_larger_than_its_vertices_leads_them_all(name, agents, radio):
    flown = team(MAPS[name], agents, **radio)
    assert flown.until_formed(40.0)
    check_stays(flown)


def disordered_line(agents, seed):
    """Return a line of agents in any order, all nearly in a place; each hears four others."""
    draw = Random(seed)
    points = [
        (draw.gauss(-k, 0.12), draw.gauss(0.0, 0.12), draw.gauss(0.0, 0.12))
        for k in draw.sample(range(agents), agents)
    ]
    return Team(LINE, points, seed, range_m=2.5, loss=0.5, latency_s=0.05)


def test_a_line_that_nearly_stands_forms_at_once_in_spite_of_loss():
    """If news were told once, or agents moved before all are known, some would take 12 s."""
    flown = [disordered_line(20, seed) for seed in range(6)]
    assert all(each.until_formed(8.0) for each in flown)
    assert sum(sum(m.changes for m in each.members.values()) for each in flown) <= 4
    check_stays(flown[0])


@pytest.mark.parametrize("agents", [2, 5, 8, 15])
def test_a_line_that_stands_in_its_places_stays_there(agents):
    """Remark 5: each hears only those beside it, at exactly the range, so no step is free."""
    points = [(-float(k), 0.0, 0.0) for k in range(agents)]
    flown = Team(LINE, points, range_m=1.0 + 1e-6)
    assert flown.until_formed(12.0)
    check_stays(flown, 20.0)
    words = [member.words for member in flown.members.values()]
    assert [each.tier for each in words] == list(range(agents))
    assert [each.parent for each in words] == list(range(-1, agents - 1))


@RADIO
def test_a_vertex_that_nobody_starts_near_gets_its_leader(radio):
    """All start beside the first of three lines: the others' leaders are ordered there."""
    points = [(-float(k), -1.0, 0.0) for k in range(6)]
    flown = Team(THREE_LINES, points, **radio)
    assert flown.until_formed(40.0)
    check_stays(flown)


@pytest.mark.parametrize("radio", [{}, RADIOS["half lost, short"]], ids=["clean", "half lost"])
@pytest.mark.parametrize("name", ["line", "wedge", "figure-1a"])
def test_a_team_forms_anew_when_leaders_leave_and_others_join(name, radio):
    flown = team(MAPS[name], 9, seed=1, **radio)
    assert flown.until_formed(30.0)
    for leader in [k for k, member in flown.members.items() if member.leads][:2]:
        del flown.members[leader]
    assert flown.until_formed(40.0)
    for at in ((-3.0, -3.0, 0.0), (3.0, 3.0, 1.0), (2.0, 0.0, 0.0)):
        flown.join(at)
    assert flown.until_formed(40.0)
    check_stays(flown)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("loss", "latency_s"), [(0.5, 0.2), (0.8, 0.5)])
def test_who_joins_waits_until_the_team_counts_it_and_so_keeps_its_first_place(
    loss, latency_s, seed
):
    """Where all hear all; if they took the nearest numbers at once they would change them."""
    flown = team(WEDGE, 9, seed, loss=loss, latency_s=latency_s)
    assert flown.until_formed(30.0)
    for at in ((-3.0, -3.0, 0.0), (3.0, 3.0, 1.0), (2.0, 0.0, 0.0)):
        flown.join(at)
    assert flown.until_formed(12.0)
    assert sum(flown.members[joined].changes for joined in (9, 10, 11)) <= 1


@pytest.mark.parametrize("seed", range(3))
def test_two_halves_that_meet_again_form_one_team(seed):
    flown = team(WEDGE, 10, seed)
    apart = flown.drops
    flown.drops = lambda sender, receiver, _: (sender < 5) != (receiver < 5)
    flown.run(20.0)
    flown.drops = apart
    assert flown.until_formed(30.0)
    check_stays(flown)


@pytest.mark.parametrize("seed", range(5))
def test_an_adversary_of_the_radio_costs_no_place(seed):
    """For 15 s it makes each way deaf as it likes, for seconds on end: no place is lost."""
    flown, random, deaf = team(WEDGE, 8, seed, range_m=8.0), Random(seed), {}

    def drops(sender, receiver, now_s):
        if now_s > 15.0:
            return False
        until_s, lost = deaf.get((sender, receiver), (0.0, False))
        if now_s >= until_s:
            lost = random.random() < 0.6
            deaf[(sender, receiver)] = (now_s + random.expovariate(1.0), lost)
        return lost

    flown.drops = drops
    flown.run(15.0)
    assert flown.until_formed(40.0)
    check_stays(flown)


def test_equal_seeds_give_equal_flights():
    def flight():
        flown = team(WEDGE, 9, 3, loss=0.5, latency_s=0.2, range_m=6.0)
        flown.run(6.0)
        return [(member.place, member.at) for member in flown.members.values()]

    assert flight() == flight()


def test_where_the_team_is_does_not_matter():
    """The same flight elsewhere, with its formation, ends in the same places."""

    def places(shift):
        formation = lines((shift, 0.0, 0.0), (shift, 3.0, 0.0))
        random = Random(4)
        points = [(shift + random.uniform(-4, 4), random.uniform(-4, 4), 0.0) for _ in range(8)]
        flown = Team(formation, points, 4)
        flown.run(10.0)
        return [member.place for member in flown.members.values()]

    assert places(0.0) == places(4096.0)


class TeamWithBody(Team):
    """A team that sees an unidentified vehicle at a point, once there is one (E18)."""

    body = None

    def _senses(self, member):
        senses = super()._senses(member)
        if self.body is None:
            return senses
        return replace(senses, silent=(self.body,))

    def formed(self):
        """Whether the team has the places that the body leaves, and all stand in them."""
        taken = frozenset([Place(0, 0)] if self.body is not None else [])
        layout = self.map.formation.layout(len(self.members), taken)
        return self.places() == Counter(layout.places) and all(
            dist(member.at, layout.slots[member.place].point) < 0.01
            for member in self.members.values()
        )


def with_body(formation, agents, **radio):
    """Return a team that stands in its places, the dead leader of its vertex too."""
    points = [slot.point for slot in formation.formation.layout(agents).slots.values()]
    flown = TeamWithBody(formation, points, **radio)
    assert flown.until_formed(20.0)
    (leader,) = [k for k, member in flown.members.items() if member.place == Place(0, 0)]
    del flown.members[leader]
    flown.body = (0.0, 0.0, 0.0)
    flown.run(8.0)
    assert flown.until_formed(40.0)
    return flown


@pytest.mark.parametrize(
    "radio",
    [{}, {"range_m": 2.5}, {"range_m": 2.5, "loss": 0.3}],
    ids=["clean", "short", "lossy"],
)
@pytest.mark.parametrize("formation", [LINE, WEDGE], ids=["line", "wedge"])
def test_a_leader_whose_vertex_is_taken_keeps_a_number_of_its_own(formation, radio):
    """Who joins beside it takes its number: one of them moves on (E18)."""
    flown = with_body(formation, 7, **radio)
    (leader,) = [member for member in flown.members.values() if member.leads]
    assert leader.place.rank >= 1
    for _ in range(2):
        flown.join(leader.at)
        assert flown.until_formed(40.0)
    check_stays(flown)
    assert sum(member.leads for member in flown.members.values()) == 1


def test_a_leader_returns_to_its_vertex_once_the_body_has_left():
    flown = with_body(LINE, 6, range_m=2.5)
    flown.body = None
    assert flown.until_formed(40.0)
    check_stays(flown)
    assert [member.place for member in flown.members.values() if member.leads] == [Place(0, 0)]


@pytest.mark.parametrize("name", ["figure-1a", "figure-1b", "three lines"])
def test_where_all_hear_all_the_first_leaders_are_those_of_the_assignment(name):
    """The nearest to each vertex would leave long ways to the others."""
    flown = team(MAPS[name], 12, seed=3)
    layout = flown.map.formation.layout(12)
    slots = [layout.slots[place].point for place in layout.places]
    peers = [Peer(k, member.at, None) for k, member in flown.members.items()]
    best = allocate(peers, layout.places, slots)
    flown.run(1.0)
    leaders = {k: member.place for k, member in flown.members.items() if member.leads}
    assert leaders == {k: place for k, place in best.items() if place in flown.map.vertex_of}
    assert flown.until_formed(30.0)


def test_a_vertex_whose_likely_leader_is_silent_gets_another_one():
    """All heard it at first, so the assignment gave it the vertex; then it falls silent."""
    flown = team(MAPS["figure-1b"], 9, seed=1)
    flown.run(0.25)
    far = min(flown.members.values(), key=lambda each: dist(each.at, (-5.0, 0.0, 0.0)))
    del flown.members[far.id]
    assert flown.until_formed(40.0)
    check_stays(flown)
