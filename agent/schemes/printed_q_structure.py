"""The paper as it is printed: Algorithm 1 by distance order, literal equations, nothing mended.

Source: S. S. Ge, C.-H. Fua, K. W. Lim, "Agent formations in 3D spaces with communication
limitations using an adaptive Q-structure", Robotics and Autonomous Systems (2009): Algorithms 1, 2
and 4, equations (1)-(28). docs/method.md lists what is wrong with them, by the numbers used here.
It is the honest baseline: what a reader gets who types the paper in.

- Algorithm 1: distress, sub-vertices and targets, all from the distances of the moment. In every
  queue the first takes V_j, so four agents take the wedge's apex (E16). Targets follow the moving
  intermediate target of the one before, by chord (E13). Order changes with every crossing (E17).
- Algorithm 2: the bobber, at rest where (2)+(3) are least in the cast-zone (E7, E9, E10).
- (18)-(28): unit weight, (22) without offset (E1), two sides of (23) (E3), U' q_ij (E2).

It needs links to those of its own queue that it hears, and to no agent in particular
(``links_needed``).

Our choices, where the paper is silent:

- Agent k belongs to the queue of the k-th turn, round the queues by their shares of the whole team.
- A distressed agent hovers, and so does one for whom line 18 has no solution. An agent does not
  count as one of those that it hears (line 9).
- Algorithm 1 runs at 5 Hz. A bobber cycle ends within d_c1 of the bobber, or after CYCLE_S: two
  repelled agents may never get there (E1).
- Numbers that floats cannot hold are clipped (E5). The speed is saturated, and the vehicle turns
  first only for azimuth: Sec. 4 lets it move vertically. Constellation-agents are left out, since
  undisturbed ones push nobody; there is no escape from symmetry (E23).
"""

from math import dist, hypot, inf
from typing import Final, NamedTuple

from agent.config import AgentSetup
from agent.controller import Flown, Heard, Intent, Senses, Words
from agent.guidance.cone import cone_of
from agent.guidance.movement import saturated, steer
from agent.messages import (
    DISTRESS,
    MEMBER,
    SUB_VERTEX,
    VERTEX,
    Branch,
    Place,
    RootKey,
    Standing,
    Vector,
)
from agent.qstructure.formation import Formation
from agent.schemes.links import NOBODY, Situation
from agent.schemes.printed_equations import CastZone, bobber, omega
from agent.schemes.queue_points import end_m, on_sphere

GAIN: Final = 2.0
"""c of (28) [1/s]."""
CHOICE_S: Final = 0.2
CYCLE_S: Final = 1.0


class Links(NamedTuple):
    """What Algorithm 1, lines 1-11, makes of an agent."""

    role: int  # index of ROLES
    tier: int  # in the hierarchy of queue vertices, or below it; -1 in distress
    vertex: Heard | None  # r_vtx: the highest ranked vertex agent heard


class PrintedQStructure:
    """Flies one agent by the printed algorithms."""

    def __init__(self, setup: AgentSetup) -> None:
        self._id, self._team = setup.id, setup.team
        self._vehicle, self._control = setup.vehicle, setup.control
        self._cone = cone_of(setup.vehicle)
        self._near_m = setup.control.cast_near_m
        self._far_m = setup.control.cast_far_m or 0.5
        self._key, self._queue = NOBODY, NOBODY
        self._links = Links(DISTRESS, -1, None)
        self._place: Place | None = None
        self._toq: Vector | None = None
        """q_toq,i [m; target's frame]"""
        self._chosen_s = self._cycle_s = -inf
        self._q_tg: Vector | None = None
        """The intermediate target of this cycle [m; world frame]."""

    def decide(self, senses: Senses) -> Intent:
        """Return the intent: Algorithm 4; without a mission an agent hovers."""
        mission, q = senses.mission, senses.position
        if mission is None:
            return Intent((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), senses.yaw, 0.0, q)
        if mission.key != self._key:
            self._key, self._chosen_s = mission.key, -inf
            self._queue = queue_of(mission.formation, self._team, self._id)
        if senses.now_s - self._chosen_s >= CHOICE_S - 1e-9:
            self._chosen_s = senses.now_s
            self._choose_target(senses, mission)
        q_toq = mission.frame.to_world(self._toq) if self._toq is not None else q
        if self._q_tg is None or self._cycle_ends(senses):
            self._cycle_s = senses.now_s
            zone = CastZone(self._near_m, self._far_m, self._cone)
            self._q_tg = bobber(q, senses.yaw, q_toq, zone) if self._toq is not None else q
        x, y, z = omega(q, self._q_tg, senses.neighbours, self._control.separation_m)
        u = (-GAIN * x, -GAIN * y, -GAIN * z)
        wanted = saturated(u, self._vehicle.max_speed_mps, self._vehicle.max_climb_mps)
        velocity, yaw = steer(wanted, senses.yaw, self._cone)
        return Intent(
            wanted=wanted,
            velocity=velocity,
            yaw=yaw,
            force=min(hypot(*u), 1e9),
            heading_for=self._q_tg,
            target=q_toq if self._place is not None else None,
            place=self._place,
            vertex=self._links.role == VERTEX,
            words=self._words(mission, 1 + len(senses.neighbours)),
        )

    def _cycle_ends(self, senses: Senses) -> bool:
        reached = self._q_tg is not None and dist(senses.position, self._q_tg) <= self._near_m
        return reached or senses.now_s - self._cycle_s >= CYCLE_S

    def _choose_target(self, senses: Senses, mission: Flown) -> None:
        """Algorithm 1: the role in the queue, and q_toq,i with the place that it belongs to."""
        formation, frame, j = mission.formation, mission.frame, self._queue
        queue = formation.queues[j]
        first = frame.to_world(queue.point(0.0))
        heard = [
            each
            for each in senses.neighbours
            if each.mission == mission.key
            and each.standing is not None
            and each.standing.queue == j
        ]
        self._links = links = roles(senses.position, first, heard)
        if links.role == DISTRESS:
            self._toq, self._place = None, None
            return
        q_qv = links.vertex.position if links.vertex is not None else senses.position
        q = senses.position
        ahead = [each for each in heard if _is_nearer(each, q, q_qv, self._id)]
        rank = len(ahead)
        if rank == 0:
            self._toq = queue.point(0.0)
            self._place = formation.vertex_places[formation.first_vertex_of(j)]
            return
        k = max(ahead, key=lambda each: (dist(each.position, q_qv), each.id))
        until_m = end_m(queue, self._team, self._control.spacing_m)
        target_k, vertex = frame.to_frame(k.target), frame.to_frame(q_qv)
        points = [
            each
            for each in on_sphere(queue, target_k, self._control.spacing_m, until_m)
            if dist(each, vertex) > dist(target_k, vertex)
        ]
        self._toq = min(points, key=lambda each: dist(each, vertex)) if points else None
        place = Place(j, rank)
        self._place = place if formation.slot(place, self._team) is not None else None

    def _words(self, mission: Flown, heard: int) -> Words:
        """Return what others need for their Algorithm 1: queue, tier and distress."""
        names = list(mission.formation.vertices)
        vertex = names.index(mission.formation.first_vertex_of(self._queue))
        links = self._links
        branches: list[Branch | None] = [None] * len(names)
        parent = links.vertex.id if links.vertex is not None else -1
        if links.role != DISTRESS:
            branches[vertex] = Branch(RootKey(0, self._id), 0, links.tier, parent)
        leads = vertex if links.role in (VERTEX, SUB_VERTEX) else -1
        standing = Standing(tuple(branches), leads, self._queue, heard, False, None, None, 1)
        return Words(standing, None, links.tier, parent, links.role)


def queue_of(formation: Formation, team: int, agent: int) -> int:
    """Return an agent's queue: the team divides by capacities, as if no vertex were shared."""
    shares = [capacity * team for capacity in formation.capacities]
    counts = [int(share + 1e-9) for share in shares]
    while sum(counts) < team:
        lacking = [share - count for share, count in zip(shares, counts, strict=True)]
        counts[lacking.index(max(lacking))] += 1
    turns = [(rank, j) for j, count in enumerate(counts) for rank in range(count)]
    return sorted(turns)[agent % max(team, 1)][1] if turns else 0


def roles(q: Vector, first: Vector, heard: list[Heard]) -> Links:
    """Return what lines 1-11 make of an agent at q among those of its queue that it hears.

    q, first: position and the queue's first vertex [m; world frame]. The nearest to the vertex is
    the queue-vertex agent.
    """
    own_m = dist(q, first)
    if all(own_m < dist(each.position, first) for each in heard):
        return Links(VERTEX, 0, None)
    ranked = [(_tier(each), each.id, each) for each in heard if _leads(each)]
    if not ranked:
        return Links(DISTRESS, -1, None)
    tier, _, vertex = min(ranked, key=lambda each: each[:2])
    from_vertex_m = dist(q, vertex.position)
    farther = [each for each in heard if dist(each.position, vertex.position) >= from_vertex_m]
    promoted = all(_tier(each) < 0 for each in farther)
    return Links(SUB_VERTEX if promoted else MEMBER, tier + 1, vertex)


def links_needed(situation: Situation) -> frozenset[int]:
    """Return whom a member must hear: those of its queue around it, N_c,i."""
    return situation.same_queue


def _is_nearer(other: Heard, q: Vector, q_qv: Vector, own_id: int) -> bool:
    """Whether another agent comes before the own one in the list of line 12."""
    return (dist(other.position, q_qv), other.id) < (dist(q, q_qv), own_id)


def _leads(other: Heard) -> bool:
    return other.standing is not None and other.standing.leads >= 0


def _tier(other: Heard) -> int:
    """Return the tier that an agent states, -1 in distress."""
    if other.standing is None:
        return -1
    for branch in other.standing.branches:
        if branch is not None:
            return branch.tier
    return -1
