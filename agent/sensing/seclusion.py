"""Seclusion: how an agent that distrusts its proximity sensor, and is left alone, comes back.

Only a neighbour that is sensed where it reports itself proves the sensor right, and none comes to
an agent whose team has flown away. So it flies on slowly for as long as its sensor and all reports
agree that nobody is near. Where a neighbour reports itself near, the sensor shows it and is trusted
again, or does not: then the agent stands, far from it.

Reports must be such that they can be believed. Every member that was ever heard is heard now; and
no position, the own or a reported one, has jumped since a neighbour was last sensed where it
reported itself.
"""

from collections.abc import Sequence
from typing import Final

from agent.heard_beacon import HeardBeacon
from agent.messages import PROXIMITY_RANGE_M, ZERO, Observation, Vector
from agent.sensing.own_pose import JUMP_M
from agent.vectors import apart

PROBING_MPS: Final = 0.2
"""How fast it flies on [m/s]: it stands within a few centimetres."""
AGREED_S: Final = 2.0
"""How long sensor and reports must have agreed."""
HEARD_S: Final = 0.5
"""A member that was not heard for so long may be anywhere."""


class Seclusion:
    """Whether nobody can be near one agent. max_speed: limit of the fleet's fastest vehicle [m/s].

    ``probing_mps``: how fast the agent may fly though it distrusts its sensor; 0 for not at all.
    """

    def __init__(self, max_speed: float) -> None:
        self._max_speed = max_speed
        self._reports: dict[int, HeardBeacon] = {}
        """The last report of each member that was ever heard."""
        self._here: Vector = ZERO
        self._here_s: float | None = None
        self._jumped = False
        """Whether a position has jumped since a neighbour was sensed where it reported itself."""
        self._agreed_since_s: float | None = None
        self.probing_mps = 0.0

    def update(
        self, observation: Observation, neighbours: Sequence[HeardBeacon], *, met: bool
    ) -> None:
        """Take what is sensed and reported. met: a neighbour is sensed where it reports itself."""
        now_s, here = observation.time_s, observation.position
        jumped = self._has_jumped(here, self._here, now_s, self._here_s)
        self._here, self._here_s = here, now_s
        for beacon in neighbours:
            before = self._reports.get(beacon.id)
            if before is not None:
                jumped = jumped or self._has_jumped(
                    beacon.position, before.position, beacon.stamp_s, before.stamp_s
                )
            self._reports[beacon.id] = beacon
        self._jumped = jumped or (self._jumped and not met)
        alone = not self._jumped and not observation.vehicles and self._is_alone(here, now_s)
        if not alone:
            self._agreed_since_s = None
        elif self._agreed_since_s is None:
            self._agreed_since_s = now_s
        agrees = self._agreed_since_s is not None and now_s - self._agreed_since_s >= AGREED_S
        self.probing_mps = PROBING_MPS if agrees else 0.0

    def _is_alone(self, here: Vector, now_s: float) -> bool:
        """Whether all members are heard, and report themselves out of the sensor's range."""
        return bool(self._reports) and all(
            now_s - each.stamp_s <= HEARD_S and apart(here, each.position) > PROXIMITY_RANGE_M
            for each in self._reports.values()
        )

    def _has_jumped(
        self, now_at: Vector, before_at: Vector, now_s: float, before_s: float | None
    ) -> bool:
        """Whether a position has changed by more than a vehicle can have flown."""
        if before_s is None:
            return False
        flown_m = 2.0 * self._max_speed * abs(now_s - before_s)
        return apart(now_at, before_at) > flown_m + JUMP_M
