"""A beacon as its receivers use it: plain numbers, found once for all who hear the same beacon.

Structures of msgspec are slow to read, and each receiver reads a beacon many times.
"""

from functools import lru_cache
from math import inf
from typing import Final, final

from agent.messages import (
    NO_MISSION,
    Beacon,
    Branch,
    Drift,
    Place,
    Pose,
    RootKey,
    Standing,
    Swap,
    Vector,
)

PLACES_KEPT: Final = 2048
INCARNATION_LASTS_S: Final = 5.0
"""An older incarnation is heard again when the newer one has been silent for this long."""


_place = lru_cache(PLACES_KEPT)(Place)
"""Makes a place, or returns the same one again: making a named tuple takes longer."""


@final
class Version:
    """Which of a sender's statements one is: by its stamp, and by the sender's own count."""

    def __init__(
        self,
        stamp_s: float,
        incarnation: int,
        sequence: int,
    ) -> None:
        self.stamp_s = stamp_s
        self.incarnation = incarnation
        self.sequence = sequence

    def supersedes(self, other: "Version") -> bool:
        """Whether this statement is newer: later, and not the same one once more.

        A higher sequence alone does not count: an invented one would shut out all that follow. So
        would an invented incarnation, so it loses its rank when nothing follows it.
        """
        if self.incarnation < other.incarnation:
            return self.stamp_s > other.stamp_s + INCARNATION_LASTS_S
        if self.stamp_s == other.stamp_s:
            return (self.incarnation, self.sequence) > (other.incarnation, other.sequence)
        same = self.sequence == other.sequence and self.incarnation == other.incarnation
        return self.stamp_s > other.stamp_s and not same


NEVER_HEARD: Final = Version(-inf, -1, -1)
"""Of a sender not heard so far: older than any."""


@final
class HeardBranch:
    """See :class:`~agent.messages.Branch`."""

    def __init__(self, branch: Branch) -> None:
        self.root: RootKey = branch.root
        self.version: int = branch.version
        self.tier: int = branch.tier
        self.parent: int = branch.parent


@final
class HeardStanding:
    """See :class:`~agent.messages.Standing`."""

    def __init__(self, standing: Standing) -> None:
        self.branches: list[HeardBranch | None] = [
            HeardBranch(each) if each is not None else None for each in standing.branches
        ]
        self.leads: int = standing.leads
        self.queue: int = standing.queue
        self.heard: int = standing.heard
        self.pushes: bool = standing.pushes
        self.proposal: Swap | None = standing.proposal
        self.reservation: Swap | None = standing.reservation
        self.code: int = standing.code


@final
class HeardBeacon:
    """See :class:`~agent.messages.Beacon`; nobody changes it."""

    def __init__(self, beacon: Beacon) -> None:
        self.id: int = beacon.id
        self.version = Version(beacon.stamp_s, beacon.incarnation, beacon.sequence)
        self.stamp_s: float = beacon.stamp_s
        self.position: Vector = beacon.position
        self.velocity: Vector = beacon.velocity
        self.target: Vector = beacon.target
        self.queue: int = beacon.queue
        self.rank: int = beacon.rank
        self.cost_mm: int = beacon.cost_mm
        self.speed_cap: float = beacon.speed_cap
        self._echoed = [agent for agent, _ in beacon.echoes]
        self._sequences = [sequence for _, sequence in beacon.echoes]
        self.mission: int = beacon.mission
        self.frame_key: int = beacon.frame_key
        self.frame: Pose = beacon.frame
        self.drift: Drift | None = beacon.drift
        self.blocked: tuple[tuple[int, int], ...] = beacon.blocked
        standing = beacon.standing
        self.standing = HeardStanding(standing) if standing is not None else None
        claims = self.queue >= 0 and self.rank >= 0 and self.mission != NO_MISSION
        self.place = _place(self.queue, self.rank) if claims else None
        """The place that the sender claims in its mission."""

    def echo_of(self, agent: int) -> int:
        """Return the last sequence that the sender heard of an agent, -1 for none."""
        for k, each in enumerate(self._echoed):
            if each == agent:
                return self._sequences[k]
        return -1
