"""The tree of one vertex: its root, each agent's parent and tier (Algorithm 1, lines 1-11; E15).

The vertex's leader is the root. It states its time in every beacon, and each agent passes on the
latest time that it heard (the *version*). Of two roots the one with the lower key wins. A root
whose version stands still is void, and stays so until its version has gone on by ``REVIVAL_S``:
otherwise the last words of a dead root would go round for ever.

A parent has the lowest tier among the agents heard of the same root that stay in range; the present
parent is kept as long as it is as good. What comes from the root is taken only from agents
of a lower tier, and what goes to it is sent to the parent.
"""

from collections.abc import Collection
from math import dist, inf
from typing import Final, final

from agent.controller import Heard
from agent.heard_beacon import HeardBranch
from agent.messages import Branch, RootKey, Vector
from agent.vectors import apart

VERSIONS_PER_S: Final = 100.0
REVIVAL_S: Final = 1.0
NEW_PARENT_STAYS_S: Final = 2.5
PARENT_STAYS_S: Final = 1.0
"""A parent that leaves the range within this time counts as LEAVING tiers worse: so an agent looks
for another before its parent is lost, and keeps the present one longer than it takes a new one."""
LEAVING: Final = 2
APART_MPS: Final = 0.05
"""Two agents that part more slowly than this stay where they are."""
KEPT: Final = 3.0
"""The present parent counts as LEAVING after so many times the silence of a new one: links that go
down for a moment make no agent change its parent to and fro."""
STILL: Final = 0.8
"""The version stands still when it has not gone on for this part of a parent's silence."""
MAX_TIER: Final = 1000
VOID_KEPT: Final = 32


@final
class Follower:
    """An agent heard, with its branch in this tree."""

    def __init__(self, heard: Heard, branch: HeardBranch) -> None:
        self.heard = heard
        self.root, self.version = branch.root, branch.version
        self.tier, self.parent = branch.tier, branch.parent


def version_at(time_s: float) -> int:
    """Return a root's version at a time [s]."""
    return round(time_s * VERSIONS_PER_S)


def latest_version(now_s: float) -> int:
    """Return the latest version that a root may have stated by now: clocks and stamps differ."""
    return version_at(now_s + 1.0)


class Tree:
    """One agent's view of one vertex's tree, with its own ``parent`` and ``tier``."""

    def __init__(self, own_id: int, now_s: float) -> None:
        self._own_id = own_id
        self.root: RootKey | None = None
        self.version = 0
        self.parent, self.tier = -1, -1
        self.advanced_s = now_s
        """When the version last went on, or the root was last void [s]."""
        self._void: dict[RootKey, int] = {}

    @property
    def branch(self) -> Branch | None:
        """The own branch, for the beacon."""
        if self.root is None:
            return None
        return Branch(self.root, self.version, self.tier, self.parent)

    def take_root(self, key: RootKey, now_s: float) -> None:
        """Become the root."""
        self.root, self.version, self.advanced_s = key, version_at(now_s), now_s

    def follow_root(
        self, now_s: float, followers: Collection[Follower], leading: RootKey | None, root_s: float
    ) -> bool:
        """Take the best root and its latest version; return whether the root is not the own one.

        leading: the own key, if the own agent leads this vertex; root_s: how long the version of
        any other may stand still [s].
        """
        if leading is not None and self.root == leading:
            self.version, self.advanced_s = version_at(now_s), now_s
        elif self.root is not None and now_s - self.advanced_s > root_s:
            self._make_void(self.root)
            self.root = None
        latest = latest_version(now_s)
        for each in followers:
            self._compare(each, now_s, latest)
        return self.root != leading

    def _compare(self, other: Follower, now_s: float, latest: int) -> None:
        key, version = other.root, other.version
        if version > latest or key.id == self._own_id:
            return
        same = key == self.root
        known = self.version if same else self._void.get(key, -1)
        if version > known and (same or self.root is None or key <= self.root):
            self.root, self.version, self.advanced_s = key, version, now_s

    def _make_void(self, key: RootKey) -> None:
        self._void.pop(key, None)
        self._void[key] = self.version + version_at(REVIVAL_S)
        while len(self._void) > VOID_KEPT:
            del self._void[next(iter(self._void))]

    def stands_still(self, now_s: float, parent_s: float) -> bool:
        """Whether the root's version does not go on, so that no parent is better than the present.

        If agents went on to choose among each other, their tiers would count up in loops.
        """
        led = self.root is not None and self.root.id == self._own_id
        return self.parent >= 0 and not led and now_s - self.advanced_s > STILL * parent_s

    def choose_parent(
        self,
        here: Vector,
        velocity: Vector,
        followers: list[Follower],
        reach_m: float,
        parent_s: float = inf,
    ) -> None:
        """Choose the parent. followers: the agents heard.

        here, velocity: own [m, m/s; world frame]; reach_m: the range as measured [m]; parent_s:
        after a longer silence only the present parent is still one, if there is no better [s].
        """
        root, own_id = self.root, self._own_id
        if root is None or root.id == own_id:
            self.parent, self.tier = -1, (-1 if root is None else 0)
            return
        link = _OwnLink(here, velocity, reach_m, self.parent, KEPT * parent_s)
        heard_of = {each.heard.id: each.heard for each in followers}
        best: _Order | None = None
        tier = -1
        for each in followers:
            current = each.heard.id == self.parent
            if (
                0 <= each.tier < MAX_TIER
                and (current or each.heard.age_s < parent_s)
                and each.parent != own_id
                and (best is None or _least_tier(each) <= best[0])
                and each.root == root
            ):
                found = link.order(each, heard_of.get(each.parent))
                if best is None or _precedes(found, best):
                    best, tier = found, each.tier + 1
        self.parent = best[3] if best is not None else -1
        self.tier = tier


_Order = tuple[int, bool, float, int]
"""Of two agents the one with the lesser order is the better parent."""


def _precedes(one: _Order, other: _Order) -> bool:
    """Whether an order is less than another one; compiled code compares tuples far more slowly."""
    if one[0] != other[0]:
        return one[0] < other[0]
    if one[1] != other[1]:
        return other[1]
    if one[2] != other[2]:
        return one[2] < other[2]
    return one[3] < other[3]


@final
class _OwnLink:
    """What decides how good a parent an agent is, on the own side."""

    def __init__(
        self,
        here: Vector,  # [m; world frame]
        velocity: Vector,  # [m/s; world frame]
        reach_m: float,
        parent: int,  # the present one
        kept_s: float,  # silence after which the present parent counts as leaving [s]
    ) -> None:
        self.here = here
        self.velocity = velocity
        self.reach_m = reach_m
        self.parent = parent
        self.kept_s = kept_s

    def order(self, other: Follower, above: Heard | None) -> _Order:
        """Return where an agent stands among the parents there may be. above: its parent."""
        heard = other.heard
        current = heard.id == self.parent
        horizon_s = PARENT_STAYS_S if current else NEW_PARENT_STAYS_S
        silent = heard.age_s >= self.kept_s  # of the present parent alone
        leaves = silent or _leaves(self.here, self.velocity, heard, horizon_s, self.reach_m)
        to_its_parent = dist(heard.position, above.position) if above is not None else 0.0
        tier = _least_tier(other) + (LEAVING if leaves else 0)
        return tier, not current, to_its_parent, heard.id


def _least_tier(each: Follower) -> int:
    """Return the tier that an agent counts as if it stays in range."""
    return each.tier + (0 if each.heard.hears_me else 1)


def _leaves(here: Vector, velocity: Vector, other: Heard, horizon_s: float, reach_m: float) -> bool:
    """Whether another agent leaves the range within a time, if both fly on as now."""
    x, y, z = here
    u, v, w = velocity
    there_x, there_y, there_z = other.position
    their_u, their_v, their_w = other.velocity
    away_m = apart(here, other.position)
    opening = (
        (there_x - x) * (their_u - u)
        + (there_y - y) * (their_v - v)
        + (there_z - z) * (their_w - w)
    )
    rate_mps = opening / max(away_m, 1e-9)
    return rate_mps > APART_MPS and away_m + horizon_s * rate_mps > reach_m
