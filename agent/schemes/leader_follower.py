"""The leader-follower graph: each agent follows one leader by distance and bearing.

Sources: A. K. Das et al., "A vision-based formation control framework", IEEE Trans. Robotics and
Automation 18 (2002), separation-bearing control; J. P. Desai, J. P. Ostrowski, V. Kumar, "Modeling
and control of formations of nonholonomic mobile robots", the same 17 (2001). The paper's [14, 15].

A directed graph is fixed before the flight. Its root flies to its own place in the target's frame.
Every other agent keeps a distance to its one leader, and a bearing from it, and knows nothing else
of the team. It needs one link, to that one agent: no other will do (``links_needed``).

Our choices, where the sources are silent or plane:

- Agent k holds place k of the layout of the team that the fleet started with. So the agent with the
  id 0 is the root. An agent that joins later has no place in the graph.
- The leader of a place is the one before it on its queue, by arc length; of a queue's first place
  it is the root.
- The bearing is counted in the target's frame, since beacons carry no heading, and in space it is a
  direction: the follower turns about its leader on a great circle while it closes the distance.
  So an agent that is on the wrong side flies round its leader, not through it.
- An agent that does not hear its leader hovers. The sources switch between graphs by hand; when an
  agent leaves, its place stays empty here.
"""

from math import acos, hypot
from typing import Final

from agent.config import AgentSetup
from agent.controller import Flown, Heard, Intent, Senses
from agent.messages import Place, Vector
from agent.qstructure.formation import Layout, Slot
from agent.schemes.approach import GAIN, Approach, towards
from agent.schemes.links import NOBODY, Situation

LEAST_SINE: Final = 1e-6
"""Below this sine of the angle between two directions, their plane is not known."""
LEAST_M: Final = 1e-6


class LeaderFollower:
    """Flies one agent behind its leader."""

    def __init__(self, setup: AgentSetup) -> None:
        self._id, self._team = setup.id, setup.team
        self._approach = Approach(setup)
        self._key = NOBODY
        self._slot: Slot | None = None
        self._place: Place | None = None
        self._leader = NOBODY
        self._offset: Vector = (0.0, 0.0, 0.0)
        """The own slot, seen from the leader's [m; target's frame]."""

    def decide(self, senses: Senses) -> Intent:
        """Return the intent; without a mission, a place or its leader an agent hovers."""
        mission = senses.mission
        if mission is None:
            return self._approach.hover(senses)
        if mission.key != self._key:
            self._take_node(mission)
        if self._slot is None:
            return self._approach.hover(senses)
        frame = mission.frame
        if self._leader == NOBODY:
            target = frame.to_world(self._slot.point)
            velocity = towards(senses.position, target, frame.velocity_at(target))
            return self._approach.fly(senses, velocity, target, self._place)
        leader = _heard(senses, self._leader)
        if leader is None:
            return self._approach.hover(senses)
        x, y, z = frame.to_world(self._offset)
        offset = (x - frame.origin[0], y - frame.origin[1], z - frame.origin[2])
        p, v = leader.position, leader.velocity
        q = senses.position
        u = separation_bearing((q[0] - p[0], q[1] - p[1], q[2] - p[2]), offset)
        turn = (-frame.yaw_rate * offset[1], frame.yaw_rate * offset[0])
        velocity = (v[0] + u[0] + turn[0], v[1] + u[1] + turn[1], v[2] + u[2])
        target = (p[0] + offset[0], p[1] + offset[1], p[2] + offset[2])
        return self._approach.fly(senses, velocity, target, self._place)

    def _take_node(self, mission: Flown) -> None:
        """Take the own node of a mission's graph."""
        layout = mission.formation.layout(self._team)
        self._key, self._slot, self._place, self._leader = mission.key, None, None, NOBODY
        if self._id >= len(layout.places):
            return
        self._place = layout.places[self._id]
        self._slot = layout.slots[self._place]
        self._leader = leader_of(layout, self._id)
        if self._leader != NOBODY:
            there = layout.slots[layout.places[self._leader]].point
            here = self._slot.point
            self._offset = (here[0] - there[0], here[1] - there[1], here[2] - there[2])


def separation_bearing(r: Vector, wanted: Vector) -> Vector:
    """Return a follower's velocity, seen from its leader [m/s].

    r: its position, seen from its leader [m]; wanted: where it should be [m]. Distance and bearing
    each tend to their value with the rate ``GAIN``, whatever the other does.
    """
    length, wanted_length = hypot(*r), hypot(*wanted)
    if length < LEAST_M or wanted_length < LEAST_M:
        return towards(r, wanted)
    x, y, z = r[0] / length, r[1] / length, r[2] / length
    d = (wanted[0] / wanted_length, wanted[1] / wanted_length, wanted[2] / wanted_length)
    cosine = max(-1.0, min(1.0, x * d[0] + y * d[1] + z * d[2]))
    side = (d[0] - cosine * x, d[1] - cosine * y, d[2] - cosine * z)
    sine = hypot(*side)
    closing = GAIN * (wanted_length - length)
    if sine < LEAST_SINE:
        if cosine > 0.0:
            return (closing * x, closing * y, closing * z)
        side, sine = _level_normal(x, y), 1.0
    turning = GAIN * length * acos(cosine) / sine
    return (
        closing * x + turning * side[0],
        closing * y + turning * side[1],
        closing * z + turning * side[2],
    )


def leader_of(layout: Layout, node: int) -> int:
    """Return whom the holder of a place follows, both as indices of places; NOBODY for the root."""
    if node == 0:
        return NOBODY
    place = layout.places[node]
    own_m = layout.slots[place].arc_length
    before = [
        (layout.slots[other].arc_length, index)
        for index, other in enumerate(layout.places)
        if other.queue == place.queue and layout.slots[other].arc_length < own_m
    ]
    return max(before)[1] if before else 0


def links_needed(situation: Situation) -> frozenset[int]:
    """Return whom a member must hear: its leader; the root needs nobody."""
    return frozenset({situation.leader} - {NOBODY})


def _level_normal(x: float, y: float) -> Vector:
    """Return a level unit vector across a direction, whose level part is (x, y)."""
    level = hypot(x, y)
    return (-y / level, x / level, 0.0) if level > LEAST_SINE else (1.0, 0.0, 0.0)


def _heard(senses: Senses, agent: int) -> Heard | None:
    for other in senses.neighbours:
        if other.id == agent:
            return other
    return None
