"""Messages of each agent: how many were accepted, and how many rejected, by cause."""

from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple, Protocol

from netem.wire.frame import Count, Outgoing


class FrameCheck(Protocol):
    """Says which frames of some agents nobody would take who hears them."""

    def watches(self, agent: int) -> bool:
        """Return whether the frames of an agent are checked."""

    def refusal(self, sender: int, frame: Outgoing, sent_s: float) -> str | None:
        """Return the cause for which a frame is rejected; None where it is accepted.

        sent_s: when it is sent [s; simulated time].
        """


class SenderRow(NamedTuple):
    """The messages of one agent."""

    agent: int
    accepted: Count
    rejected: dict[str, Count]  # by cause


class SenderCounts:
    """Counts the messages of each agent. before: rows to go on from."""

    def __init__(self, before: Iterable[SenderRow] = ()) -> None:
        self._accepted: Counter[int] = Counter()
        self._rejected: dict[int, Counter[str]] = {}
        for agent, accepted, rejected in before:
            self._accepted[agent] = accepted
            if rejected:
                self._rejected[agent] = Counter(rejected)

    def count(self, agent: int, cause: str | None) -> None:
        """Count a message. cause: for which it is rejected; None: it is accepted."""
        if cause is None:
            self._accepted[agent] += 1
        else:
            self._rejected.setdefault(agent, Counter())[cause] += 1

    def rows(self) -> tuple[SenderRow, ...]:
        """Return a row for each agent of which any message came, in order of their ids."""
        return tuple(
            SenderRow(agent, self._accepted[agent], dict(self._rejected.get(agent, ())))
            for agent in sorted(self._accepted.keys() | self._rejected.keys())
        )


class CheckedFrames:
    """Counts frames that a check accepts or rejects. check: None: it counts none."""

    def __init__(self, check: FrameCheck | None, before: Iterable[SenderRow] = ()) -> None:
        self._check = check
        self._counts = SenderCounts(before)

    def note(self, sender: int, frames: Iterable[Outgoing], sent_s: float) -> None:
        """Take the frames that an agent sends at a time [s; simulated time]."""
        if self._check is not None and self._check.watches(sender):
            for frame in frames:
                self._counts.count(sender, self._check.refusal(sender, frame, sent_s))

    def rows(self) -> tuple[SenderRow, ...]:
        """Return a row for each sender that is watched."""
        return self._counts.rows()
