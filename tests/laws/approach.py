"""Laws of the way to the target-on-queue: Lemma 9, the bobber's cast, and what needs no turn."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, dist, hypot, pi, radians, sin
from random import Random

from agent.guidance import bobber as bobber_room
from agent.guidance import movement
from agent.guidance.cone import Cone, azimuth_error
from agent.messages import Vector
from tests.laws.energy import random_point

GAIN = 2.0


@dataclass(frozen=True)
class Craft:
    """A vehicle of perfect obedience: its cone [rad], reach [m], speeds [m/s] and [rad/s]."""

    cone: Cone
    reach: float
    speed: float
    climb: float
    yaw_rate: float
    dt: float

    @property
    def zone(self):
        return bobber_room.cast_zone(self.cone, self.reach, self.speed, self.yaw_rate)


PAPERS = Craft(Cone(radians(45), radians(45)), 0.5, 0.5, 0.5, pi, 0.05)


def random_craft(random: Random) -> Craft:
    """Return a craft of any kind, its sides alike or not."""
    return Craft(
        Cone(radians(random.uniform(10, 90)), radians(random.uniform(10, 90))),
        random.uniform(0.1, 2.0),
        random.uniform(0.2, 3.0),
        random.uniform(0.1, 3.0),
        radians(random.uniform(45, 360)),
        random.uniform(0.02, 0.1),
    )


def cycles(craft: Craft, yaw: float, target: Vector) -> Iterator[tuple[Vector, float, Vector]]:
    """Fly from the origin, a cycle a step (E12); yield place, heading and bobber of each."""
    q: Vector = (0.0, 0.0, 0.0)
    zone = craft.zone
    while True:
        q_ba = bobber_room.bobber(q, yaw, target, zone)
        yield q, yaw, q_ba
        u = tuple(GAIN * (b - a) for a, b in zip(q, q_ba, strict=True))
        wanted = movement.saturated(u, craft.speed, craft.climb)
        velocity, heading = movement.steer(wanted, yaw, craft.cone)
        q = tuple(a + craft.dt * v for a, v in zip(q, velocity, strict=True))
        turn = azimuth_error(cos(heading), sin(heading), yaw)
        most = craft.yaw_rate * craft.dt
        yaw += max(-most, min(most, turn))


def off(q: Vector, yaw: float, target: Vector) -> tuple[float, float]:
    """Return the distance to a target [m], and its azimuth from the heading, unsigned [rad]."""
    return dist(q, target), abs(azimuth_error(target[0] - q[0], target[1] - q[1], yaw))


def every_cycle_comes_nearer_or_turns() -> None:
    """Lemma 9 in its true form, E11: each cycle the distance or the azimuth error falls."""
    random = Random(9)
    for trial in range(400):
        craft, target = random_craft(random), random_point(random, 3.0)
        before = None
        for steps, (q, yaw, _) in enumerate(cycles(craft, random.uniform(-pi, pi), target)):
            now = off(q, yaw, target)
            if now[0] < 1e-3:
                break
            assert before is None or now[0] < before[0] or now[1] < before[1], (trial, before, now)
            assert steps < 20_000, f"trial {trial}: {now[0]} m away for ever"
            before = now


def cycles_reach_the_target() -> None:
    """E7, E9, E11: from any pose the bobber's cycles end at the target, and within 40 s."""
    random = Random(7)
    for _ in range(300):
        target = random_point(random, 3.0)
        flown = cycles(PAPERS, random.uniform(-pi, pi), target)
        q, _, _ = next(flown)
        for _ in range(800):
            q, _, _ = next(flown)
        assert dist(q, target) < 1e-3, f"target {target}, still {dist(q, target):.3f} m away"


def the_cast_does_not_shrink() -> None:
    """E8: a bobber cast to the side stands a fixed step away, however far the target is round."""
    random = Random(8)
    for _ in range(300):
        craft, yaw, target = PAPERS, random.uniform(-pi, pi), random_point(random, 5.0)
        x, y, _ = bobber_room.bobber((0.0, 0.0, 0.0), yaw, target, craft.zone)
        far = hypot(target[0], target[1]) >= 2.0 * craft.zone.turning_radius
        if far and not craft.cone.holds(azimuth_error(target[0], target[1], yaw)):
            assert abs(hypot(x, y) - 0.5 * craft.reach) < 1e-9, f"cast only {hypot(x, y)} m"


def above_and_below_need_no_turn() -> None:
    """E10: vehicles climb freely, so a target straight above or below is flown to as it is."""
    random = Random(10)
    for height in (-2.0, -0.3, 0.3, 2.0):
        yaw = random.uniform(-pi, pi)
        flown = cycles(PAPERS, yaw, (0.0, 0.0, height))
        for _ in range(300):
            q, heading, _ = next(flown)
            assert heading == yaw and q[0] == q[1] == 0.0, (q, heading - yaw)
        assert abs(q[2] - height) < 1e-3, f"{height} m above: still at {q[2]}"


def tiny_motion_has_no_heading() -> None:
    """E10: what hovers, trembling by less than 2 cm/s, is not turned about."""
    random = Random(11)
    for _ in range(300):
        yaw = random.uniform(-pi, pi)
        wanted = random_point(random, 0.01)
        assert movement.steer(wanted, yaw, PAPERS.cone) == (wanted, yaw)


LAWS = {
    "Lemma 9": every_cycle_comes_nearer_or_turns,
    "E7": cycles_reach_the_target,
    "E8": the_cast_does_not_shrink,
    "E10 climb": above_and_below_need_no_turn,
    "E10 dead band": tiny_motion_has_no_heading,
}
