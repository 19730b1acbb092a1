"""Hostile controllers: each tries in its own way to make vehicles touch, or fly into obstacles.

They know nothing but their senses. The safety filter after them must keep I1 all the same.
"""

from math import atan2, dist, hypot, pi
from random import Random

from msgspec.structs import replace

from agent.config import AgentSetup
from agent.controller import Intent, Senses
from agent.guidance.q_structure import QStructure
from agent.messages import ZERO, Vector
from tests.random_flights.lies import Lies

RECALL_S = 5.0
"""So long a hostile remembers what it saw last."""


class Hostile:
    """Flies at full speed where ``aim`` points; a zero vector stands."""

    excess = 1.0
    """Wanted speed over the vehicle's greatest."""

    def __init__(self, setup: AgentSetup) -> None:
        self.id = setup.id
        self.tick_s = 1.0 / setup.tick_hz
        self.speed = setup.vehicle.max_speed_mps
        self.random = Random(setup.id)
        self._last = ZERO
        self._last_s = -RECALL_S

    def aim(self, senses: Senses) -> Vector:
        """Return where to fly, relative to the own centre [m; world axes]."""
        raise NotImplementedError

    def yaw(self, senses: Senses, velocity: Vector) -> float:
        """Return the heading to turn to [rad]."""
        return atan2(velocity[1], velocity[0]) if velocity != ZERO else senses.yaw

    def decide(self, senses: Senses) -> Intent:
        velocity = scaled(self.aim(senses), self.excess * self.speed)
        yaw = self.yaw(senses, velocity)
        return Intent(velocity, velocity, yaw, 0.0, added(senses.position, velocity))

    def prey(self, senses: Senses) -> Vector:
        """Return the nearest vehicle that is seen, heard, known or remembered; else the origin."""
        found = others(senses, self.id)
        if found:
            nearest = min(found, key=lambda v: hypot(*v))
            self._last, self._last_s = added(senses.position, nearest), senses.now_s
            return nearest
        recent = senses.now_s - self._last_s < RECALL_S
        return away_from(self._last if recent else ZERO, senses.position)


def others(senses: Senses, own: int) -> list[Vector]:
    """Return other vehicles, relative: those seen, or those heard, or those known by gossip."""
    if senses.vehicles:
        return list(senses.vehicles)
    places = [each.position for each in senses.neighbours] + list(senses.silent)
    places = places or [each.position for each in senses.team() if each.id != own]
    return [away_from(place, senses.position) for place in places]


class Chase(Hostile):
    """At the nearest vehicle."""

    def aim(self, senses: Senses) -> Vector:
        return self.prey(senses)


class Overspeed(Chase):
    """At the nearest vehicle, and asks for ten times the speed that there is."""

    excess = 10.0


class Spiral(Hostile):
    """Round the nearest vehicle, and a little nearer all the time."""

    def aim(self, senses: Senses) -> Vector:
        return circled(self.prey(senses), 1.0, 0.3)


class Orbit(Hostile):
    """Round the nearest vehicle, half of them one way and half the other, barely nearer."""

    def aim(self, senses: Senses) -> Vector:
        return circled(self.prey(senses), 1.0 if self.id % 2 else -1.0, 0.05)


class Jitter(Hostile):
    """At the nearest vehicle in most steps, anywhere in the others."""

    def aim(self, senses: Senses) -> Vector:
        if self.random.random() < 0.4:
            return anywhere(self.random)
        return self.prey(senses)


class Crush(Hostile):
    """All to one point: the middle of the vehicles that are known."""

    def aim(self, senses: Senses) -> Vector:
        known = [ZERO, *others(senses, self.id)]
        return tuple(sum(axis) / len(known) for axis in zip(*known, strict=True))  # type: ignore[return-value]


class Origin(Hostile):
    """All to the origin of the world."""

    def aim(self, senses: Senses) -> Vector:
        return away_from(ZERO, senses.position)


class HeadOn(Hostile):
    """In pairs, each at its partner, wherever it was last heard."""

    def partner(self) -> int:
        return self.id ^ 1

    def aim(self, senses: Senses) -> Vector:
        known = {each.id: each.position for each in (*senses.team(), *senses.neighbours)}
        place = known.get(self.partner())
        return self.prey(senses) if place is None else away_from(place, senses.position)


class Tail(HeadOn):
    """Each behind the one before it."""

    def partner(self) -> int:
        return self.id - 1


class Pincer(HeadOn):
    """All at the first, who flees."""

    def partner(self) -> int:
        return 0

    def aim(self, senses: Senses) -> Vector:
        if self.id:
            return super().aim(senses)
        return scaled(self.prey(senses), -1.0)


class Leap(Hostile):
    """Stands while it sees or hears others; leaps at them when it does not."""

    def aim(self, senses: Senses) -> Vector:
        if senses.vehicles or senses.neighbours:
            self.prey(senses)
            return ZERO
        return self.prey(senses)


class Oscillate(Hostile):
    """To and fro with the tick, each in its own time; more to than fro."""

    def aim(self, senses: Senses) -> Vector:
        ticks = round(senses.now_s / self.tick_s)
        side = 1.0 if ticks // (1 + self.id % 7) % 2 else -0.5
        return tuple(side * each for each in self.prey(senses))  # type: ignore[return-value]


class Dash(Hostile):
    """Obeys for some seconds, and then dashes; again and again."""

    def aim(self, senses: Senses) -> Vector:
        obeys = (senses.now_s + self.id) % 6.0 < 3.0
        return ZERO if obeys else self.prey(senses)


class Ram(Hostile):
    """At the nearest point of an obstacle; without one, round in ever wider circles to find one."""

    def aim(self, senses: Senses) -> Vector:
        if senses.obstacles:
            nearest = min(senses.obstacles, key=lambda v: hypot(*v))
            self._last, self._last_s = added(senses.position, nearest), senses.now_s
            return nearest
        if senses.now_s - self._last_s < RECALL_S:
            return away_from(self._last, senses.position)
        x, y, z = senses.position
        return (x - 2.0 * y + 0.1, y + 2.0 * x + 0.1 * self.id, -0.2 * z)


class Graze(Ram):
    """Along the nearest surface, as close as it can."""

    def aim(self, senses: Senses) -> Vector:
        side = 1.0 if self.id % 2 else -1.0
        return circled(super().aim(senses), side, 0.3)


class Hide(Ram):
    """Behind an obstacle for some seconds, and then out at the nearest vehicle."""

    def aim(self, senses: Senses) -> Vector:
        if (senses.now_s + self.id) % 8.0 < 5.0:
            return circled(super().aim(senses), 1.0, 0.5)
        return self.prey(senses)


class Dive(Hostile):
    """From above or below at the nearest vehicle, straight up or down when it is over it."""

    def aim(self, senses: Senses) -> Vector:
        x, y, z = self.prey(senses)
        over = hypot(x, y) < 0.3 * abs(z)
        return (x, y, z) if over else (x, y, z + (1.5 if self.id % 2 else -1.5))


class Sideslip(Chase):
    """At the nearest vehicle, while the nose turns round and round."""

    def yaw(self, senses: Senses, velocity: Vector) -> float:
        return (senses.now_s * (2.0 + self.id) + pi) % (2.0 * pi) - pi


class Still(Hostile):
    """Stands in the way."""

    def aim(self, senses: Senses) -> Vector:
        return ZERO


class Liar(Hostile):
    """Flies the Q-structure, but every third says of itself and of others what comes to its mind.

    The honest ones believe it within bounds; it flies where its own lies lead it.
    """

    def __init__(self, setup: AgentSetup) -> None:
        super().__init__(setup)
        self._honest = QStructure(setup)
        self._lies = Lies(setup.id) if setup.id % 3 == 0 else None

    def decide(self, senses: Senses) -> Intent:
        intent = self._honest.decide(senses)
        if self._lies is None:
            return intent
        return replace(
            intent,
            place=self._lies.place(senses),
            cost_m=self.random.choice((0.0, 1.0, 1e6)),
            words=self._lies.words(senses),
        )


KINDS: tuple[type[Hostile], ...] = (
    Chase,
    Spiral,
    Jitter,
    Ram,
    Crush,
    HeadOn,
    Orbit,
    Dash,
    Graze,
    Oscillate,
    Dive,
    Leap,
    Hide,
    Pincer,
    Tail,
    Overspeed,
    Sideslip,
    Origin,
    Still,
    Liar,
)


class Mixed:
    """Each agent is of a kind of its own, and now and then it takes up another."""

    LASTS_S = 7.0

    def __init__(self, setup: AgentSetup) -> None:
        self._id = setup.id
        self._kinds = [kind(setup) for kind in KINDS]

    def decide(self, senses: Senses) -> Intent:
        turn = int(senses.now_s / self.LASTS_S)
        return self._kinds[(5 * self._id + 7 * turn) % len(self._kinds)].decide(senses)


def away_from(place: Vector, position: Vector) -> Vector:
    return (place[0] - position[0], place[1] - position[1], place[2] - position[2])


def added(place: Vector, way: Vector) -> Vector:
    return (place[0] + way[0], place[1] + way[1], place[2] + way[2])


def scaled(way: Vector, length: float) -> Vector:
    """Return a vector of that length; a tiny one is zero."""
    r = dist(way, ZERO)
    if r < 1e-9:
        return ZERO
    return (length * way[0] / r, length * way[1] / r, length * way[2] / r)


def circled(towards: Vector, side: float, closing: float) -> Vector:
    """Return a vector across ``towards``, with a share of it."""
    x, y, z = scaled(towards, 1.0)
    return (closing * x - side * y, closing * y + side * x, closing * z)


def anywhere(random: Random) -> Vector:
    return (random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1))
