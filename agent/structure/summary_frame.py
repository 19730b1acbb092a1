"""What goes into one summary: reports on trees first, then news of members, then their labels.

A frame of the radio has room for so many bytes. What does not fit comes in the next one, and it
comes first there. Each of the three has a share that the others leave it, so that none waits long.
"""

from collections.abc import Sequence
from typing import Final

import msgspec

from agent.codec import encode
from agent.comms.gossip import FRAME_HEAD_B, MAX_FRAME_B
from agent.messages import MAX_CANDIDATES, MAX_VERTICES, Subtree, TreeReport

SUMMARY_HEAD_B: Final = 22
"""Longest encoding of a Summary without reports, news and labels [B]."""
ROOM_B: Final = MAX_FRAME_B - FRAME_HEAD_B - SUMMARY_HEAD_B
"""Room for these in one frame [B]."""
MOST_REPORTS_B: Final = 2 * ROOM_B // 3
"""Reports leave the rest to news and labels, if there are any [B]."""
LARGEST_REPORT_B: Final = ROOM_B - 160
"""A longer report is sent in two parts: what comes down, and what goes up [B]."""
NEWS_B: Final = 7
LABEL_B: Final = 2
"""Longest encoding of one piece of news, and of one label [B]."""
_Part = tuple[int, bool]
"""A vertex, and whether the part only goes up."""


class ReportTurns:
    """The reports of one agent, frame by frame: each is sent once before any is sent again."""

    def __init__(self) -> None:
        self._sent: set[_Part] = set()
        self.has_rest = False
        """Whether some reports did not fit into the last frame."""

    def take(self, reports: Sequence[TreeReport], waiting_b: int) -> tuple[TreeReport, ...]:
        """Return the reports of one frame. waiting_b: length of the news and labels that wait."""
        if not self.has_rest:
            self._sent = set()
        left = [
            part
            for report in reports
            for part in _parts(report)
            if (part.vertex, part.down is None) not in self._sent
        ]
        taken = left[: _fitting(left, max(MOST_REPORTS_B, ROOM_B - waiting_b))]
        self._sent.update((part.vertex, part.down is None) for part in taken)
        self.has_rest = len(taken) < len(left)
        return tuple(taken)


def length_of(reports: Sequence[TreeReport]) -> int:
    """Return the length of some reports in a frame [B]."""
    return sum(len(encode(each)) for each in reports)


def news_that_fit(room_b: int, labels: int) -> int:
    """Return how many news fit beside labels; of little room labels keep half."""
    return max(room_b // 2, room_b - LABEL_B * labels) // NEWS_B


def _fitting(reports: Sequence[TreeReport], room_b: int) -> int:
    """Return how many of the first reports fit, at least one."""
    length_b = 0
    for number, each in enumerate(reports):
        length_b += len(encode(each))
        if number == MAX_VERTICES or (number > 0 and length_b > room_b):
            return number
    return len(reports)


def _parts(report: TreeReport) -> list[TreeReport]:
    """Return a report in one part, or in two if it is too long."""
    if report.up is None or len(encode(report)) <= LARGEST_REPORT_B:
        return [report]
    up = _shortened(msgspec.structs.replace(report, down=None), report.up)
    return [msgspec.structs.replace(report, up=None), up] if report.down is not None else [up]


def _shortened(report: TreeReport, up: Subtree) -> TreeReport:
    """Return a report with as many candidates of each queue as fit, the first ones.

    The others are reported once these have moved.
    """
    for number in range(MAX_CANDIDATES, 0, -1):
        kept = tuple(each[:number] for each in up.candidates)
        short = msgspec.structs.replace(up, candidates=kept)
        report = msgspec.structs.replace(report, up=short)
        if len(encode(report)) <= LARGEST_REPORT_B:
            break
    return report
