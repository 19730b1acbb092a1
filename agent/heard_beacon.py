"""A beacon as its receivers use it: plain numbers, found once for all who hear the same beacon.

Structures of msgspec are slow to read, and each receiver reads a beacon many times. Here each is
taken apart once, into its fields in their order.
"""

from functools import lru_cache
from math import inf
from typing import Any, Final, final

from msgspec.structs import astuple

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
        fields: tuple[Any, ...] = astuple(branch)
        root, version, tier, parent = fields
        self.root: RootKey = root
        self.version: int = version
        self.tier: int = tier
        self.parent: int = parent


@final
class HeardStanding:
    """See :class:`~agent.messages.Standing`."""

    def __init__(self, standing: Standing) -> None:
        fields: tuple[Any, ...] = astuple(standing)
        branches, leads, queue, heard, pushes, proposal, reservation, code = fields
        self.branches: list[HeardBranch | None] = [
            HeardBranch(each) if each is not None else None for each in branches
        ]
        self.leads: int = leads
        self.queue: int = queue
        self.heard: int = heard
        self.pushes: bool = pushes
        self.proposal: Swap | None = proposal
        self.reservation: Swap | None = reservation
        self.code: int = code


@final
class HeardBeacon:
    """See :class:`~agent.messages.Beacon`; nobody changes it."""

    def __init__(self, beacon: Beacon) -> None:
        fields: tuple[Any, ...] = astuple(beacon)
        own_id, incarnation, sequence, stamp_s, position, velocity, target = fields[:7]
        queue, rank, cost_mm, speed_cap, given, mission, frame_key = fields[7:14]
        frame, drift, blocked, standing = fields[14:]
        self.id: int = own_id
        self.version = Version(stamp_s, incarnation, sequence)
        self.stamp_s: float = stamp_s
        self.position: Vector = position
        self.velocity: Vector = velocity
        self.target: Vector = target
        self.queue: int = queue
        self.rank: int = rank
        self.cost_mm: int = cost_mm
        self.speed_cap: float = speed_cap
        echoes: tuple[tuple[int, int], ...] = given  # compiled code takes apart what it knows
        self._echoed = [agent for agent, _ in echoes]
        self._sequences = [number for _, number in echoes]
        self.mission: int = mission
        self.frame_key: int = frame_key
        self.frame: Pose = frame
        self.drift: Drift | None = drift
        self.blocked: tuple[tuple[int, int], ...] = blocked
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
