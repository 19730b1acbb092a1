"""The earlier Q-structure: trenches draw agents to queues, and the main queue vertex holds them.

Sources: S. S. Ge, C.-H. Fua, "Queues and artificial potential trenches for multirobot formations",
IEEE Trans. Robotics 21 (2005); C.-H. Fua, S. S. Ge, K. D. Do, K. W. Lim, "Multi-robot formations
based on the queue-formation scheme with limited communications", the same 23 (2007). The paper's
[32, 37], by what it says of them.

Agents belong to queues, not to points. Each falls into the potential trench along its queue, slides
towards the vertex, and is repelled by the member ahead of it. Queues take members by capacity. Each
agent must keep in touch with the agent at the main queue vertex, besides those of its own queue
around it: one link more than the adaptive Q-structure (``links_needed``).

Our choices, where the paper is silent:

- The main queue vertex is the first place of the layout. The nearest agent takes it when nobody is
  heard to hold it; of two holders the nearer stays, within NEARER_M the lower id.
- An agent that does not hear the vertex agent flies towards the vertex until it does, and claims no
  place meanwhile. So a queue cannot be longer than the radio's range.
- The trench is as steep as any approach here, and slopes towards the vertex by SLOPE_MPS. Only the
  member ahead repels, below d_ir of arc length; members settle SLOPE_MPS / REPULSION_HZ too near.
- An agent joins the nearest queue. The vertex agent counts the members of each queue and tells the
  counts (``queue_counts``). The last member of a queue leaves it for another one that would then
  still be emptier for its capacity, each agent at a time of its own.
- On a closed queue members stand too near to its first vertex.
"""

from math import dist, hypot, inf
from typing import Final

from agent.config import AgentSetup
from agent.controller import NO_WORDS, Flown, Heard, Intent, Senses, Words
from agent.messages import Place, Vector
from agent.qstructure.formation import Formation
from agent.schemes.approach import GAIN, Approach, towards
from agent.schemes.links import NOBODY, Situation
from agent.schemes.queue_counts import counts_heard, counts_told
from agent.schemes.queue_points import end_m, nearest, point

LISTEN_S: Final = 1.0
"""For so long an agent listens for others before it claims a place."""
NEARER_M: Final = 0.05
SLOPE_MPS: Final = 0.15
REPULSION_HZ: Final = 8.0
"""Speed away from the member ahead for each metre below d_ir [1/s]."""
ABREAST_M: Final = 0.05
"""Of two members whose arc lengths differ by less, the lower id goes ahead."""
TELL_S: Final = 0.25
"""Period in which the vertex agent tells the counts."""
COUNTS_S: Final = 1.0
"""Counts that are older do not count."""
TURN_S: Final = 0.5
"""How long it is each agent's turn to leave its queue; about as long as until the others know."""
TURNS: Final = 10


class FormerQStructure:
    """Flies one agent into a trench of its formation."""

    def __init__(self, setup: AgentSetup) -> None:
        self._id = setup.id
        self._spacing = setup.control.spacing_m
        self._approach = Approach(setup)
        self._key, self._since_s = NOBODY, 0.0
        self._holds_vertex = False
        self._queue = NOBODY
        self._s: dict[tuple[int, int], float] = {}
        """Where on a queue an agent was last [m]."""
        self._tells_s = -inf
        self._counts: list[int] = []
        """The members of each queue by the vertex agent's last word."""
        self._counts_s = -inf
        self._turn = NOBODY
        """The last turn in which it left its queue."""

    def decide(self, senses: Senses) -> Intent:
        """Return the intent; without a mission an agent hovers."""
        mission = senses.mission
        if mission is None:
            return self._approach.hover(senses)
        if mission.key != self._key:
            self._key, self._since_s = mission.key, senses.now_s
            self._holds_vertex, self._queue = False, NOBODY
            self._s, self._counts_s = {}, -inf
        others = [each for each in senses.neighbours if each.mission == mission.key]
        layout = mission.formation.layout(1 + len(others))
        main = layout.places[0]
        vertex = mission.frame.to_world(layout.slots[main].point)
        if senses.now_s - self._since_s < LISTEN_S:
            return self._approach.hover(senses)
        in_touch = self._elect(senses.position, vertex, main, others)
        if self._holds_vertex:
            self._queue = NOBODY
            velocity = towards(senses.position, vertex, mission.frame.velocity_at(vertex))
            words = self._counted(senses.now_s, mission, others, main)
            return self._approach.fly(senses, velocity, vertex, main, words)
        if not in_touch:
            self._queue = NOBODY
            return self._approach.fly(senses, towards(senses.position, vertex), vertex, None)
        return self._follow_trench(senses, mission, others, main)

    def _elect(self, q: Vector, vertex: Vector, main: Place, others: list[Heard]) -> bool:
        """Take or leave the main queue vertex; return whether its holder is heard."""
        own_m = dist(q, vertex)
        rivals = [each for each in others if each.place == main]
        if self._holds_vertex:
            for rival in rivals:
                nearer_m = own_m - dist(rival.position, vertex)
                if nearer_m > NEARER_M or (nearer_m >= -NEARER_M and rival.id < self._id):
                    self._holds_vertex = False
        elif not rivals:
            self._holds_vertex = all(
                (own_m, self._id) < (dist(each.position, vertex), each.id) for each in others
            )
        return bool(rivals)

    def _follow_trench(
        self, senses: Senses, mission: Flown, others: list[Heard], main: Place
    ) -> Intent:
        formation, frame = mission.formation, mission.frame
        self._choose_queue(senses, mission, others, main)
        j = self._queue
        queue = formation.queues[j]
        own = self._arc_length(mission, j, self._id, senses.position, len(others))
        begins = j in formation.queues_of(main)  # the vertex agent stands at its first vertex
        ahead = [0.0] if begins else []
        rank = len(ahead)
        for other in others:
            if other.place is None or other.place == main or other.place.queue != j:
                continue
            s = self._arc_length(mission, j, other.id, other.position, len(others))
            if s < own - ABREAST_M or (s < own + ABREAST_M and other.id < self._id):
                ahead.append(min(s, own))
                rank += 1
        here, there = point(queue, own), point(queue, own + ABREAST_M)
        bottom = frame.to_world(here)
        x, y, z = towards(senses.position, bottom, frame.velocity_at(bottom))
        along = sliding_mps(own, max(ahead, default=None), self._spacing)
        u, v, w = _direction(frame.to_world(there), bottom)
        velocity = (x + along * u, y + along * v, z + along * w)
        slot = formation.slot(Place(j, rank), 1 + len(others))
        target = frame.to_world(slot.point) if slot is not None else bottom
        place = Place(j, rank) if slot is not None else None
        return self._approach.fly(senses, velocity, target, place)

    def _counted(self, now_s: float, mission: Flown, others: list[Heard], main: Place) -> Words:
        """Return the vertex agent's words: the counts, where they are due."""
        if now_s < self._tells_s + TELL_S - 1e-9:
            return NO_WORDS
        self._tells_s = now_s
        claims = [each.place for each in others if each.place is not None and each.place != main]
        queues = range(len(mission.formation.queues))
        counts = [sum(each.queue == j for each in claims) for j in queues]
        if len(mission.formation.queues_of(main)) == 1:
            counts[main.queue] += 1  # no other queue begins at its vertex
        return Words(summary=counts_told(mission.key, self._id, now_s, counts))

    def _choose_queue(
        self, senses: Senses, mission: Flown, others: list[Heard], main: Place
    ) -> None:
        formation, n = mission.formation, len(others)
        if self._queue == NOBODY:
            p = mission.frame.to_frame(senses.position)
            away = [
                (dist(point(formation.queues[j], self._arc_length_of(formation, j, p, n)), p), j)
                for j, capacity in enumerate(formation.capacities)
                if capacity > 0.0
            ]
            self._queue = min(away)[1]
        self._hear_counts(senses, mission, others, main)
        turn = int(senses.now_s / TURN_S)
        late = senses.now_s > self._counts_s + COUNTS_S
        if turn % TURNS != self._id % TURNS or turn == self._turn or late:
            return
        if self._counts[self._queue] > 0 and self._is_last(senses, mission, others, main):
            best = emptier_queue(self._queue, self._counts, formation.capacities)
            if best != self._queue:
                self._queue, self._turn = best, turn

    def _hear_counts(
        self, senses: Senses, mission: Flown, others: list[Heard], main: Place
    ) -> None:
        holders = [each.id for each in others if each.place == main]
        for heard in senses.summaries:
            if heard.sender in holders and heard.stamp_s > self._counts_s:
                counts = counts_heard(heard, mission.key, len(mission.formation.queues))
                if counts is not None:
                    self._counts, self._counts_s = counts, heard.stamp_s

    def _is_last(self, senses: Senses, mission: Flown, others: list[Heard], main: Place) -> bool:
        """Return whether no other member of the own queue is farther from its vertex."""
        n = len(others)
        own = self._arc_length(mission, self._queue, self._id, senses.position, n)
        for other in others:
            place = other.place
            if place is None or place == main or place.queue != self._queue:
                continue
            s = self._arc_length(mission, self._queue, other.id, other.position, n)
            if (s, other.id) > (own, self._id):
                return False
        return True

    def _arc_length(
        self, mission: Flown, queue: int, agent: int, position: Vector, others: int
    ) -> float:
        """Return where on a queue an agent is [m]."""
        p, key = mission.frame.to_frame(position), (queue, agent)
        s = self._arc_length_of(mission.formation, queue, p, others, self._s.get(key))
        self._s[key] = s
        return s

    def _arc_length_of(
        self, formation: Formation, queue: int, p: Vector, others: int, near: float | None = None
    ) -> float:
        curve = formation.queues[queue]
        return nearest(curve, p, end_m(curve, 1 + others, self._spacing), near)


def sliding_mps(own: float, ahead: float | None, spacing_m: float) -> float:
    """Return the speed along a trench, away from its vertex positive [m/s].

    own, ahead: arc lengths of a member and the one ahead of it, None for none [m].
    """
    if ahead is None:
        return -min(SLOPE_MPS, GAIN * own)
    return REPULSION_HZ * max(0.0, spacing_m - (own - ahead)) - SLOPE_MPS


def emptier_queue(own: int, counts: list[int], capacities: tuple[float, ...]) -> int:
    """Return the queue that the last member of a queue should be in, its own where it is best.

    Another one is better that stays emptier for its capacity with one more member than the own one
    is now; of equals, the one named first.
    """
    best = own
    least = (counts[own] / capacities[own] if capacities[own] > 0.0 else inf, own)
    for j, capacity in enumerate(capacities):
        if j != own and capacity > 0.0 and ((counts[j] + 1) / capacity, j) < least:
            best, least = j, ((counts[j] + 1) / capacity, j)
    return best


def links_needed(situation: Situation) -> frozenset[int]:
    """Return whom a member must hear: those of its queue around it, and the main vertex agent."""
    main = {situation.vertex_agent} - {NOBODY, situation.own}
    return situation.same_queue | main


def _direction(to: Vector, start: Vector) -> Vector:
    """Return the unit vector from one point to another; zero where they are one."""
    x, y, z = to[0] - start[0], to[1] - start[1], to[2] - start[2]
    length = hypot(x, y, z)
    return (x / length, y / length, z / length) if 0.0 < length < 1.0 else (0.0, 0.0, 0.0)
