"""Whereabouts: where every vehicle of the team was last known to be, for the safety filter.

Neighbours and the record table drop a member that falls silent: it takes no place any more. Its
vehicle is still somewhere. An agent without a ranging sensor therefore keeps the last report of
each member, however old, and knows which members of the team never reported.
"""

from collections.abc import Iterable
from math import inf
from typing import Final, NamedTuple

from agent.heard_beacon import HeardBeacon
from agent.messages import Record, Vector

PROMISE_S: Final = 3.0
"""For how long a beacon's promise of a speed holds [s]."""


class VehicleReport(NamedTuple):
    """What another vehicle last reported of itself, directly or through others."""

    relative: Vector  # position relative to the own centre [m; world axes]
    age_s: float  # [s]
    speed_cap: float = inf
    """The speed that it promised not to exceed; infinite for no promise [m/s]."""


class Whereabouts:
    """The last report of each other vehicle that one agent knows of.

    team: number of agents that the fleet started with; their ids are 0 to ``team`` - 1. A relayed
    record counts only for these and for agents heard directly: other subjects may be invented.
    """

    def __init__(self, own_id: int, team: int) -> None:
        self._unheard = set(range(team)) - {own_id}
        self._heard: dict[int, HeardBeacon | Record] = {}
        self._relayed: dict[int, HeardBeacon | Record] = {}

    def hear(self, beacon: HeardBeacon) -> None:
        """Take a beacon, the newest one of its sender."""
        self._unheard.discard(beacon.id)
        self._heard[beacon.id] = beacon

    def relay(self, newest: Iterable[HeardBeacon | Record]) -> None:
        """Take the newest statements of all members, of which beacons are known already."""
        for each in newest:
            if isinstance(each, Record) and (each.id in self._heard or each.id in self._unheard):
                self._relayed[each.id] = each

    @property
    def complete(self) -> bool:
        """Whether every agent that the fleet started with has reported at least once."""
        return self._unheard <= self._relayed.keys()

    def reports(self, position: Vector, now_s: float) -> list[VehicleReport]:
        """Return the last report of each member, not extrapolated.

        position: own [m; world frame]. A beacon counts as long as its promise holds, then the
        newest statement.
        """
        newest = self._relayed | self._heard
        for member, relayed in self._relayed.items():
            heard = self._heard.get(member)
            if heard is not None and heard.stamp_s < min(now_s - PROMISE_S, relayed.stamp_s):
                newest[member] = relayed
        return [_report(each, position, now_s) for each in newest.values()]


def _report(newest: HeardBeacon | Record, position: Vector, now_s: float) -> VehicleReport:
    (u, v, w), (x, y, z) = newest.position, position
    age_s = max(0.0, now_s - newest.stamp_s)
    cap = newest.speed_cap if isinstance(newest, HeardBeacon) else inf
    return VehicleReport((u - x, v - y, w - z), age_s, cap)
