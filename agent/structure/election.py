"""Who leads a vertex: the nearest agent at first, the next of its queue when it falls silent.

Of several vertices the nearest agents would leave long ways to the others. There the assignment
over all agents finds the first leaders, where they hear each other.

A leader stands in the vertex, and is the root of its tree (Sec. 3.1). Where an unidentified vehicle
stands in the vertex, the leader leads from its own place in the queue (E18).
"""

from math import inf
from typing import Final

from agent.controller import Heard
from agent.messages import LeaderSummary, Place, RootKey
from agent.structure.claim import Claim
from agent.structure.direct_rule import DirectRule
from agent.structure.tree import Tree
from agent.structure.view import View, leads, queue_of

ALONE_S: Final = 1.5
"""Who hears no other agent listens so long before it leads: beacons may be on their way."""
NEAREST, ASSIGNED = 2.0, 3.0
"""Where there are several vertices the nearest leads only after so many times as long, and the
assignment is asked for so many times as long."""
MAX_COST_CM = 2**31 - 1
TURN_S, TURN_LATENCIES, TURN_STEP_S = 1.3, 4.0, 0.5
"""How much longer agents of other queues wait for a shared vertex than those of the queue that has
members to spare."""


class Election:
    """One agent's part in elections."""

    def __init__(self, own_id: int, started_s: float) -> None:
        self._own_id = own_id
        self._started_s = started_s
        self.key: RootKey | None = None
        """The own key while the agent leads."""
        self._last: dict[int, LeaderSummary] = {}
        """The last summary of each vertex."""

    def note(self, view: View) -> None:
        """Remember the leaders' summaries, for the succession."""
        for v, summary in enumerate(view.summaries):
            if summary is not None:
                self._last[v] = summary

    def stand(
        self,
        view: View,
        claim: Claim,
        trees: list[Tree],
        direct: DirectRule | None = None,
        likely: Place | None = None,
    ) -> bool:
        """Take the lead of a vertex that has no leader; return whether it did.

        direct: given where it applies; then the assignment finds the successor. likely: the place
        that the assignment over all neighbours gives at first, where there are several vertices.
        """
        since_s = view.now_s - self._started_s
        if likely is not None and since_s < ASSIGNED * view.timing.listen_s:
            return self._stand_as_assigned(view, claim, trees, likely)
        for v in view.map.vertices_of[claim.queue]:
            if (
                trees[v].root is None
                and not self._is_led(view, v)
                and not view.is_spare(v)
                and self._is_next(view, claim, trees[v], v, direct)
            ):
                self.lead(view, claim, trees[v], v)
                return True
        return False

    def _stand_as_assigned(
        self, view: View, claim: Claim, trees: list[Tree], likely: Place
    ) -> bool:
        """Take the lead of a vertex without a leader that is the own likely place.

        It may be of another queue: so a vertex that nobody starts near is not left to the last.
        """
        v = view.map.vertex_of.get(likely)
        listened = view.now_s - self._started_s >= view.timing.listen_s
        if v is None or not listened or trees[v].root is not None or self._is_led(view, v):
            return False
        claim.give_up(likely.queue, view.now_s)
        self.lead(view, claim, trees[v], v)
        return True

    def _is_led(self, view: View, vertex: int) -> bool:
        return any(h.standing is not None and h.standing.leads == vertex for h in view.heard)

    def _is_next(
        self, view: View, claim: Claim, tree: Tree, vertex: int, direct: DirectRule | None
    ) -> bool:
        now_s, timing = view.now_s, view.timing
        silent_s = now_s - tree.advanced_s
        if (
            direct is not None
            and claim.ranked
            and silent_s > timing.lost_s
            and direct.succeeds(view, claim, vertex)
        ):
            return True
        if claim.number < 1:
            listen_s = timing.listen_s if view.heard else ALONE_S
            if view.map.vertices > 1:
                listen_s *= NEAREST  # first those to whom the assignment gives a vertex
            ordered = claim.since_s > self._started_s + listen_s
            # An agent that was ordered here waits for others that were ordered at the same time.
            began_s = claim.since_s if ordered else self._started_s
            return now_s - began_s >= listen_s and self._is_nearest(view, vertex)
        wait_s = timing.lost_s + self._turn_s(view, claim, vertex)
        if direct is not None:
            wait_s += TURN_S + TURN_LATENCIES * timing.latency_s
        return silent_s > wait_s and self._is_first(view, claim, vertex)

    def _is_nearest(self, view: View, vertex: int) -> bool:
        """Whether no agent heard is nearer to the vertex and may lead it."""
        own = (view.to_vertex(vertex), self._own_id)
        early = view.now_s - self._started_s < ALONE_S
        return all(
            (view.to_vertex(vertex, other.position), other.id) > own
            for other in (view.around if early else view.heard)
            if self._may_lead(view, other, vertex)
        )

    def _may_lead(self, view: View, other: Heard, vertex: int) -> bool:
        """Whether another agent may lead; one that flies an older mission, once it has this one."""
        if other.mission != view.mission:
            return other.mission < view.mission
        queue = queue_of(other)
        may = not 0 <= queue < view.map.queues or vertex in view.map.vertices_of[queue]
        return may and not leads(other)

    def _is_first(self, view: View, claim: Claim, vertex: int) -> bool:
        """Whether no member heard of the own queue stands nearer to the vertex."""
        own = self._along(view, claim.queue, claim.number, vertex)
        return all(
            self._along(view, claim.queue, view.number_of(other), vertex) >= own
            for other in view.same_queue(claim.queue)
            if view.number_of(other) > 0 and not leads(other)
        )

    def _along(self, view: View, queue: int, number: int, vertex: int) -> float:
        if not view.map.closed[queue]:
            return number
        point = view.point(queue, number)
        return view.to_vertex(vertex, point) if point is not None else inf

    def _turn_s(self, view: View, claim: Claim, vertex: int) -> float:
        """Return how much longer than others the own queue waits [s]."""
        last = self._last.get(vertex)
        if last is None or not view.map.is_common(vertex):
            return 0.0
        homed = view.map.homed[vertex]
        if claim.queue not in homed or len(last.counts) != len(homed):
            return TURN_S + TURN_LATENCIES * view.timing.latency_s + TURN_STEP_S * len(homed)
        counts = dict(zip(homed, last.counts, strict=True))
        shares = view.map.members(max(last.total - 1, 0), view.blocked)
        spare = [j for j in homed if counts[j] > shares[j]] or homed
        if claim.queue == spare[0]:
            return 0.0
        behind = TURN_STEP_S * homed.index(claim.queue)
        return TURN_S + TURN_LATENCIES * view.timing.latency_s + behind

    def lead(self, view: View, claim: Claim, tree: Tree, vertex: int) -> None:
        """Take the lead of a vertex."""
        cost_m = view.to_vertex(vertex)
        in_queue = view.map.vertex_places[vertex] in view.blocked and claim.number > 0
        # Where teams meet again, the one that stands in the vertex stays the leader.
        cost_cm = MAX_COST_CM if in_queue else min(round(100.0 * cost_m), MAX_COST_CM - 1)
        self.key = RootKey(cost_cm, self._own_id)
        tree.take_root(self.key, view.now_s)
        if in_queue:
            claim.vertex = vertex
        else:
            claim.lead(vertex, cost_m, view.now_s)
