"""The census: which members there are, and in which queue, counted so that none counts twice.

Each member has a label: the time at which it was last known to be there, and a code of where it was
then. Of two labels of a member the later one holds, so labels may travel any way, any number of
times. A label that stands still for longer than its usual lag and T_lost is late. Then the agent
sends the label that it has as news, and a neighbour that knows a later one sends that. Without an
answer the member is gone.

In memory a label is one number: its time in quanta of 0.25 s, times CODES, plus its code. On the
radio it takes two bytes: the greatest label of the time at which it is sent, less the label.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Sequence
from functools import lru_cache
from math import inf
from struct import pack, unpack_from
from typing import Final, NamedTuple

from agent.messages import MAX_LABELS_B, MAX_TEAM, Summary
from agent.structure.label_code import CODES, FIRST_VERTEX, queue_of_code
from agent.structure.label_news import OWN, LabelNews
from agent.structure.summary_frame import LABEL_B

QUANTUM_S: Final = 0.25
"""Resolution of a label's time [s]."""
UNKNOWN: Final = 0xFFFF
"""The label on the radio of a member of which nothing is known."""
MAX_QUANTA: Final = 254
WORTH_QUANTA: Final = 2
"""A repeated label is taken if it is so much later: to take each would cost time for nothing."""
LAG_SMOOTHING: Final = 0.25
SLOWER_THAN_NEWS: Final = 6.0
"""How many times as long as news a repeated label is taken to need at first: each agent on its way
keeps it for a round or two. Over a clean radio it is up to twice as much; but whether frames are
lost is not known yet, and where they are, a team that asks too late counts itself wrongly."""
LAGS: Final = 2.0
"""A label is late after so many of its usual lags, and T_lost."""
MAX_LAG_S: Final = MAX_QUANTA * QUANTUM_S / LAGS
"""Greatest lag that is noted [s]: no label is sent that is older than LAGS times as much."""
MAX_LABELLED: Final = 2**14
"""Ids from here on are not counted."""
LABEL_S: Final = QUANTUM_S / CODES
"""Time of one step of a label [s]."""
NOTHING_KNOWN: Final = 0
"""The code of a member of which nothing is known."""
ASK_S: Final = 0.5
FORGOTTEN_S: Final = 10.0
"""A member whose label is late is asked for every ASK_S, until FORGOTTEN_S later."""
SHARED_LABELS: Final = MAX_LABELS_B // LABEL_B
NEWS: Final = 48
"""Most news in one frame."""


class Population(NamedTuple):
    """The members of the team, by label."""

    total: int
    members: tuple[int, ...]  # of each queue, besides those in vertices
    holders: tuple[int, ...]  # of each vertex
    changed_s: float = 0.0  # when a label with another code than before came last [s]


class Census:
    """One agent's labels of all members. ids: number of agent ids of the run."""

    def __init__(self, own_id: int, ids: int) -> None:
        self._own = own_id
        self._ids = min(ids, MAX_LABELLED)
        self._labels: list[int] = []
        self._codes: list[int] = []
        """The codes of the labels."""
        self._holders: dict[int, list[int]] = {}
        """The known members with each code, ascending."""
        self._lag_s: list[float] = []
        """How old labels are when they arrive, by member [s]."""
        self._news = LabelNews()
        self._asked_s: dict[int, float] = {}
        """When a member was last asked for [s]."""
        self._from = 0
        """The first id of the next frame's labels."""
        self._changed_s = 0.0
        self.version = 0
        """How often a member's code changed, or a new member became known."""
        self._deadline_s: list[float] = []
        """T_lost before a member is late, by member [s]; infinite for one that is unknown."""
        self._earliest_s = inf
        """None of these is earlier [s]."""

    @property
    def most(self) -> int:
        """The greatest number of members."""
        return min(self._ids, MAX_TEAM)

    @property
    def has_news(self) -> bool:
        """Whether there is a member of which others are to be told."""
        return self._news.has_untold

    @property
    def news_number(self) -> int:
        """How many news one frame would hold, if there is room."""
        return min(len(self._news), NEWS)

    @property
    def labels(self) -> int:
        """How many labels are passed on in one round."""
        return min(len(self._labels), SHARED_LABELS)

    def hear(self, member: int, stamp_s: float, code: int) -> None:
        """Note a member heard directly, or the own agent."""
        if member >= self._ids:
            return
        self._make_room(member + 1)
        label = int(stamp_s / QUANTUM_S) * CODES + code
        if label > self._labels[member]:
            self._lag_s[member] *= 1.0 - LAG_SMOOTHING
            self._set(member, label, stamp_s)

    def merge(self, summary: Summary, stamp_s: float, now_s: float, sender: int) -> None:
        """Take the labels of another agent, as they were at its stamp [s]."""
        greatest = int(stamp_s / QUANTUM_S) * CODES + CODES - 1
        known, told_again = len(self._labels), self._news.tellings
        for member, wire in summary.news:
            label = greatest - wire
            # Most news is known already: that has to cost little.
            told = member < known and 0 <= self._labels[member] - label < WORTH_QUANTA * CODES
            if told:
                if member in told_again and label % CODES == self._codes[member]:
                    self._news.hear(member, sender)
            elif member < self._ids and wire != UNKNOWN:
                self._compare(member, label, now_s, sender)
        if summary.labels:
            self._merge_run(summary.first, summary.labels, greatest, now_s)

    def _compare(self, member: int, label: int, now_s: float, sender: int) -> None:
        """Take a later label of a member; answer a much older one."""
        if member >= len(self._labels):
            self._make_room(member + 1)
        known = self._labels[member]
        if label > known and member != self._own:
            if self._codes[member] == label % CODES and label >= known + WORTH_QUANTA * CODES:
                self._adopt(member, label, now_s)  # no event, but an answer: repeated as well
            else:
                self._expect_later(member, now_s - label // CODES * QUANTUM_S)
                self._set(member, label, now_s, sender)
        elif label + WORTH_QUANTA * CODES <= known:
            self._news.add(member)

    def _expect_later(self, member: int, age_s: float) -> None:
        """Estimate a new member's lag by the age of its first label, which came as news [s]."""
        if self._labels[member] == 0:
            self._lag_s[member] = min(MAX_LAG_S, SLOWER_THAN_NEWS * age_s)

    def ask(self, now_s: float, lost_s: float) -> None:
        """Ask for members whose labels are late. lost_s: T_lost of a neighbour [s]."""
        oldest_s = now_s - lost_s
        if self._earliest_s >= oldest_s:
            return
        self._earliest_s = min(self._deadline_s)
        if self._earliest_s >= oldest_s:
            return
        forgotten = int((oldest_s - FORGOTTEN_S) / QUANTUM_S) * CODES
        for member in [m for m, each_s in enumerate(self._deadline_s) if each_s < oldest_s]:
            known = self._labels[member] > forgotten
            if known and now_s - self._asked_s.get(member, 0.0) >= ASK_S:
                self._asked_s[member] = now_s
                self._news.add(member)

    def _merge_run(self, first: int, labels: bytes, greatest: int, now_s: float) -> None:
        sent: list[int] = _unpacked(labels)
        end = min(first + len(sent), self._ids)
        self._make_room(end)
        limit = greatest - WORTH_QUANTA * CODES
        known = self._labels[first:end]
        later = [k for k, label in enumerate(known) if label + sent[k] < limit]
        for k in later:
            if sent[k] != UNKNOWN:
                self._adopt(first + k, greatest - sent[k], now_s)

    def _adopt(self, member: int, label: int, now_s: float) -> None:
        """Take a repeated label, and note its age in the member's usual lag."""
        if member == self._own:
            return
        age_s = now_s - label // CODES * QUANTUM_S
        lag_s = 0.0 if age_s < 0.0 else age_s if age_s < MAX_LAG_S else MAX_LAG_S
        self._lag_s[member] += LAG_SMOOTHING * (lag_s - self._lag_s[member])
        self._set(member, label, now_s)

    def _set(self, member: int, label: int, now_s: float, source: int = OWN) -> None:
        code, before = label % CODES, self._codes[member]
        if code != before:
            self._codes[member] = code
            if before != NOTHING_KNOWN:
                self._holders[before].remove(member)
            if code != NOTHING_KNOWN:
                insort(self._holders.setdefault(code, []), member)
            self._news.add_event(member, source)
            self.version += 1
            if member != self._own and now_s > self._changed_s:
                self._changed_s = now_s
        self._labels[member] = label
        deadline_s = label * LABEL_S + LAGS * self._lag_s[member]
        self._deadline_s[member] = deadline_s
        self._earliest_s = min(self._earliest_s, deadline_s)

    def population(self, now_s: float, lost_s: float, queues: int, vertices: int) -> Population:
        """Return who is there now. lost_s: T_lost of a neighbour, and time for an answer [s]."""
        members, leaders = [0] * queues, [0] * vertices
        total = 0
        for code in self._holders:
            there = len(self.present(now_s, lost_s, (code,)))
            total += there
            if (queue := queue_of_code(code, queues)) >= 0:
                members[queue] += there
            elif FIRST_VERTEX <= code < FIRST_VERTEX + vertices:
                leaders[code - FIRST_VERTEX] += there
        return Population(total, tuple(members), tuple(leaders), self._changed_s)

    def present(self, now_s: float, lost_s: float, codes: Sequence[int]) -> list[int]:
        """Return the members with some codes that are there, by code and id.

        lost_s: as for the population [s].
        """
        oldest_s = now_s - lost_s - QUANTUM_S
        labels, lag_s = self._labels, self._lag_s
        return [
            member
            for code in codes
            for member in self._holders.get(code, ())
            if labels[member] * LABEL_S >= oldest_s - LAGS * lag_s[member]
        ]

    def wire(self, now_s: float, most: int = SHARED_LABELS) -> tuple[int, bytes]:
        """Return the first id and the labels of one frame; of more ids other ones in each turn."""
        if most < 1:
            return 0, b""
        first, end = self._from, self._from + min(most, SHARED_LABELS)
        self._from = end if end < len(self._labels) else 0
        return first, _packed(_on_the_radio(self._labels[first:end], now_s))

    def news(
        self, now_s: float, most: int = NEWS, tellings: int = 1
    ) -> tuple[tuple[int, int], ...]:
        """Return the labels that others are to be told. tellings: how many of one are enough."""
        self._news.enough = tellings
        told = self._news.take(min(most, NEWS))
        wire = _on_the_radio([self._labels[member] for member in told], now_s)
        return tuple(zip(told, wire, strict=True))

    def _make_room(self, members: int) -> None:
        missing = members - len(self._labels)
        if missing > 0:
            self._labels += [0] * missing
            self._codes += [NOTHING_KNOWN] * missing
            self._lag_s += [0.0] * missing
            self._deadline_s += [inf] * missing


def _on_the_radio(labels: list[int], now_s: float) -> list[int]:
    """Return labels as they are sent at a time [s]."""
    greatest = int(now_s / QUANTUM_S) * CODES + CODES - 1
    oldest = max(1, greatest - MAX_QUANTA * CODES - (CODES - 1))
    return [
        (greatest - each if each <= greatest else CODES - 1 - each % CODES)
        if each >= oldest
        else UNKNOWN
        for each in labels
    ]


def _packed(labels: list[int]) -> bytes:
    return pack(f"<{len(labels)}H", *labels)


@lru_cache(maxsize=64)
def _unpacked(labels: bytes) -> list[int]:
    """Return labels as they were sent; several agents hear the same, and none changes the list."""
    number = len(labels) // LABEL_B
    return list(unpack_from(f"<{number}H", labels))
