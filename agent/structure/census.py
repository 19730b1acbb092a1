"""The census: which members there are, and in which queue, counted so that none counts twice.

Each member has a label: the time at which it was last known to be there, and its queue then. Of two
labels of a member the later one holds, so labels may travel any way, any number of times. A member
whose label has not become later for longer than its way here explains is gone.

On the radio a label takes two bytes: its age in quanta of 0.25 s, and a code of its queue.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.messages import MAX_LABELS_B, Summary

QUANTUM_S = 0.25
"""Resolution of a label's time [s]."""
MAX_QUANTA = 254
UNKNOWN_AGE = 255
"""Age of a label of which nothing is known."""
CODES = 256
UNPLACED = 1
"""Code of a member without a queue."""
FIRST_QUEUE, FIRST_VERTEX = 2, 128
"""Codes of the members of queue j, and of the holder of vertex v, are these plus j or v."""
LAG_SMOOTHING = 0.25
LAGS = 2.0
"""A label may stand still for so many of its usual lags, besides T_lost."""
SHARED_LABELS = MAX_LABELS_B // 2
NEWS = 48
"""Most news in one frame."""

Labels = NDArray[np.int64]


class Population(NamedTuple):
    """The members of the team, by label."""

    total: int
    members: tuple[int, ...]  # of each queue, besides those in vertices
    holders: tuple[int, ...]  # of each vertex


class Census:
    """One agent's labels of all members. ids: number of agent ids of the run."""

    def __init__(self, own_id: int, ids: int) -> None:
        self._own = own_id
        self._ids = ids
        self._labels: Labels = np.zeros(0, np.int64)
        """Time [quanta] * CODES + code; 0: nothing known."""
        self._lag_s: NDArray[np.float64] = np.zeros(0)
        self._told: Labels = np.zeros(0, np.int64)
        """The codes that others were told last."""
        self._from = 0

    def hear(self, member: int, stamp_s: float, code: int) -> None:
        """Note a member heard directly, or the own agent."""
        if member >= self._ids:
            return
        self._make_room(member + 1)
        label = int(stamp_s / QUANTUM_S) * CODES + code
        if label > self._labels[member]:
            self._labels[member] = label
            self._lag_s[member] *= 1.0 - LAG_SMOOTHING

    def merge(self, summary: Summary, stamp_s: float, now_s: float) -> None:
        """Take the labels of another agent, as they were at its stamp [s]."""
        if summary.labels:
            raw = np.frombuffer(summary.labels[: len(summary.labels) // 2 * 2], "<u2")
            first = summary.first
            raw = raw[: max(0, self._ids - first)]
            self._adopt(np.arange(first, first + len(raw)), raw.astype(np.int64), stamp_s, now_s)
        news = [(member, label) for member, label in summary.news if member < self._ids]
        if news:
            members, labels = zip(*news, strict=True)
            self._adopt(np.array(members), np.array(labels, np.int64), stamp_s, now_s)

    def _adopt(
        self, members: NDArray[np.int64], wire: Labels, stamp_s: float, now_s: float
    ) -> None:
        if not len(members):
            return
        self._make_room(int(members.max()) + 1)
        age = wire // CODES
        at = int(stamp_s / QUANTUM_S) - age
        new = at * CODES + wire % CODES
        later = (age < UNKNOWN_AGE) & (new > self._labels[members]) & (members != self._own)
        if not later.any():
            return
        members, new, at = members[later], new[later], at[later]
        moved = self._labels[members] // CODES < at
        lag = np.maximum(now_s - at * QUANTUM_S, 0.0)
        before = self._lag_s[members]
        self._lag_s[members] = np.where(moved, before + LAG_SMOOTHING * (lag - before), before)
        self._labels[members] = new

    def population(self, now_s: float, lost_s: float, queues: int, vertices: int) -> Population:
        """Return who is there now. lost_s: T_lost of a neighbour [s]."""
        codes = self._labels[self._alive(now_s, lost_s)] % CODES
        counts = np.bincount(codes, minlength=CODES)
        return Population(
            total=len(codes),
            members=tuple(counts[FIRST_QUEUE : FIRST_QUEUE + queues].tolist()),
            holders=tuple(counts[FIRST_VERTEX : FIRST_VERTEX + vertices].tolist()),
        )

    def _alive(self, now_s: float, lost_s: float) -> NDArray[np.bool_]:
        silent_s = now_s - (self._labels // CODES) * QUANTUM_S
        return (self._labels > 0) & (silent_s <= lost_s + QUANTUM_S + LAGS * self._lag_s)

    def wire(self, now_s: float) -> tuple[int, bytes]:
        """Return the first id and the labels of one frame; of many ids other ones in each turn."""
        first = self._from if self._from < len(self._labels) else 0
        self._from = first + SHARED_LABELS
        return first, self._encoded(self._labels[first : first + SHARED_LABELS], now_s).tobytes()

    def news(self, now_s: float) -> tuple[tuple[int, int], ...]:
        """Return members whose queue changed since others were told; calling it counts as that."""
        changed = np.flatnonzero(self._labels % CODES != self._told)[:NEWS]
        if not len(changed):
            return ()
        self._told[changed] = self._labels[changed] % CODES
        wire = self._encoded(self._labels[changed], now_s)
        return tuple(zip(changed.tolist(), wire.tolist(), strict=True))

    @property
    def has_news(self) -> bool:
        """Whether a member's queue changed since others were told."""
        return bool((self._labels % CODES != self._told).any())

    def _encoded(self, labels: Labels, now_s: float) -> NDArray[np.uint16]:
        age = np.clip(int(now_s / QUANTUM_S) - labels // CODES, 0, MAX_QUANTA)
        age = np.where(labels > 0, age, UNKNOWN_AGE)
        return (age * CODES + labels % CODES).astype("<u2")

    def _make_room(self, members: int) -> None:
        missing = members - len(self._labels)
        if missing > 0:
            self._labels = np.pad(self._labels, (0, missing))
            self._told = np.pad(self._told, (0, missing))
            self._lag_s = np.pad(self._lag_s, (0, missing))
