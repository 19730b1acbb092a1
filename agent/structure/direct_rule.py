"""The direct rule: where the whole team hears the whole team, the assignment is over neighbours.

It is a team's rule, not an agent's own: an agent decides directly only if every member that it
hears also hears all. Otherwise agents of two minds take each other's places. Leaders stay. While a
vertex has no leader the rule does not apply, for the others may have to order somebody there.
"""

from collections import Counter
from math import dist, inf
from operator import attrgetter
from typing import Final

from agent.assignment.allocation import own_place
from agent.controller import Peer
from agent.messages import Place
from agent.qstructure.formation import Slot
from agent.structure.claim import Claim
from agent.structure.link_timing import Timing
from agent.structure.view import View

ENTER_S: Final = 0.4
"""How long the members heard must have been all, and the same."""
LEAVE_S: Final = 1.0
GUESS_AFTER_S, MOST_GUESSED = 0.05, 24
"""A guess is made once nobody new was heard for so long, among so many members at most."""
LEAST_HEARD_S: Final = 0.5
CHOICE_HZ: Final = 5.0


class DirectRule:
    """Whether one agent decides directly, and its choice. ``heard``: members heard, itself too."""

    def __init__(self, own_id: int, now_s: float) -> None:
        self._own_id = own_id
        self._ids: tuple[int, ...] = ()
        self._same_since_s = now_s
        self._full_since_s: float | None = None
        self._short_since_s = self._uneven_since_s = inf
        """Since when members or leaders are missing, and since when some hear fewer members [s]."""
        self._next_choice_s = now_s
        self.applies = False
        self._joins: bool | None = None
        """Whether the team was counted before the agent came; None until a leader is heard."""
        self.is_near = False
        """Whether all members are heard, so that the rule will apply if nothing changes."""
        self._awaited_since_s = inf
        """When an agent that joins first heard as many members as a leader counts [s]."""
        self.heard = 1
        self._guessed: tuple[int, ...] | None = None
        """Among which members the last guess was made."""
        self._guess: Place | None = None
        self._guessed_s = -inf
        self._around: tuple[int, ...] = ()
        self._around_since_s = now_s

    def update(self, view: View, claim: Claim) -> None:
        """Decide anew whether the rule applies."""
        timing, now_s = view.timing, view.now_s
        within_s = self._within_s(timing)
        members = [h for h in view.heard if h.age_s < within_s]
        ids = tuple([h.id for h in members])
        if ids != self._ids:
            self._ids, self._same_since_s = ids, now_s
        self.heard = len(ids) + 1
        short = view.total == 0 or self.heard < view.total or not _all_led(view)
        least = self.heard
        for h in members:
            if h.standing is not None:
                least = min(least, h.standing.heard)
        if self.applies:
            self._leave(view, short=short, uneven=least < self.heard)
        else:
            self._enter(not short and self.heard == view.total <= least, view, claim)
        awaits = self._awaits(view, short=short)
        self.is_near = not self.applies and (self._full_since_s is not None or awaits)

    def _awaits(self, view: View, *, short: bool) -> bool:
        """Whether an agent that joins a team waits until all others have heard it, too.

        If it took a place before, it would soon have another one under the rule.
        """
        timing, known = view.timing, any(each is not None for each in view.summaries)
        if self._joins is None and known:
            self._joins = view.latest is not None
        if self._joins and not short:
            self._awaited_since_s = min(self._awaited_since_s, view.now_s)
        waited_s = view.now_s - self._awaited_since_s
        return 0.0 <= waited_s < max(timing.resettle_s, timing.answer_s)

    def _within_s(self, timing: Timing) -> float:
        """Return how recently a member must have been heard to count [s]."""
        return max(LEAST_HEARD_S, 2.0 * (timing.parent_s - timing.latency_s)) + timing.latency_s

    def _leave(self, view: View, *, short: bool, uneven: bool) -> None:
        """End the rule. Members that nobody hears any more are lost soon: then it goes on."""
        self._short_since_s = _since(self._short_since_s, view.now_s, holds=short)
        self._uneven_since_s = _since(self._uneven_since_s, view.now_s, holds=uneven)
        short_s, uneven_s = view.now_s - self._short_since_s, view.now_s - self._uneven_since_s
        if short_s > LEAVE_S + view.timing.lost_s or uneven_s > view.timing.resettle_s:
            self.applies, self._full_since_s = False, None

    def _enter(self, full: bool, view: View, claim: Claim) -> None:
        if not full:
            self._full_since_s = None
            return
        if self._full_since_s is None:
            self._full_since_s = view.now_s
        # Before its first claim an agent counts the time since it last heard somebody new, so that
        # the first choice is direct already.
        since_s = self._full_since_s if claim.ranked else self._same_since_s
        if view.now_s - since_s > ENTER_S + view.timing.latency_s and not claim.swapping:
            self.applies = True
            self._short_since_s = self._uneven_since_s = inf
            claim.push_until_s = view.now_s

    def all_hear_the_same(self, view: View) -> bool:
        """Whether everyone heard hears as many members as the own agent."""
        return all(h.standing is None or h.standing.heard == self.heard for h in view.heard)

    def guess(self, view: View) -> Slot | None:
        """Return the slot of the likely place, so that the agent flies there at once."""
        place = self.likely(view)
        return view.map.formation.slot(place, len(view.around) + 1) if place is not None else None

    def likely(self, view: View) -> Place | None:
        """Return the place that the assignment over all neighbours gives, without claiming it.

        Where they are the whole team this is the place that the agent will take. None where a
        neighbour hears more, or where so many are heard that it takes too long. It lasts for as
        long as a member may be silent, and is made anew only once the same ones are heard.
        """
        if not 0 < len(view.around) <= MOST_GUESSED:
            return None
        ids = tuple([h.id for h in view.around])
        if ids != self._around:
            self._around, self._around_since_s = ids, view.now_s
        if any(h.standing is not None and h.standing.heard > len(ids) + 1 for h in view.around):
            return None
        settled = view.now_s - self._around_since_s >= GUESS_AFTER_S + view.timing.latency_s
        lasts = view.now_s - self._guessed_s <= view.timing.lost_s
        if settled and not (lasts and self._guessed == ids):
            self._guessed, self._guess = ids, self._likely_place(view)
            self._guessed_s, lasts = view.now_s, True
        return self._guess if lasts else None

    def _likely_place(self, view: View) -> Place | None:
        """Return the place that the own agent is likely to get.

        A single vertex is led by the nearest; where there are several, the nearest of each would
        leave long ways to the others, so the assignment gives them, too.
        """
        team = [Peer(self._own_id, view.here, None)]
        team += [Peer(h.id, h.position, None) for h in view.around]
        team.sort(key=attrgetter("id"))
        layout = view.map.formation.layout(len(team), view.blocked)
        places = list(layout.places)
        for place in view.map.vertex_places if view.map.vertices == 1 else ():
            if place not in layout.slots:
                continue
            point = view.frame.to_world(layout.slots[place].point)
            nearest = min(team, key=lambda peer: (dist(peer.position, point), peer.id))
            if nearest.id == self._own_id:
                return place
            team.remove(nearest)
            places.remove(place)
        points = [view.frame.to_world(layout.slots[place].point) for place in places]
        return own_place(self._own_id, team, places, points) if len(places) <= len(team) else None

    def choose(self, view: View, claim: Claim) -> None:
        """Take the place that the assignment over all members gives."""
        now_s = view.now_s
        if now_s < self._next_choice_s or not self._is_all(view):
            return
        self._next_choice_s = now_s + 1.0 / CHOICE_HZ - 1e-9
        if claim.number > 0 and now_s - claim.since_s < view.timing.hold_s:
            return
        place = self._assigned(view, claim, self.heard)
        if place is None:
            return
        if place not in view.map.vertex_of:
            self._take(view, claim, place)
        elif claim.number > 0:
            # It will take the lead of this vertex; the own number is another's already.
            claim.give_up(place.queue, now_s)

    def _is_all(self, view: View) -> bool:
        """Whether those heard are the team: as the leader says, or since the others are lost."""
        lost_s = view.timing.lost_s - self._within_s(view.timing)
        return self.heard == view.total or (
            view.now_s - self._same_since_s > lost_s and self.all_hear_the_same(view)
        )

    def succeeds(self, view: View, claim: Claim, vertex: int) -> bool:
        """Whether the assignment over all that are heard gives the own agent a vertex."""
        vertex_place = view.map.vertex_places[vertex]
        return self._assigned(view, claim, self.heard) == vertex_place

    def _assigned(self, view: View, claim: Claim, members: int) -> Place | None:
        """Return the own place among all members; None where there are too few of them."""
        layout = view.map.formation.layout(members, view.blocked | _left_vertices(view, claim))
        led = _led(view, claim)
        places = [place for place in layout.places if place not in led]
        team = self._team(view, claim, frozenset(layout.places))
        if view.gathering and _is_divided(view, team, places):
            held_place = next(peer.place for peer in team if peer.id == self._own_id)
            own = _group(view, held_place)
            places = [p for p in places if _group(view, p) == own]
            team = [peer for peer in team if _group(view, peer.place) == own]
        if len(places) > len(team):
            return None  # two lead one vertex: one of them will make way
        points = [view.frame.to_world(layout.slots[place].point) for place in places]
        return own_place(self._own_id, team, places, points)

    def _team(self, view: View, claim: Claim, available: frozenset[Place]) -> list[Peer]:
        """Return all members but the leaders of available vertices: the others stand in queues."""
        peers = [
            Peer(h.id, h.position, h.place, h.cost_m)
            for h in view.heard
            if h.standing is None or not _stands_in(view, h.standing.leads, available)
        ]
        if not _stands_in(view, claim.vertex, available):
            own = view.map.place(claim.queue, claim.number) if claim.number > 0 else None
            peers.append(Peer(self._own_id, view.here, own, claim.cost_m))
        return sorted(peers, key=attrgetter("id"))

    def _take(self, view: View, claim: Claim, place: Place) -> None:
        queue, number = place.queue, view.map.number(place)
        if (queue, number) != (claim.queue, claim.number):
            claim.take(queue, number, view.distance(queue, number), view.now_s)


def _led(view: View, claim: Claim) -> set[Place]:
    """Return the vertices that have a leader, whether it stands there or not."""
    vertices = {h.standing.leads for h in view.heard if h.standing is not None} | {claim.vertex}
    return {view.map.vertex_places[v] for v in vertices if 0 <= v < view.map.vertices}


def _left_vertices(view: View, claim: Claim) -> frozenset[Place]:
    """Return the vertices whose leaders stand in their queues (E18).

    A leader returns to a vertex that is free again only once it is sure of that. Until it says so,
    its number is its own.
    """
    left = [h.standing.leads for h in view.heard if h.standing and view.number_of(h) > 0]
    if claim.number > 0:
        left.append(claim.vertex)
    return frozenset([view.map.vertex_places[v] for v in left if 0 <= v < view.map.vertices])


def _stands_in(view: View, vertex: int, available: frozenset[Place]) -> bool:
    """Whether the leader of a vertex, -1 for none, has its place there."""
    return 0 <= vertex < view.map.vertices and view.map.vertex_places[vertex] in available


def _since(since_s: float, now_s: float, *, holds: bool) -> float:
    """Return since when something holds [s]; infinite where it does not."""
    return min(since_s, now_s) if holds else inf


def _is_divided(view: View, team: list[Peer], places: list[Place]) -> bool:
    """Whether each displaced queue has as many members as places.

    Then it keeps them, and they exchange places among themselves: compared with a place of another
    queue, they are not where their own one is.
    """
    held = Counter(_group(view, peer.place) for peer in team)
    asked = Counter(_group(view, place) for place in places)
    return all(held[queue] == asked[queue] for queue in view.gathering)


def _group(view: View, place: Place | None) -> int | None:
    """Return the queue of a place if it is displaced, None for all others."""
    return place.queue if place is not None and place.queue in view.gathering else None


def _all_led(view: View) -> bool:
    """Whether each vertex that somebody is to lead has a leader."""
    return not view.vacant
