"""The safety filter in crowds: every pair of vehicles keeps its distance."""

from itertools import combinations
from math import cos, dist, hypot, pi, sin
from random import Random

import pytest

from agent.guidance.cone import Cone
from agent.guidance.safety_filter import RangingFilter, limited

D_OB = 0.25
SLOTS = 4
TICKS = 60


class Flyer:
    """A vehicle among others that wants to their centre, round them, anywhere, or to stand."""

    def __init__(self, random, position, max_speed, ticks_valid):
        self.random = random
        self.position = position
        self.phase = random.randrange(SLOTS)
        self.latency = random.randrange(SLOTS + 1)
        self.life = ticks_valid * SLOTS
        self.speed = max_speed * random.choice((0.5, 1.0, 1.0))
        self.dt = 0.05 / SLOTS
        self.filter = RangingFilter(D_OB, max_speed, ticks_valid * 0.05)
        self.kind = random.choice(("in", "in", "round", "anywhere", "still"))
        self.cone = random.choice((Cone(pi / 4, pi / 4), Cone(pi, pi)))
        self.waiting, self.velocity, self.expires = [], (0.0, 0.0, 0.0), 0

    def wants(self):
        x, y, z = (-each for each in self.position)
        if self.kind == "round":
            x, y = -y + 0.2 * x, x + 0.2 * y
        elif self.kind == "anywhere":
            x, y, z = (self.random.gauss(0, 1) for _ in range(3))
        scale = 0.0 if self.kind == "still" else self.speed / max(hypot(x, y, z), 1e-9)
        return (scale * x, scale * y, scale * z)

    def think(self, slot, others):
        if slot % SLOTS != self.phase:
            return
        near = [
            tuple(b - a for a, b in zip(self.position, o.position, strict=True)) for o in others
        ]
        yaw = self.random.uniform(-pi, pi)
        safe = limited(self.wants(), self.filter.bounds(near), yaw, self.cone)
        assert hypot(*safe) <= self.speed * (1 + 1e-9)
        self.waiting.append((slot + self.latency, slot + self.life, safe))

    def fly(self, slot):
        while self.waiting and self.waiting[0][0] <= slot:
            _, self.expires, self.velocity = self.waiting.pop(0)
        if slot < self.expires:
            self.position = tuple(
                p + self.dt * v for p, v in zip(self.position, self.velocity, strict=True)
            )


def crowd(seed, count, max_speed, ticks_valid):
    """Return one vehicle and others round it, 0.3 to 0.8 m away, in three dimensions."""
    random = Random(seed)
    found = [(0.0, 0.0, 0.0)]
    while len(found) < count:
        azimuth, climb, r = random.uniform(-pi, pi), random.uniform(-1, 1), random.uniform(0.3, 0.8)
        level = (1.0 - climb * climb) ** 0.5 * r
        at = (level * cos(azimuth), level * sin(azimuth), climb * r)
        if all(dist(at, other) >= 0.3 for other in found):
            found.append(at)
    return [Flyer(random, at, max_speed, ticks_valid) for at in found]


@pytest.mark.parametrize("count", [3, 5, 6, 7])
@pytest.mark.parametrize(("max_speed", "ticks_valid"), [(0.5, 1), (1.0, 2), (2.0, 1)])
def test_every_pair_of_a_crowd_keeps_its_distance(count, max_speed, ticks_valid):
    least = 1e9
    for seed in range(20):
        flyers = crowd(seed, count, max_speed, ticks_valid)
        for slot in range(TICKS * SLOTS):
            for each in flyers:
                each.think(slot, [other for other in flyers if other is not each])
            for each in flyers:
                each.fly(slot)
            least = min(least, *(dist(a.position, b.position) for a, b in combinations(flyers, 2)))
    assert D_OB <= least < 0.31
