"""Adversaries of every kind of vehicle under the safety monitor that flies, one pair at a time.

They want the worst: straight at the other, past it, round it, or anything, with commands that come
late and expire, and headings that turn while they fly.
"""

from dataclasses import dataclass
from math import cos, dist, hypot, pi, sin

import numpy as np

from agent.config import AgentSetup, Comms, Control, Vehicle
from agent.controller import Senses
from agent.guidance.safety_monitor import SafetyMonitor
from tests.laws.speck import SPECK
from worldsim.truth.vehicle import Vehicles

SLOTS = 4
TICK_S = 0.05
DT = TICK_S / SLOTS


@dataclass(frozen=True)
class Craft:
    """A kind of vehicle, and for how many ticks its commands are valid."""

    vehicle: Vehicle
    ticks: int

    def safety_monitor(self, fastest):
        return SafetyMonitor(
            AgentSetup(
                id=0,
                incarnation=0,
                tick_hz=1.0 / TICK_S,
                slots_per_tick=SLOTS,
                command_ticks=self.ticks,
                vehicle=self.vehicle,
                fleet_max_speed_mps=fastest,
                control=Control(),
                comms=Comms(),
                formation=SPECK,
            )
        )


class Pair:
    """Two vehicles in truth, each with its monitor; the second may be a thing that stands."""

    def __init__(self, random, crafts, start, standing=False):
        self.random, self.crafts, self.standing = random, crafts, standing
        fastest = max(craft.vehicle.max_speed_mps for craft in crafts)
        self.safety_monitors = [craft.safety_monitor(fastest) for craft in crafts]
        position = np.array([(0.0, 0.0, 0.0), start])
        yaws = np.array([random.uniform(-pi, pi) for _ in crafts])
        self.fleet = Vehicles(position, yaws, [craft.vehicle for craft in crafts])
        self.phases = [random.randrange(SLOTS) for _ in crafts]
        self.late = [random.randrange((craft.ticks - 1) * SLOTS + 1) for craft in crafts]
        self.wish = [random.choice(WISHES) for _ in crafts]
        self.flown = [((0.0, 0.0, 0.0), 0.0, 0)] * 2
        self.coming = [[], []]

    def think(self, me, slot):
        if slot % SLOTS != self.phases[me] or (self.standing and me == 1):
            return
        here, there = self.fleet.position[me].tolist(), self.fleet.position[1 - me].tolist()
        towards = tuple(b - a for a, b in zip(here, there, strict=True))
        speed = self.crafts[me].vehicle.max_speed_mps
        wanted = tuple(speed * w for w in self.wish[me](self.random, towards, slot))
        near = (towards,)
        senses = Senses(
            now_s=slot * DT,
            position=tuple(here),
            velocity=tuple(self.fleet.velocity[me].tolist()),
            yaw=float(self.fleet.yaw[me]),
            vehicles=() if self.standing else near,
            neighbours=(),
            team=tuple,
            mission=None,
            obstacles=near if self.standing else (),
        )
        safe = self.safety_monitors[me].safe_velocity(wanted, senses)
        yaw = self.random.uniform(-pi, pi)
        ends = slot + self.crafts[me].ticks * SLOTS
        self.coming[me].append((slot + self.late[me], safe, yaw, ends))

    def fly(self, slot):
        for me in (0, 1):
            self.think(me, slot)
            while self.coming[me] and self.coming[me][0][0] <= slot:
                _, *self.flown[me] = self.coming[me].pop(0)
        live = [slot < self.flown[me][2] for me in (0, 1)]
        velocity = np.array([self.flown[me][0] if live[me] else (0, 0, 0) for me in (0, 1)], float)
        asked = [self.flown[me][1] if live[me] else self.fleet.yaw[me] for me in (0, 1)]
        self.fleet.integrate(velocity, np.array(asked), np.zeros((2, 2)), DT)
        return dist(*self.fleet.position.tolist())


def straight(_random, towards, _slot):
    r = max(hypot(*towards), 1e-9)
    return tuple(x / r for x in towards)


def past(random, towards, slot):
    x, y, z = straight(random, towards, slot)
    return (0.3 * x - 0.95 * y, 0.3 * y + 0.95 * x, 0.3 * z)


def anything(random, _towards, _slot):
    azimuth, climb = random.uniform(-pi, pi), random.uniform(-1.0, 1.0)
    level = (1.0 - climb * climb) ** 0.5
    return (level * cos(azimuth), level * sin(azimuth), climb)


def stop_and_go(random, towards, slot):
    ahead = straight(random, towards, slot)
    return ahead if slot // 40 % 2 else tuple(-x for x in ahead)


def zigzag(random, towards, slot):
    x, y, z = straight(random, towards, slot)
    side = 1.0 if slot // SLOTS % 4 < 2 else -1.0
    return (0.1 * x - side * y, 0.1 * y + side * x, 0.1 * z)


WISHES = (straight, past, anything, stop_and_go, zigzag)


def least_distance(random, crafts, standing=False, slots=60 * SLOTS):
    """Fly one pair; return where it began and its least distance [m]."""
    guard_m = 0.5 if standing else 0.25
    away = anything(random, None, 0)
    began = random.uniform(guard_m, guard_m + 0.6)
    pair = Pair(random, crafts, tuple(began * x for x in away), standing)
    return began, min(pair.fly(slot) for slot in range(slots))
