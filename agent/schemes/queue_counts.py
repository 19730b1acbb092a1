"""How many members each queue has, as the agent at the main queue vertex tells it.

It goes on the multihop channel in the summary that the adaptive Q-structure's leaders send, with
everything else empty: so its bytes are counted as those of any scheme.
"""

from collections.abc import Sequence

from agent.controller import HeardSummary
from agent.messages import LeaderSummary, RootKey, Summary, TreeReport


def counts_told(mission: int, own_id: int, now_s: float, counts: Sequence[int]) -> Summary:
    """Return the vertex agent's summary of its mission. now_s [s]; counts: of each queue."""
    down = LeaderSummary(
        root=RootKey(0, own_id),
        version=round(100.0 * now_s),
        total=1 + sum(counts),
        counts=tuple(counts),
        highest=(),
        histogram=b"",
        go=True,
        order=0,
        orders=(),
        blocked=(),
    )
    report = TreeReport(vertex=0, tier=0, parent=-1, down=down, up=None)
    return Summary(mission=mission, first=0, labels=b"", news=(), trees=(report,))


def counts_heard(heard: HeardSummary, mission: int, queues: int) -> list[int] | None:
    """Return the counts in a summary; None where it tells none of so many queues."""
    summary = heard.summary
    if summary.mission != mission or not summary.trees or summary.trees[0].down is None:
        return None
    counts = summary.trees[0].down.counts
    return list(counts) if len(counts) == queues else None
