"""The hierarchy of a queue: each agent's parent and tier (Algorithm 1, lines 1-11).

The queue-vertex agent is tier 0. Every other agent names one parent among the agents of its queue
that it hears: the one of the lowest tier; on a tie the present parent, then the one nearest to its
own parent, then the one with the lower id (E15). An agent is a sub-vertex while another agent names
it as parent, and in distress while it has no parent. Loops cannot last: tiers carry the vertex
agent's sequence (the root) down, and an agent whose root has not advanced for T_root cannot be a
parent.
"""

from collections.abc import Sequence
from math import dist
from typing import NamedTuple

from agent.messages import ROLES, Beacon

ROOT_SILENCE_S = 4.0
"""T_root of E15 [s]."""
MAX_TIER = 1000
MEMBER, SUB_VERTEX, VERTEX, DISTRESS = range(len(ROLES))


class HierarchyState(NamedTuple):
    """An agent's position in the hierarchy of its queue; see Beacon for tier, parent and root."""

    tier: int
    parent: int
    root: int
    role: int  # index of ROLES


IN_DISTRESS = HierarchyState(tier=-1, parent=-1, root=0, role=DISTRESS)


class Hierarchy:
    """One agent's view of the tiers of its queue."""

    def __init__(self, own_id: int) -> None:
        self._own_id = own_id
        self._parent = -1
        self._advanced: dict[int, tuple[int, float]] = {}

    def update(
        self, now_s: float, sequence: int, vertex: bool, queue: Sequence[Beacon]
    ) -> HierarchyState:
        """Return the own state now.

        sequence: of the own beacons. vertex: whether the own agent holds the queue's vertex. queue:
        the last beacons heard directly of the own queue, its vertex agents included.
        """
        self._watch_roots(now_s, queue)
        named = any(beacon.parent == self._own_id for beacon in queue)
        if vertex:
            self._parent = -1
            return HierarchyState(tier=0, parent=-1, root=sequence, role=VERTEX)
        parent = self._best_parent(now_s, queue)
        self._parent = parent.id if parent is not None else -1
        if parent is None:
            return IN_DISTRESS
        role = SUB_VERTEX if named else MEMBER
        return HierarchyState(tier=parent.tier + 1, parent=parent.id, root=parent.root, role=role)

    def _watch_roots(self, now_s: float, queue: Sequence[Beacon]) -> None:
        known = self._advanced
        self._advanced = {}
        for beacon in queue:
            root, since_s = known.get(beacon.id, (-1, now_s))
            if beacon.root != root or beacon.tier == 0:
                root, since_s = beacon.root, now_s
            self._advanced[beacon.id] = (root, since_s)

    def _best_parent(self, now_s: float, queue: Sequence[Beacon]) -> Beacon | None:
        position_of = {beacon.id: beacon.position for beacon in queue}

        def order(beacon: Beacon) -> tuple[int, bool, float, int]:
            above = position_of.get(beacon.parent)
            away = dist(beacon.position, above) if above is not None else 0.0
            return (beacon.tier, beacon.id != self._parent, away, beacon.id)

        eligible = [
            beacon
            for beacon in queue
            if 0 <= beacon.tier < MAX_TIER
            and beacon.parent != self._own_id
            and now_s - self._advanced[beacon.id][1] <= ROOT_SILENCE_S
        ]
        return min(eligible, key=order, default=None)
