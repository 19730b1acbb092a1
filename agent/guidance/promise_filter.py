"""The safety filter without a ranging sensor: it knows other vehicles only by what they reported.

A report says where a vehicle was, and which speed it promises not to exceed for the next 3 s. From
then on the vehicle may be anywhere within a ball that grows at the promised speed, and after these
3 s at the speed of the fleet's fastest vehicle. The filter keeps the own vehicle out of that ball.
Where it is inside already, the vehicle stands still: then the other one, which keeps out of this
vehicle's ball by the same rule, is the one that keeps clear.
"""

from collections import deque
from collections.abc import Sequence
from math import hypot, inf
from typing import Final

from agent.comms.whereabouts import PROMISE_S, VehicleReport
from agent.guidance.safety_filter import Bound
from agent.guidance.sight import Braking
from agent.messages import Vector

LEAST_CAP_MPS: Final = 0.05
"""The least speed to promise [m/s]; a vehicle too near to others still moves apart at it."""
ROUNDING_S: Final = 1e-9
CLOSING_S: Final = 1.3
"""A vehicle promises a speed that closes its smallest gap in this time [s]."""


class PromiseFilter:
    """Promises a speed to the others, and limits the velocity by what they promise.

    d_ob: least distance between centres [m]; max_speed: of the fleet's fastest vehicle [m/s].
    restarted: whether an earlier process of this agent may have made promises that still hold.
    """

    def __init__(
        self, d_ob: float, max_speed: float, braking: Braking, restarted: bool = False
    ) -> None:
        self._d_ob = d_ob
        self._max_speed = max_speed
        self._braking = braking
        self._horizon_s = braking.horizon_s(max_speed)
        self._restarted = restarted
        self._least_cap = min(LEAST_CAP_MPS, max_speed)
        self._promises: deque[tuple[float, float]] = deque()
        self._commanded: deque[tuple[float, float]] = deque()
        self._cap = self._least_cap

    def promise(self, now_s: float, speed: float, reports: Sequence[VehicleReport]) -> float:
        """Return the speed that the vehicle promises for the next 3 s [m/s].

        speed: present own speed [m/s]. What the vehicle flies until a new command reaches it is
        part of the promise.
        """
        gap = min((self._room(each, 0.0, each.speed_cap) for each in reports), default=inf)
        self._cap = min(max(gap / CLOSING_S, self._least_cap), self._max_speed)
        if self._restarted and not self._promises:
            self._promises.append((now_s, self._least_cap))
        _drop_before(self._commanded, now_s - self._braking.latency_s)
        flown = max((each for _, each in self._commanded), default=0.0)
        promised = max(self._cap, speed, flown)
        self._promises.append((now_s, promised))
        _drop_before(self._promises, now_s - PROMISE_S)
        return promised

    @property
    def speed_limit(self) -> float:
        """The speed that keeps every promise of the last 3 s, the newest included [m/s]."""
        return min([self._cap, *(each for _, each in self._promises)])

    def command(self, now_s: float, speed: float) -> None:
        """Remember the speed of the command that is given now [m/s]."""
        self._commanded.append((now_s, speed))

    def must_stand(self, velocity: Vector, reports: Sequence[VehicleReport]) -> bool:
        """Whether another vehicle may be too near by the time that this one has come to rest.

        velocity: present own velocity [m/s; world frame].
        """
        needs_s = self._needs_s(hypot(*velocity))
        return any(self._room(each, needs_s, each.speed_cap) < 0.0 for each in reports)

    def bounds(self, velocity: Vector, reports: Sequence[VehicleReport]) -> list[Bound]:
        """Return the bounds of vehicles; zero where one may be too near."""
        needs_s = self._needs_s(hypot(*velocity))
        found = []
        for report in reports:
            r = hypot(*report.relative)
            if r > 0.0:
                room = max(0.0, self._room(report, needs_s, report.speed_cap))
                x, y, z = report.relative
                found.append(Bound((-x / r, -y / r, -z / r), room / self._horizon_s))
        return found

    def _needs_s(self, speed: float) -> float:
        """Return the time to come to rest from this speed, or from what may be commanded [s]."""
        return self._braking.stopping_s(max(speed, self.speed_limit))

    def _room(self, report: VehicleReport, lead_s: float, cap: float) -> float:
        """Return how far the vehicle may fly towards a report's place in ``lead_s`` [m]."""
        age_s = report.age_s + lead_s
        promised_s = min(age_s, PROMISE_S)
        reach = min(cap, self._max_speed) * promised_s + self._max_speed * (age_s - promised_s)
        return hypot(*report.relative) - self._d_ob - reach


def _drop_before(timed: deque[tuple[float, float]], earliest_s: float) -> None:
    while timed and timed[0][0] < earliest_s - ROUNDING_S:
        timed.popleft()
