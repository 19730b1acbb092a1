"""The slow layer of Fig. 3: what an agent hears and sends of the structure on the multihop channel.

Labels of the census go any way. Leaders' summaries come down the trees: an agent takes one only
from a lower tier. Its followers' reports go up, with its own part, to its parent. A summary goes
out each round; with news sooner, as a Trickle timer does (RFC 6206).
"""

from collections.abc import Collection, Sequence
from math import ceil, inf, log
from operator import gt
from typing import Final

import msgspec

from agent.controller import HeardSummary
from agent.messages import MAX_PLACES, LeaderSummary, Place, Subtree, Summary, TreeReport
from agent.structure.census import Census
from agent.structure.convergecast import ROUNDS, Convergecast
from agent.structure.gathering import Gathering
from agent.structure.link_timing import Timing
from agent.structure.queue_map import QueueMap
from agent.structure.summary_frame import (
    LABEL_B,
    NEWS_B,
    ROOM_B,
    ReportTurns,
    length_of,
    news_that_fit,
)
from agent.structure.tree import Tree, latest_version

NEWS_SHARE: Final = 0.15
"""With news the next summary comes after this share of a round."""
NEWS_LOST, LEAST_LOSS = 0.2, 0.05
"""News is repeated until a neighbour has missed it with less than this probability, if beacons are
lost at all."""
LABELS_EVERY: Final = 2
"""Labels go out in each such round; in every round if beacons are lost."""
LONGEST_ROUND_S: Final = 10.0
VERTICES_A_ROUND: Final = 8
"""Reports on more vertices than this may take longer than a round, and hold for longer."""


class SlowLayer:
    """One agent's slow layer, with the ``summaries`` of each vertex's leader that it knows.

    round_s: period of the multihop channel [s]; infinite where it is off.
    """

    def __init__(
        self,
        own_id: int,
        mission: int,
        formation: QueueMap,
        census: Census,
        round_s: float,
        *,
        gathering: Gathering | None = None,
    ) -> None:
        self._mission, self._map, self._census = mission, formation, census
        self._round_s, self._gathering = round_s, gathering
        vertices = range(formation.vertices)
        self.summaries: list[LeaderSummary | None] = [None for _ in vertices]
        self.news = True
        """Whether something changed that others act on at once."""
        self._collected = [Convergecast(own_id) for _ in vertices]
        self._subtrees: list[Subtree | None] = [None for _ in vertices]
        self._offered: list[set[tuple[int, int]]] = [set() for _ in vertices]
        self._next_round_s = self._sent_s = -inf
        self._rounds = self._repeats = 0
        self._tellings = 1
        """How often a neighbour has to be told news, so that it most likely hears them."""
        self._turns = ReportTurns()
        self._labels = 0
        """How many labels are still to be sent in this round."""

    def hear(self, heard: Sequence[HeardSummary], trees: Sequence[Tree], now_s: float) -> None:
        """Take what comes up and down the trees, and the labels of the census."""
        for each in heard:
            sender, stamp_s, summary = each.sender, each.stamp_s, each.summary
            if summary.mission != self._mission:
                continue
            self._census.merge(summary, stamp_s, now_s, sender)
            if self._gathering is not None and summary.lines is not None:
                self._gathering.hear(sender, summary.lines, stamp_s, now_s)
            for report in summary.trees:
                if report.vertex < len(trees):
                    collected = self._collected[report.vertex]
                    collected.hear(sender, report.parent, report.up, stamp_s)
                    self._take_down(report, trees[report.vertex], now_s)

    def _take_down(self, report: TreeReport, tree: Tree, now_s: float) -> None:
        """Take a leader's summary from an agent of a lower tier."""
        v, down = report.vertex, report.down
        if down is None or down.root != tree.root or not 0 <= report.tier < tree.tier:
            return
        known = self.summaries[v]
        newer = known is None or known.root != down.root or down.version > known.version
        if newer and self._is_plausible(v, down, now_s):
            self.publish(v, down)

    def _is_plausible(self, vertex: int, down: LeaderSummary, now_s: float) -> bool:
        """Whether a leader may have written a summary by now.

        An invented version or order ahead of its time would shut out all that follow.
        """
        queues = len(self._map.homed[vertex])
        fits = len(down.counts) == len(down.highest) == queues
        in_time = down.order <= down.version <= latest_version(now_s)
        return fits and in_time and sum(down.counts) <= down.total <= self._census.most

    def publish(self, vertex: int, summary: LeaderSummary) -> None:
        """Keep a leader's latest summary; what agents act on at once is news."""
        known = self.summaries[vertex]
        self.news = self.news or known is None or _differ(known, summary)
        self.summaries[vertex] = summary

    def keep_to(self, vertex: int, tree: Tree) -> None:
        """Forget the summary of a leader that is no longer the root."""
        summary = self.summaries[vertex]
        if summary is not None and summary.root != tree.root:
            self.summaries[vertex] = None

    def collect(
        self,
        vertex: int,
        own: Subtree | None,
        seen: Collection[Place],
        now_s: float,
        timing: Timing,
    ) -> Subtree:
        """Return what a vertex's tree reports below the own agent, its own part included.

        own: None where the agent belongs to none of the vertex's queues; seen: places that it sees
        taken by unidentified vehicles.
        """
        homed = self._map.homed[vertex]
        self._collected[vertex].forget(self.oldest_s(now_s, timing))
        found = self._collected[vertex].total(own, len(homed))
        near = [p for p in seen if p.queue in homed or self._map.vertex_of.get(p) == vertex]
        if near:
            places = sorted({*(Place(*place) for place in found.blocked), *near})[:MAX_PLACES]
            found = msgspec.structs.replace(found, blocked=tuple(places))
        if found is not self._subtrees[vertex]:
            self._note_candidates(vertex, found)
            self._note_gap(vertex, found.highest)
            self._subtrees[vertex] = found
        return found

    def oldest_s(self, now_s: float, timing: Timing) -> float:
        """Return the stamp [s] before which a follower's report holds no longer."""
        rounds = ROUNDS * max(1.0, self._map.vertices / VERTICES_A_ROUND)
        rounds_s = rounds * min(self._round_s, LONGEST_ROUND_S) / (1.0 - timing.loss)
        return now_s - rounds_s - timing.latency_s

    def _note_candidates(self, vertex: int, subtree: Subtree) -> None:
        """Report soon that an agent could leave its queue."""
        offered = {(each.agent, each.to) for queue in subtree.candidates for each in queue}
        self.news = self.news or bool(offered - self._offered[vertex])
        self._offered[vertex] = offered

    def _note_gap(self, vertex: int, highest: Sequence[int]) -> None:
        """Report soon that a queue has a gap: its last number is above its count."""
        known = self.summaries[vertex]
        if known is not None and known.go and _exceed(highest, known.counts):
            before = self._subtrees[vertex]
            self.news = self.news or before is None or not _exceed(before.highest, known.counts)

    def due(self, trees: Sequence[Tree], timing: Timing, now_s: float) -> Summary | None:
        """Return what is due on the multihop channel, None where nothing is."""
        gathering = self._gathering
        if self.news or self._census.has_news or (gathering is not None and gathering.news):
            self._repeats = _enough_repeats(timing.loss)
        soon = self._repeats > 0 or self._turns.has_rest
        share = NEWS_SHARE if soon else 1.0
        if now_s - self._sent_s < share * self._round_s - 1e-6:
            return None
        self._sent_s, self.news = now_s, False
        if gathering is not None:
            gathering.news = False
        self._repeats = max(0, self._repeats - 1)
        self._tellings = _enough_repeats(timing.loss)
        self._begin_round(timing.loss, now_s)
        return self._filled([self._report(v, tree) for v, tree in enumerate(trees)], now_s)

    def _begin_round(self, loss: float, now_s: float) -> None:
        """Have labels sent, if a round begins now."""
        if now_s < self._next_round_s:
            return
        self._next_round_s = now_s + self._round_s - 1e-6
        self._rounds += 1
        if loss >= LEAST_LOSS or self._rounds % LABELS_EVERY == 1:
            self._labels = self._census.labels

    def _filled(self, reports: Sequence[TreeReport], now_s: float) -> Summary:
        """Return a summary with as much as fits: reports first, then lines, news and labels."""
        known = [each for each in reports if each.tier >= 0]
        waiting_b = NEWS_B * self._census.news_number + LABEL_B * self._labels
        trees = self._turns.take(known, waiting_b)
        room_b = ROOM_B - length_of(trees)
        lines = None
        if self._gathering is not None:
            lines, lines_b = self._gathering.wire(now_s, room_b // 2)
            room_b -= lines_b
        news = self._census.news(now_s, news_that_fit(room_b, self._labels), self._tellings)
        room_b -= NEWS_B * len(news)
        first, labels = self._census.wire(now_s, min(self._labels, room_b // LABEL_B))
        self._labels -= len(labels) // LABEL_B
        return Summary(self._mission, first, labels, news, trees, lines)

    def _report(self, vertex: int, tree: Tree) -> TreeReport:
        return TreeReport(
            vertex=vertex,
            tier=tree.tier,
            parent=tree.parent,
            down=self.summaries[vertex],
            up=self._subtrees[vertex] if tree.parent >= 0 else None,
        )


def _enough_repeats(loss: float) -> int:
    """Return in how many summaries news goes out sooner, so that most neighbours hear it."""
    return 1 if loss < LEAST_LOSS else 1 + ceil(log(NEWS_LOST) / log(loss))


def _differ(a: LeaderSummary, b: LeaderSummary) -> bool:
    """Whether two summaries differ in what agents act on at once."""
    return (a.root, a.total, a.counts, a.go, a.order, a.blocked) != (
        *(b.root, b.total, b.counts, b.go, b.order, b.blocked),
    ) or _exceed(a.highest, a.counts) != _exceed(b.highest, b.counts)


def _exceed(highest: Sequence[int], counts: Sequence[int]) -> bool:
    """Whether a queue's last number is above its count: then some number is free."""
    return any(map(gt, highest, counts))
