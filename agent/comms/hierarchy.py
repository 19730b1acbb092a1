"""The hierarchy of a queue: whom an agent follows, and in which tier (Algorithm 1, lines 1-11).

The queue-vertex agent is tier 0. Every other agent names one parent among those it hears on its
queue: the lowest tier; on a tie the present parent, then the one nearest to its own parent, then
the lower id (E15). It is a sub-vertex while somebody names it, in distress while it has no parent.
Loops cannot last: tiers carry the vertex agent's sequence down, and whoever's root has not advanced
for T_root is nobody's parent.
"""

from collections.abc import Sequence
from math import dist
from typing import NamedTuple

from agent.messages import ROLES, Beacon

ROOT_SILENCE_S = 4.0
MAX_TIER = 1000
MEMBER, SUB_VERTEX, VERTEX, DISTRESS = range(len(ROLES))


class Standing(NamedTuple):
    """An agent's standing in its queue; see Beacon. role: index of ROLES."""

    tier: int
    parent: int
    root: int
    role: int


ALONE = Standing(tier=-1, parent=-1, root=0, role=DISTRESS)


class Hierarchy:
    """One agent's view of its queue's tiers."""

    def __init__(self, own_id: int) -> None:
        self._own_id = own_id
        self._parent = -1
        self._advanced: dict[int, tuple[int, float]] = {}

    def stand(self, now_s: float, sequence: int, vertex: bool, queue: Sequence[Beacon]) -> Standing:
        """Return the own standing now.

        sequence: of the own beacons; vertex: whether one holds the queue's vertex; queue: the last
        beacons of those heard directly on the own queue, its vertex agents among them.
        """
        self._watch_roots(now_s, queue)
        named = any(beacon.parent == self._own_id for beacon in queue)
        if vertex:
            self._parent = -1
            return Standing(tier=0, parent=-1, root=sequence, role=VERTEX)
        parent = self._best(now_s, queue)
        self._parent = parent.id if parent is not None else -1
        if parent is None:
            return ALONE
        role = SUB_VERTEX if named else MEMBER
        return Standing(tier=parent.tier + 1, parent=parent.id, root=parent.root, role=role)

    def _watch_roots(self, now_s: float, queue: Sequence[Beacon]) -> None:
        known = self._advanced
        self._advanced = {}
        for beacon in queue:
            root, since_s = known.get(beacon.id, (-1, now_s))
            if beacon.root != root or beacon.tier == 0:
                root, since_s = beacon.root, now_s
            self._advanced[beacon.id] = (root, since_s)

    def _best(self, now_s: float, queue: Sequence[Beacon]) -> Beacon | None:
        where = {beacon.id: beacon.position for beacon in queue}

        def order(beacon: Beacon) -> tuple[int, bool, float, int]:
            above = where.get(beacon.parent)
            away = dist(beacon.position, above) if above is not None else 0.0
            return (beacon.tier, beacon.id != self._parent, away, beacon.id)

        fit = [
            beacon
            for beacon in queue
            if 0 <= beacon.tier < MAX_TIER
            and beacon.parent != self._own_id
            and now_s - self._advanced[beacon.id][1] <= ROOT_SILENCE_S
        ]
        return min(fit, key=order, default=None)
