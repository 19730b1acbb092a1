"""Pairs of adversaries under the safety filter, many at once: rows of arrays are pairs.

``python -m tests.laws.adversaries --pairs 100000`` flies that many in every fleet of FLEETS and
exits 1 if any two came nearer than d_ob. The filter's law is written out here once more, for
arrays; test_adversaries.py checks that it is the law that flies.
"""

import argparse
import sys
from dataclasses import dataclass, field
from math import pi
from time import perf_counter

import numpy as np

from agent.guidance.cone import SLACK_RAD
from agent.guidance.movement import DEAD_BAND_MPS
from agent.guidance.safety_filter import PASSES, ROUNDING_MPS, SHARE

D_OB = 0.25
TICK_S = 0.05
SLOTS = 4
DT = TICK_S / SLOTS
TICKS = 60
ROUNDING_M = 1e-9
CLOSE_BY_M = 0.05
CHUNK = 10_000
KINDS = ("head-on", "orbiting", "random", "stop-and-go", "lying still", "passing close", "circling")
CIRCLING = KINDS.index("circling")
IN_CONCERT = 0.3
"""So many pairs circle each other in one sense, the one faster than the other: whoever sees the
other later than it is seen comes nearer all the time, by the turning of the line between them."""


@dataclass(frozen=True)
class Fleet:
    """Speeds of the two [m/s], and for how many ticks a command is valid."""

    speeds: tuple[float, float]
    ticks_valid: int

    @property
    def horizon_s(self):
        return self.ticks_valid * TICK_S


FLEETS = (
    Fleet((0.5, 0.5), 1),
    Fleet((0.5, 0.5), 2),
    Fleet((1.0, 1.0), 1),
    Fleet((1.0, 1.0), 2),
    Fleet((1.0, 0.3), 1),
    Fleet((1.0, 0.3), 2),
    Fleet((2.0, 2.0), 1),
)
"""All within the filter's condition: the greatest speed times H is at most 0.1 m."""


def dot(a, b):
    return (a * b).sum(axis=-1)


def norm(a):
    return np.sqrt(dot(a, a))


@dataclass(frozen=True)
class Law:
    """The ranging filter of two bodies, row by row: RangingFilter.bounds, then limited."""

    max_speed: float
    horizon_s: float
    share: float = SHARE
    margin: bool = True
    turning: bool = True

    def __call__(self, wanted, towards, yaw, cone):
        """wanted [m/s] and towards [m]: (P, 3); yaw (P,) and cone (P, 2): left, right [rad]."""
        reach, rate = self.max_speed * self.horizon_s, self.share / self.horizon_s
        stop = D_OB + (reach * reach / D_OB if self.margin else 0.0)
        r = norm(towards)
        away = -towards / np.maximum(r, 1e-300)[:, None]
        limit = rate * np.maximum(0.0, r - stop)
        turning = self.max_speed / max(stop - D_OB, 1e-300) * np.maximum(0.0, r - D_OB)
        aside = np.where((r < stop) & self.turning, turning, np.inf)
        seen = (r < stop + self.max_speed / rate) & (r > 0.0)
        held = ~seen | self._keeps(wanted, away, limit, aside)
        sliding = wanted
        for _ in range(PASSES):
            approach, across = _parts(sliding, away)
            share = np.minimum(1.0, aside / np.maximum(norm(across), 1e-12))
            slid = share[:, None] * across - np.minimum(approach, limit)[:, None] * away
            keeps = self._keeps(sliding, away, limit, aside)
            sliding = np.where(keeps[:, None], sliding, slid)
        inside = _in_cone(sliding, yaw, cone)[:, None]
        climbing = self._kept(sliding * (0.0, 0.0, 1.0), away, limit, aside)
        short = self._kept(wanted, away, limit, aside)
        out = np.where((norm(climbing) >= norm(short))[:, None], climbing, short)
        safe = np.where(inside, self._kept(sliding, away, limit, aside), out)
        return np.where(held[:, None], wanted, safe)

    @staticmethod
    def _kept(velocity, away, limit, aside):
        approach, across = _parts(velocity, away)
        scale = np.minimum(_ratio(limit, approach), _ratio(aside, norm(across)))
        return scale[:, None] * velocity

    @staticmethod
    def _keeps(velocity, away, limit, aside):
        approach, across = _parts(velocity, away)
        return (approach <= limit + ROUNDING_MPS) & (norm(across) <= aside + ROUNDING_MPS)


def _parts(velocity, away):
    """Return the speed towards the other, and the velocity across [m/s]."""
    approach = -dot(velocity, away)
    return approach, velocity + approach[:, None] * away


def _ratio(limit, value):
    over = value > limit + ROUNDING_MPS
    return np.where(over, limit / np.where(over, value, 1.0), 1.0)


def _in_cone(velocity, yaw, cone):
    x, y = velocity[:, 0], velocity[:, 1]
    error = np.arctan2(y, x) - yaw
    error = error - 2.0 * pi * np.rint(error / (2.0 * pi))
    inside = (-cone[:, 1] - SLACK_RAD <= error) & (error <= cone[:, 0] + SLACK_RAD)
    return inside | (np.hypot(x, y) <= DEAD_BAND_MPS)


@dataclass
class Vehicles:
    """One vehicle of each pair: what it is, what it does now, and the command under way to it."""

    position: np.ndarray
    speed: float
    phase: np.ndarray
    kind: np.ndarray
    cone: np.ndarray
    side: np.ndarray
    pace: np.ndarray
    latency: np.ndarray
    velocity: np.ndarray = field(init=False)
    expires: np.ndarray = field(init=False)
    coming: np.ndarray = field(init=False)
    arrives: np.ndarray = field(init=False)
    ends: np.ndarray = field(init=False)

    def __post_init__(self):
        pairs = len(self.position)
        self.velocity, self.coming = np.zeros((pairs, 3)), np.zeros((pairs, 3))
        self.expires, self.ends = np.zeros(pairs, int), np.zeros(pairs, int)
        self.arrives = np.full(pairs, -1)

    def take(self, slot):
        """Take up the commands that arrive in this slot."""
        now = self.arrives == slot
        self.velocity[now], self.expires[now] = self.coming[now], self.ends[now]

    def flown(self, slot):
        """Return the way of this slot [m]; past a command's expiry the vehicle stands."""
        return np.where((slot < self.expires)[:, None], DT * self.velocity, 0.0)


def vehicles(random, position, speed):
    """Return one vehicle for each pair, of random kind, phase, cone and latency."""
    pairs = len(position)
    return Vehicles(
        position,
        speed,
        random.integers(SLOTS, size=pairs),
        random.integers(len(KINDS), size=pairs),
        random.choice((0.2, pi / 4, 1.0, pi), (pairs, 2)),
        directions(random, pairs),
        random.uniform(0.2, 1.0, pairs),
        random.integers(-SLOTS, SLOTS + 1, size=pairs),
    )


def joined(random, one, two):
    """Let some pairs circle in concert: close by, in one sense, each as late as it always is."""
    rows = random.random(len(one.kind)) < IN_CONCERT
    for me in (one, two):
        me.kind[rows], me.cone[rows] = CIRCLING, pi
        me.latency[rows] = np.abs(me.latency[rows])
    two.side[rows] = -one.side[rows]
    near = random.uniform(D_OB, D_OB + CLOSE_BY_M, len(rows))[:, None]
    two.position[rows] *= (near / norm(two.position)[:, None])[rows]


def directions(random, count):
    found = random.standard_normal((count, 3))
    return found / norm(found)[:, None]


def wants(random, me, rows, towards, slot):
    """Return what adversaries want [m/s]: the worst that each kind can think of."""
    ahead = towards / np.maximum(norm(towards), 1e-300)[:, None]
    across = np.cross(ahead, me.side[rows])
    across = across / np.maximum(norm(across), 1e-300)[:, None]
    anywhere = directions(random, len(rows))
    going = ((slot // SLOTS + 7 * rows) // (2 + rows % 9) % 2)[:, None] * ahead
    near = 0.95 * across + 0.3 * ahead
    circling = me.pace[rows][:, None] * (across + 0.1 * ahead)
    choices = np.stack((ahead, across + 0.1 * ahead, anywhere, going, 0.0 * ahead, near, circling))
    wanted = choices[me.kind[rows], np.arange(len(rows))]
    return me.speed * wanted / np.maximum(1.0, norm(wanted))[:, None]


def think(random, law, me, other, slot, ticks_valid):
    """Let those vehicles step whose slot it is: measure, want, filter, send a command off."""
    rows = np.flatnonzero(me.phase == slot % SLOTS)
    towards = other.position[rows] - me.position[rows]
    yaw = random.uniform(-pi, pi, len(rows))
    wanted = wants(random, me, rows, towards, slot)
    me.coming[rows] = law(wanted, towards, yaw, me.cone[rows])
    any_time = random.integers(SLOTS + 1, size=len(rows))
    me.arrives[rows] = slot + np.where(me.latency[rows] < 0, any_time, me.latency[rows])
    me.ends[rows] = slot + ticks_valid * SLOTS


def swept(start, change):
    """Return the least distance while a relative position [m] changes along a straight line."""
    along = dot(change, change)
    when = np.clip(-dot(start, change) / np.where(along > 0.0, along, 1.0), 0.0, 1.0)
    return norm(start + when[:, None] * change)


def least_distance(random, fleet, pairs, **law):
    """Fly so many pairs for three seconds; return where each began and its least distance [m]."""
    law = Law(max(fleet.speeds), fleet.horizon_s, **law)
    start = directions(random, pairs) * random.uniform(D_OB, 1.0, pairs)[:, None]
    one = vehicles(random, np.zeros((pairs, 3)), fleet.speeds[0])
    two = vehicles(random, start, fleet.speeds[1])
    joined(random, one, two)
    began = least = norm(two.position)
    for slot in range(TICKS * SLOTS):
        for me, other in ((one, two), (two, one)):
            me.take(slot)
            think(random, law, me, other, slot, fleet.ticks_valid)
            me.take(slot)
        first, second = one.flown(slot), two.flown(slot)
        between = two.position - one.position
        least = np.minimum(least, swept(between, second - first))
        one.position, two.position = one.position + first, two.position + second
    return began, least


def violations(fleet, pairs, seed):
    """Return how many pairs came nearer than d_ob, and two least distances [m].

    Of all pairs, and of those that began more than half a metre apart.
    """
    random, count, nearest, closed = np.random.default_rng(seed), 0, np.inf, np.inf
    for first in range(0, pairs, CHUNK):
        began, least = least_distance(random, fleet, min(CHUNK, pairs - first))
        count += int((least < D_OB - ROUNDING_M).sum())
        nearest = min(nearest, float(least.min()))
        closed = min(closed, float(least[began > 0.5].min()))
    return count, nearest, closed


def main():
    parser = argparse.ArgumentParser(description="Adversarial pairs under the safety filter.")
    parser.add_argument("--pairs", type=int, default=100_000, help="in each fleet")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    total = 0
    for fleet in FLEETS:
        began = perf_counter()
        count, nearest, closed = violations(fleet, given.pairs, given.seed)
        total += count
        print(
            f"{fleet.speeds} m/s, {fleet.ticks_valid} ticks: {count} of {given.pairs} violate, "
            f"least {nearest:.9f} m, from beyond 0.5 m {closed:.9f} m, "
            f"{perf_counter() - began:.1f} s",
            flush=True,
        )
    sys.exit(1 if total else 0)


if __name__ == "__main__":
    main()
