"""The virtual structure: all agents fit one rigid body, and each flies to its point of that body.

Sources: M. Tillerson, L. Breger, J. P. How, "Distributed coordination and control of formation
flying spacecraft", American Control Conference 2003: the body's place is fitted to the whole fleet.
W. Ren, R. W. Beard, "A decentralized scheme for spacecraft formation flying via the virtual
structure approach", J. Guidance, Control, and Dynamics 27 (2004): the body waits for those who are
off their points (formation feedback). The paper's [8, 7].

Each agent fits translation and yaw of the body to the positions of all members, lets the body go
on towards the target's frame, the slower the worse the fit, and flies to its own point. It needs
everybody: who misses one member fits another body (``links_needed``). Where agents relay records of
all members (``[control] allocation = "assignment"``), it uses records where it hears no beacon.

Our choices, where the sources are silent:

- The k-th of all known ids takes place k of the layout of so many. So a team that loses a member
  closes up, if each agent knows of all the others; else two may take one place.
- A least-squares fit with equal weights, and yaw as the only rotation. Where the members define no
  yaw, as in one point, the body has the frame's.
- Formation feedback halves the body's speed at FEEDBACK_M of deviation (root of the mean square).
"""

from math import atan2, hypot, remainder, sqrt, tau
from typing import Final, NamedTuple

from agent.config import AgentSetup
from agent.controller import Intent, Senses
from agent.guidance.movement import saturated
from agent.messages import Vector
from agent.qstructure.target_frame import Frame
from agent.schemes.approach import Approach, towards
from agent.schemes.links import Situation

BODY_GAIN: Final = 1.0
"""Speed of the body for each metre, and turn for each radian, that it is off its frame [1/s]."""
FEEDBACK_M: Final = 0.5
"""At this deviation of the members from the body, it goes on half as fast."""
BODY_SHARE: Final = 0.8
"""Share of a vehicle's speed that the body takes at most, at its outermost point; the rest is for
staying in it."""
LEAST_TURN_M2: Final = 1e-6
"""Below this moment of the members, their yaw is not known."""


class Body(NamedTuple):
    """A rigid body that fits some positions."""

    frame: Frame  # [m; world frame]
    deviation_m: float  # root of the mean square distance of the positions from their points


class VirtualStructure:
    """Flies one agent at its point of the team's body."""

    def __init__(self, setup: AgentSetup) -> None:
        self._id = setup.id
        self._approach = Approach(setup)
        vehicle = setup.vehicle
        self._body_mps = BODY_SHARE * min(vehicle.max_speed_mps, vehicle.max_climb_mps)

    def decide(self, senses: Senses) -> Intent:
        """Return the intent; without a mission or a place an agent hovers."""
        mission = senses.mission
        if mission is None:
            return self._approach.hover(senses)
        known = {peer.id: peer.position for peer in senses.team()}
        known.update((other.id, other.position) for other in senses.neighbours)
        known[self._id] = senses.position
        members = sorted(known)
        layout = mission.formation.layout(len(members))
        slots = [layout.slots[place].point for place in layout.places]
        own = members.index(self._id)
        if own >= len(slots):
            return self._approach.hover(senses)
        positions = [known[each] for each in members[: len(slots)]]
        body = fitted(slots, positions, mission.frame.yaw)
        radius_m = max(hypot(x, y) for x, y, _ in slots)
        moving = led(body, mission.frame, self._body_mps, radius_m)
        target = moving.to_world(slots[own])
        velocity = towards(senses.position, target, moving.velocity_at(target))
        return self._approach.fly(senses, velocity, target, layout.places[own])


def fitted(points: list[Vector], positions: list[Vector], else_yaw: float) -> Body:
    """Return the body whose points are nearest to positions, in the sense of least squares.

    points [m; body's frame] and positions [m; world frame], at least one, in the same order;
    else_yaw: the yaw where they define none [rad].
    """
    p, q = _mean(points), _mean(positions)
    along = across = 0.0
    for (a, b, _), (x, y, _) in zip(points, positions, strict=True):
        a, b, x, y = a - p[0], b - p[1], x - q[0], y - q[1]  # noqa: PLW2901
        along += a * x + b * y
        across += a * y - b * x
    yaw = atan2(across, along) if hypot(along, across) > LEAST_TURN_M2 else else_yaw
    turned = Frame(yaw=yaw).to_world(p)
    frame = Frame((q[0] - turned[0], q[1] - turned[1], q[2] - turned[2]), yaw)
    square = 0.0
    for point, position in zip(points, positions, strict=True):
        x, y, z = frame.to_world(point)
        square += (x - position[0]) ** 2 + (y - position[1]) ** 2 + (z - position[2]) ** 2
    return Body(frame, sqrt(square / len(points)))


def led(body: Body, to: Frame, most_mps: float, radius_m: float) -> Frame:
    """Return the body's frame with the velocity with which it goes on to the target's frame.

    most_mps: limit of the way, and of the turn at ``radius_m`` from the frame's origin [m/s].
    """
    frame = body.frame
    pace = BODY_GAIN / (1.0 + (body.deviation_m / FEEDBACK_M) ** 2)
    here, there = frame.origin, to.origin
    x, y, z = there[0] - here[0], there[1] - here[1], there[2] - here[2]
    u, v, w = saturated((pace * x, pace * y, pace * z), most_mps, most_mps)
    turn = pace * remainder(to.yaw - frame.yaw, tau)
    a, b, c = to.velocity
    most_rps = most_mps / radius_m if radius_m > 0.0 else abs(turn)
    rate = to.yaw_rate + max(-most_rps, min(most_rps, turn))
    return Frame(here, frame.yaw, (a + u, b + v, c + w), rate)


def links_needed(situation: Situation) -> frozenset[int]:
    """Return whom a member must hear: all others."""
    return situation.team - {situation.own}


def _mean(vectors: list[Vector]) -> Vector:
    x = y = z = 0.0
    for a, b, c in vectors:
        x, y, z = x + a, y + b, z + c
    n = len(vectors)
    return (x / n, y / n, z / n)
