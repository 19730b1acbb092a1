"""What goes up a tree: each agent adds its own part to its followers' and tells its parent."""

from collections.abc import Sequence
from typing import Final, Generic, TypeVar

from agent.messages import (
    MAX_CANDIDATES,
    MAX_PLACES,
    MAX_TEAM,
    Candidate,
    Place,
    Subtree,
)
from agent.structure import histogram
from agent.structure.leader import CANDIDATES

ROUNDS: Final = 4.0
"""A follower's report holds for so many rounds at no loss."""

Part = TypeVar("Part")
"""What one agent reports of itself and of those that follow it."""


class Followers(Generic[Part]):
    """One agent's reports from its followers in one tree."""

    def __init__(self, own_id: int) -> None:
        self._own_id = own_id
        self._reports: dict[int, tuple[float, Part]] = {}

    def hear(self, sender: int, parent: int, part: Part | None, stamp_s: float) -> None:
        """Take an agent's report; one that names another parent ends what it told before.

        A report that was overtaken on its way counts for nothing. One whose part that goes up had
        no room in the frame leaves what was told before.
        """
        known = self._reports.get(sender)
        if known is not None and known[0] > stamp_s:
            return
        if parent != self._own_id:
            self._reports.pop(sender, None)
        elif part is not None:
            self._reports[sender] = (stamp_s, part)

    def forget(self, oldest_s: float) -> None:
        """Drop reports with a stamp before that time [s]."""
        self._reports = {s: kept for s, kept in self._reports.items() if kept[0] >= oldest_s}

    def followers(self) -> list[Part]:
        """Return the present reports of the followers."""
        return [part for _, part in self._reports.values()]


class Convergecast(Followers[Subtree]):
    """One agent's reports on the subtrees below it in one tree."""

    def __init__(self, own_id: int) -> None:
        super().__init__(own_id)
        self._parts: list[Subtree] = []
        self._total: Subtree | None = None

    def total(self, own: Subtree | None, queues: int) -> Subtree:
        """Return the sum of the followers' reports and the own part: the same one while they last.

        queues: number of queues that begin at the vertex.
        """
        parts = self.followers()
        if own is not None:
            parts.append(own)
        if self._total is None or parts != self._parts:
            self._parts, self._total = parts, joined(parts, queues)
        return self._total


def joined(parts: Sequence[Subtree], queues: int) -> Subtree:
    """Return the sum of some agents' parts. queues: number of queues that begin at the vertex."""
    if len(parts) == 1 and _is_plain(parts[0], queues):
        return parts[0]
    highest = [0] * queues
    candidates: list[set[Candidate]] = [set() for _ in range(queues)]
    blocked: set[Place] = set()
    histograms: list[bytes] = []
    for part in parts:
        if len(part.highest) != queues or len(part.candidates) != queues:
            continue
        for queue, number in enumerate(part.highest):
            highest[queue] = max(highest[queue], number)
        for queue, more in enumerate(part.candidates):
            if more:
                candidates[queue].update(more)
        blocked.update(Place(*place) for place in part.blocked)
        histograms.append(part.histogram)
    return Subtree(
        highest=tuple(highest),
        histogram=histogram.total(histograms),
        candidates=tuple(_cheapest(each) for each in candidates),
        blocked=tuple(sorted(blocked)[:MAX_PLACES]),
    )


def _is_plain(part: Subtree, queues: int) -> bool:
    """Whether a part is its own sum: a leaf's, nearly always."""
    plain = not any(part.candidates) and not part.blocked
    whole = len(part.histogram) == histogram.BINS
    return plain and whole and len(part.highest) == len(part.candidates) == queues


def _cheapest(candidates: set[Candidate]) -> tuple[Candidate, ...]:
    """Return the candidates with the least extra way to each other queue.

    The first to each queue come first: where the rest has no room, each queue still has some.
    """
    kept: dict[int, list[Candidate]] = {}
    for each in sorted(candidates):
        to_it = kept.setdefault(each.to, [])
        if len(to_it) < CANDIDATES:
            to_it.append(each)
    in_turn = sorted((k, each) for to_it in kept.values() for k, each in enumerate(to_it))
    return tuple([each for _, each in in_turn[:MAX_CANDIDATES]])


class OwnPart:
    """One agent's own part in one tree: the same one until it says something else.

    queues: those of the vertex.
    """

    def __init__(self, queues: Sequence[int]) -> None:
        self._queues = queues
        self._says: tuple[int, int, bytes, tuple[Candidate, ...]] | None = None
        self._part: Subtree | None = None

    def of(
        self, queue: int, number: int, away_m: float, candidates: tuple[Candidate, ...]
    ) -> Subtree:
        """Return the part; see :func:`own_part`."""
        says = queue, number, histogram.of_one(away_m), candidates
        if self._part is None or says != self._says:
            self._says = says
            self._part = own_part(self._queues, queue, number, away_m, candidates)
        return self._part


def own_part(
    queues: Sequence[int],
    queue: int,
    number: int,
    away_m: float,
    candidates: tuple[Candidate, ...],
) -> Subtree:
    """Return one agent's own part. queues: those of the vertex; away_m: distance from it [m]."""
    mine = [queue == j for j in queues]
    return Subtree(
        highest=tuple(min(number, MAX_TEAM) if each else 0 for each in mine),
        histogram=histogram.of_one(away_m) if any(mine) else histogram.EMPTY,
        candidates=tuple(candidates if each else () for each in mine),
        blocked=(),
    )
