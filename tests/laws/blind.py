"""Vehicles without a ranging sensor under the safety monitor that flies: they only hear.

Adversaries of every kind want the worst while their radio loses, delays, and falls silent for good
or for a while: nobody may touch another, and no promise that a beacon makes may be broken.
"""

from dataclasses import dataclass
from itertools import combinations
from math import dist, hypot, inf, pi

import numpy as np

from agent.config import AgentSetup, Comms, Control
from agent.controller import Senses
from agent.guidance.safety_monitor import SafetyMonitor
from tests.agent.comms.builders import heard_beacon
from tests.laws.kinds import DT, SLOTS, TICK_S, WISHES, anything
from tests.laws.speck import SPECK
from worldsim.truth.vehicle import Vehicles

PROMISE_S = 3.0
ROUNDING = 1e-9


@dataclass(frozen=True)
class Radio:
    """The share of lost beacons, the delay [s], and from when to when nobody is heard [s]."""

    loss: float = 0.0
    delay_s: float = 0.0
    silent_s: tuple[float, float] = (inf, inf)

    def carries(self, random, now_s):
        first, last = self.silent_s
        return not first <= now_s < last and random.random() >= self.loss


class BlindFleet:
    """Adversaries in truth, each with its monitor; ``dead_s``: when the first one dies."""

    def __init__(self, random, vehicles, starts, radio, dead_s=inf):
        self.random, self.vehicles, self.radio, self.dead_s = random, vehicles, radio, dead_s
        fastest = max(vehicle.max_speed_mps for vehicle in vehicles)
        self.monitors = [
            SafetyMonitor(
                AgentSetup(
                    id=me,
                    incarnation=0,
                    tick_hz=1.0 / TICK_S,
                    slots_per_tick=SLOTS,
                    command_ticks=1,
                    vehicle=vehicle,
                    fleet_max_speed_mps=fastest,
                    control=Control(),
                    comms=Comms(),
                    formation=SPECK,
                    team=len(vehicles),
                )
            )
            for me, vehicle in enumerate(vehicles)
        ]
        yaws = np.array([random.uniform(-pi, pi) for _ in vehicles])
        self.truth = Vehicles(np.array(starts), yaws, vehicles)
        self.wish = [random.choice(WISHES) for _ in vehicles]
        self.phase = [random.randrange(SLOTS) for _ in vehicles]
        self.command = [((0.0, 0.0, 0.0), 0.0, 0)] * len(vehicles)
        self.sequence = 0
        self.flying = []
        self.promises = [[] for _ in vehicles]

    def step(self, me, slot):
        now_s, here = slot * DT, tuple(self.truth.position[me].tolist())
        for message in [each for each in self.flying if each[1] == me and each[0] <= now_s]:
            self.flying.remove(message)
            self.monitors[me].hear(message[2])
        nearest = min(
            (tuple(b - a for a, b in zip(here, there, strict=True)) for there in self.others(me)),
            key=lambda each: hypot(*each),
        )
        speed = self.vehicles[me].max_speed_mps
        wanted = tuple(speed * x for x in self.wish[me](self.random, nearest, slot))
        velocity = tuple(self.truth.velocity[me].tolist())
        safe = self.monitors[me].safe_velocity(
            wanted,
            Senses(
                now_s=now_s,
                position=here,
                velocity=velocity,
                yaw=float(self.truth.yaw[me]),
                vehicles=(),
                neighbours=(),
                team=tuple,
                mission=None,
            ),
        )
        self.command[me] = (safe, self.random.uniform(-pi, pi), slot + SLOTS)
        self.talk(me, now_s, here)

    def others(self, me):
        rows = self.truth.position.tolist()
        return rows[:me] + rows[me + 1 :]

    def talk(self, me, now_s, here):
        self.sequence += 1
        cap = self.monitors[me].speed_cap
        self.promises[me].append((now_s, cap))
        said = heard_beacon(me, self.sequence, now_s, at=here, speed_cap=cap)
        for other in range(len(self.vehicles)):
            if other != me and self.radio.carries(self.random, now_s):
                self.flying.append((now_s + self.radio.delay_s, other, said))

    def fly(self, slot):
        now_s = slot * DT
        for me in range(len(self.vehicles)):
            if slot % SLOTS == self.phase[me] and (me > 0 or now_s < self.dead_s):
                self.step(me, slot)
        flown = [
            (velocity, yaw) if slot < ends else ((0.0, 0.0, 0.0), float(self.truth.yaw[me]))
            for me, (velocity, yaw, ends) in enumerate(self.command)
        ]
        tilt = np.zeros((len(flown), 2))
        velocity, yaw = (np.array(each) for each in zip(*flown, strict=True))
        self.truth.integrate(velocity, yaw, tilt, DT)
        return min(dist(a, b) for a, b in combinations(self.truth.position.tolist(), 2))

    def broken_promises(self, slot):
        """Return by how much vehicles exceed promises that hold in the slot just flown [m/s]."""
        now_s = slot * DT
        speeds = [hypot(*v) for v in self.truth.velocity.tolist()]
        return [
            speed - cap
            for speed, promises in zip(speeds, self.promises, strict=True)
            for made_s, cap in promises[-80:]
            if made_s <= now_s < made_s + PROMISE_S and speed > cap + ROUNDING
        ]


def scattered(random, count, least, most):
    """Return start positions at least so far from one another [m]."""
    found = []
    while len(found) < count:
        azimuth = anything(random, None, 0)
        r = random.uniform(0.0, most)
        point = tuple(r * x for x in azimuth)
        if all(dist(point, each) >= least for each in found):
            found.append(point)
    return found
