"""The safety filter against adversaries: the gap between two vehicles never closes."""

from math import cos, dist, hypot, pi, sin
from random import Random

import pytest

from agent.guidance.cone import Cone
from agent.guidance.safety_filter import (
    Bound,
    RangingFilter,
    limited,
)

D_OB = 0.25
SLOTS = 4


class Vehicle:
    """A filtered adversarial vehicle, with commands that arrive late and expire."""

    def __init__(self, random, position, max_speed, dt, horizon_slots):
        self.random = random
        self.position = position
        self.max_speed = max_speed
        self.dt = dt
        self.horizon_slots = horizon_slots
        self.phase = random.randrange(SLOTS)
        self.latency_slots = random.randrange(horizon_slots - SLOTS + 1)
        self.yaw = random.uniform(-pi, pi)
        self.cone = random.choice((Cone(0.4, 0.4), Cone(pi / 4, 1.0), Cone(pi, pi)))
        self.filter = RangingFilter(D_OB, max_speed, horizon_slots * dt)
        self.waiting = []
        self.velocity, self.expires = (0.0, 0.0, 0.0), 0

    def wants(self, towards):
        """Return a velocity straight at the other vehicle, or a random one."""
        kind = self.random.random()
        if kind < 0.6:
            scale = self.max_speed / max(hypot(*towards), 1e-9)
            return tuple(scale * x for x in towards)
        azimuth, climb = self.random.uniform(-pi, pi), self.random.uniform(-1, 1)
        level = (1 - climb * climb) ** 0.5
        wanted = (level * cos(azimuth), level * sin(azimuth), climb)
        return tuple(self.max_speed * x for x in wanted)

    def think(self, slot, other):
        if slot % SLOTS != self.phase:
            return
        towards = tuple(b - a for a, b in zip(self.position, other, strict=True))
        safe = limited(self.wants(towards), self.filter.bounds([towards]), self.yaw, self.cone)
        self.waiting.append((slot + self.latency_slots, slot + self.horizon_slots, safe))

    def fly(self, slot):
        while self.waiting and self.waiting[0][0] <= slot:
            _, self.expires, self.velocity = self.waiting.pop(0)
        if slot < self.expires:
            self.position = tuple(
                p + self.dt * v for p, v in zip(self.position, self.velocity, strict=True)
            )


@pytest.mark.parametrize(("max_speed", "ticks_valid"), [(0.5, 1), (0.5, 2), (1.0, 1), (1.0, 2)])
def test_ranging_keeps_adversarial_pairs_apart(max_speed, ticks_valid):
    least = 1e9
    for pair in range(250):
        random = Random(1000 * ticks_valid + pair)
        start = (random.uniform(D_OB, 1.2), 0.0, random.uniform(-0.05, 0.05))
        one = Vehicle(random, (0.0, 0.0, 0.0), max_speed, 0.05 / SLOTS, ticks_valid * SLOTS)
        two = Vehicle(random, start, max_speed, 0.05 / SLOTS, ticks_valid * SLOTS)
        for slot in range(240):
            one.think(slot, two.position)
            two.think(slot, one.position)
            one.fly(slot)
            two.fly(slot)
            least = min(least, dist(one.position, two.position))
    assert least >= D_OB - 1e-9


def test_without_the_filters_share_and_margin_they_collide():
    """The same adversaries collide when each may close almost half of the gap in a step."""
    collided = 0
    for pair in range(250):
        random = Random(pair)
        one = Vehicle(random, (0.0, 0.0, 0.0), 1.0, 0.05 / SLOTS, 2 * SLOTS)
        two = Vehicle(random, (0.6, 0.0, 0.0), 1.0, 0.05 / SLOTS, 2 * SLOTS)
        for each in (one, two):
            each.filter._rate = 0.45 / 0.05
            each.filter._stop_m = D_OB
        for slot in range(240):
            one.think(slot, two.position)
            two.think(slot, one.position)
            one.fly(slot)
            two.fly(slot)
        collided += dist(one.position, two.position) < D_OB
    assert collided > 0


def test_a_slide_that_leaves_the_cone_is_only_shortened():
    random = Random(5)
    for _ in range(500):
        velocity = tuple(random.uniform(-0.5, 0.5) for _ in range(3))
        away = tuple(random.gauss(0, 1) for _ in range(3))
        norm = hypot(*away)
        bounds = [Bound(tuple(x / norm for x in away), random.uniform(0, 0.2))]
        yaw = random.uniform(-pi, pi)
        safe = limited(velocity, bounds, yaw, Cone(0.0, 0.0))
        approach = -sum(v * n for v, n in zip(safe, bounds[0].away, strict=True))
        assert approach <= bounds[0].limit + 1e-9
        assert hypot(*safe) <= hypot(*velocity) + 1e-9
        if hypot(*safe) > 0.03 and hypot(safe[0], safe[1]) > 0.021:
            cosine = sum(a * b for a, b in zip(safe, velocity, strict=True))
            assert cosine == pytest.approx(hypot(*safe) * hypot(*velocity), rel=1e-6)
