"""Gathering: the members of a queue form its line where they are, then it flies off to its vertex.

The paper expects this of its structure (Sec. 3.1, advantage i). A member reports up the tree of its
queue how far it is from its slot. The leader of the queue's vertex displaces the whole queue by the
mean of these ways, and says so: a :class:`~agent.messages.Line`. Members fly to their displaced
slots. Once all are there, or the time for it is over, the displacement shrinks to zero.

A line goes from agent to agent, and the latest version holds. It says when it leaves and arrives,
so nobody waits for a word that is lost. Who hears of no line, is in distress or comes late flies
straight to its slot, and so does the leader of a vertex.
"""

from collections.abc import Sequence
from math import dist, hypot, inf
from typing import Final

import msgspec

from agent.config import AgentSetup
from agent.messages import (
    MAX_CENTISECONDS,
    MAX_LINES,
    MAX_TEAM,
    LeaderSummary,
    Line,
    LinePart,
    Lines,
    Vector,
)
from agent.places.place_points import OwnTarget
from agent.qstructure.orientation import FREE
from agent.structure.claim import NO_QUEUE, Claim
from agent.structure.convergecast import Followers
from agent.structure.line import (
    CM,
    centimetres,
    clear_displacement,
    displacement_of,
    flight_s,
    has_arrived,
    has_left,
)
from agent.structure.queue_map import QueueMap
from agent.structure.tree import VERSIONS_PER_S, Tree, latest_version, version_at
from agent.structure.view import View

GATHERED_M: Final = 0.3
"""A member nearer than this to its place of the line has gathered."""
LEAST: Final = 2.0
"""A queue that would be displaced by less than so many times the spacing does not gather."""
GATHER_S: Final = 5.0
"""A line waits for its members for so long, and for the time of its straight flight, at most."""
SPEED_SHARE, LEAST_SPEED_SHARE = 0.9, 0.2
"""The line is slower than its members, so that late ones catch up."""
LONGEST_S, LONGEST_WAYS = 12.0, 6.0
"""No member gathers for longer than this time and so many straight flights to its slot."""
MOST_S: Final = 600.0
"""No line arrives so long after its version, so one that was invented ends, too."""
COLLECT_S, COLLECT_LATENCIES = 1.0, 4.0
"""How long a leader waits for its members' reports; then half of them are enough."""
CLOSED: Final = 4.0
"""After so many times as long a queue without a line gets none."""
CLEAR: Final = 0.75
"""Members of two lines keep apart by so many times the spacing."""
MOST_B, HEAD_B = 300, 8
"""Most bytes in one frame, and those of the arrays around lines and parts."""
_Entry = Line | LinePart
_length_of = msgspec.msgpack.Encoder().encode


class Gathering:
    """One agent's part in gathering: what it knows of each queue's line, and where it flies."""

    def __init__(self, setup: AgentSetup, formation: QueueMap) -> None:
        queues = range(formation.queues)
        self._map = formation
        self._speed_mps = min(setup.vehicle.max_speed_mps, setup.vehicle.max_climb_mps)
        spacing_m = setup.control.spacing_m
        self._clear_m, self._least_m = CLEAR * spacing_m, LEAST * spacing_m
        self.lines: list[Line | None] = [None for _ in queues]
        self.news = False
        """Whether something changed that others act on at once."""
        self._collected = [Followers[LinePart](setup.id) for _ in queues]
        self._totals: list[LinePart] = [_sum(j, -1, ()) for j in queues]
        self._queue, self._until_s = NO_QUEUE, inf
        """The queue whose line the agent joined, and until when it may fly with it [s]."""
        self._straight = False
        """Whether it flies straight to its slot from now on."""
        self._asked_s: dict[int, float] = {}
        """Since when the leader waits for reports of a queue [s]."""
        self._ready_s: dict[int, float] = {}
        """Since when all of a queue's members are ready [s]."""
        self._compared: dict[int, tuple[int, ...]] = {}
        """Which versions a queue's line was last compared with, to keep clear of them."""
        self._turn = 0

    def hear(self, sender: int, heard: Lines, stamp_s: float, now_s: float) -> None:
        """Take what an agent says of lines: the latest version of each, and its followers."""
        latest, queues = latest_version(now_s), self._map.queues
        for line in heard.lines:
            plausible = line.version <= latest and line.leaves <= line.arrives
            if line.queue < queues and plausible and _ends(line):
                known = self.lines[line.queue]
                if known is None or line.version > known.version:
                    self._publish(line)
        for part in heard.parts:
            if part.queue < queues:
                self._collected[part.queue].hear(sender, part.parent, part, stamp_s)

    def update(self, view: View, claim: Claim, trees: Sequence[Tree], oldest_s: float) -> None:
        """Decide whether to fly with the line, and sum up what goes up the trees.

        oldest_s: reports with an earlier stamp hold no longer [s].
        """
        own = self._own_part(view, claim, trees)
        for j, collected in enumerate(self._collected):
            collected.forget(oldest_s)
            parts = collected.followers()
            if own is not None and own.queue == j:
                parts.append(own)
            before = self._totals[j]
            total = self._totals[j] = _sum(j, trees[self._map.home[j]].parent, parts)
            changed = (before.members, before.ready) != (total.members, total.ready)
            self.news = self.news or (changed and self._is_told(total, view.now_s))

    def displaced(self, own: OwnTarget, claim: Claim, now_s: float) -> OwnTarget:
        """Return a member's target in its queue's line; its attitude is free until that arrives."""
        line = self.lines[claim.queue] if claim.number > 0 and not claim.leads else None
        if line is None or self._straight or claim.queue != self._queue:
            return own
        if has_arrived(line, now_s):
            return own
        moved = _add(own.slot.point, displacement_of(line, now_s))
        slot = own.slot._replace(point=moved, attitude=FREE)
        return OwnTarget(own.place, slot, own.vertex)

    def queues(self, now_s: float) -> frozenset[int]:
        """Return the queues whose lines wait or fly."""
        return frozenset([e.queue for e in self.lines if e and not has_arrived(e, now_s)])

    def lead(self, view: View, vertex: int, summary: LeaderSummary) -> None:
        """Look after the lines of the queues that begin at a vertex, as its leader."""
        if not summary.go:
            return
        for j, members in zip(self._map.homed[vertex], summary.counts, strict=True):
            line, settled = self.lines[j], members == view.shares[j]
            if line is None:
                self._begin(view, j, members, settled)
            elif not has_left(line, view.now_s):
                self._look_after(view, line, members, settled)

    def wire(self, now_s: float, room_b: int) -> tuple[Lines | None, int]:
        """Return as much as fits of what is to be said, in turn, and its length [B]."""
        flying = [line for line in self.lines if line and not has_arrived(line, now_s)]
        told = [total for total in self._totals if self._is_told(total, now_s)]
        entries: list[_Entry] = [*flying, *told]
        if not entries:
            return None, 0
        first = self._turn % len(entries)
        taken, length_b = list[_Entry](), HEAD_B
        for entry in [*entries[first:], *entries[:first]][:MAX_LINES]:
            length_b += len(_length_of(entry))
            if length_b > min(MOST_B, room_b):
                break
            taken.append(entry)
        self._turn = first + len(taken)
        lines = tuple(each for each in taken if isinstance(each, Line))
        said = Lines(lines, tuple(each for each in taken if isinstance(each, LinePart)))
        return said, len(_length_of(said))

    def _is_told(self, total: LinePart, now_s: float) -> bool:
        """Whether the leader has to know: before there is a line, and until it leaves."""
        line = self.lines[total.queue]
        if total.parent < 0 or (line is None and total.members < 1):
            return False
        return line is None or not has_left(line, now_s)

    def _own_part(self, view: View, claim: Claim, trees: Sequence[Tree]) -> LinePart | None:
        """Return the own part of a queue's members; None without a place in one."""
        queue, number = claim.queue, claim.number
        slot = self._map.slot(queue, number, view.extent(queue, number)) if number > 0 else None
        if slot is None:
            return None
        away, tree = _subtract(view.origin, slot.point), trees[self._map.home[queue]]
        if claim.leads:
            return LinePart(queue, tree.parent, 0, 1, 0, 0, 0)
        line = self.lines[queue]
        self._choose(away, line, claim, tree.tier >= 0, view.now_s)
        if self._straight:
            return LinePart(queue, tree.parent, 0, 1, 0, 0, 0)
        ready = line is not None and dist(away, displacement_of(line, view.now_s)) < GATHERED_M
        return LinePart(queue, tree.parent, 1, int(ready), *centimetres(away))

    def _choose(
        self, away: Vector, line: Line | None, claim: Claim, follows: bool, now_s: float
    ) -> None:
        """Decide whether to fly straight. away: from the own slot [m]."""
        away_m = hypot(*away)
        if away_m < GATHERED_M:
            self._straight = True
        if line is None or self._straight:
            return
        if claim.queue != self._queue:
            self._straight = has_left(line, now_s)
            if self._queue == NO_QUEUE:
                self._until_s = now_s + LONGEST_S + LONGEST_WAYS * away_m / self._speed_mps
            self._queue = claim.queue
        farther = dist(away, displacement_of(line, now_s)) > away_m
        self._straight = self._straight or farther or not follows or now_s > self._until_s

    def _begin(self, view: View, queue: int, members: int, settled: bool) -> None:
        """Displace a queue by its members' mean way, once they have reported.

        settled: whether the queue has its share of members, so that nobody is ordered away.
        """
        waited_s = view.now_s - self._asked_s.setdefault(queue, view.now_s)
        patience_s = COLLECT_S + COLLECT_LATENCIES * view.timing.latency_s
        total = self._totals[queue]
        enough = waited_s > patience_s and 2 * total.members >= members
        reported = total.members >= 2 and (enough or total.members >= members)
        if not (settled and reported) or waited_s > CLOSED * patience_s:
            return
        mean = (total.x / CM, total.y / CM, total.z / CM)
        wanted, room_m = self._clear(view, queue, mean)
        least_m = min(hypot(*mean), hypot(*wanted))
        if least_m < self._least_m or room_m < 0.5 * self._clear_m:
            self._asked_s[queue] = -inf
            return
        leaves_s = view.now_s + GATHER_S + hypot(*wanted) / self._speed_mps
        line = self._line(view, queue, wanted, leaves_s)
        if _ends(line):
            self._publish(line)

    def _look_after(self, view: View, line: Line, members: int, settled: bool) -> None:
        """Let a line leave once its members are ready; until then, keep it clear of others."""
        present = (line.x / CM, line.y / CM, line.z / CM)
        if settled and self._totals[line.queue].ready >= members:
            # Reports of members that went to other queues may still be on their way.
            since_s = self._ready_s.setdefault(line.queue, view.now_s)
            # All members have heard of it by then, and the line speeds up slowly.
            leaves_s = view.now_s + view.timing.answer_s
            steady = view.now_s - since_s >= view.timing.settle_s
            if steady and leaves_s < line.leaves / VERSIONS_PER_S:
                self._publish(self._line(view, line.queue, present, leaves_s))
            return
        self._ready_s.pop(line.queue, None)
        compared = tuple([each.version for each in self.lines[: line.queue + 1] if each])
        if compared != self._compared.get(line.queue):
            self._compared[line.queue] = compared
            moved, _ = self._clear(view, line.queue, present)
            if dist(moved, present) > 0.5 * GATHERED_M:
                leaves_s = line.leaves / VERSIONS_PER_S
                there = self._line(view, line.queue, moved, leaves_s)
                if _ends(there):
                    self._publish(there)

    def _line(self, view: View, queue: int, displacement: Vector, leaves_s: float) -> Line:
        vertex = view.frame.to_world(self._map.vertex_points[self._map.home[queue]])
        left_mps = self._speed_mps - hypot(*view.frame.velocity_at(vertex))
        speed_mps = max(SPEED_SHARE * left_mps, LEAST_SPEED_SHARE * self._speed_mps)
        arrives_s = leaves_s + flight_s(hypot(*displacement), speed_mps)
        known = self.lines[queue]
        version = max(version_at(view.now_s), known.version + 1 if known is not None else 0)
        way = centimetres(displacement)
        leaves, arrives = (min(version_at(s), MAX_CENTISECONDS) for s in (leaves_s, arrives_s))
        return Line(queue, version, *way, leaves, arrives)

    def _clear(self, view: View, queue: int, wanted: Vector) -> tuple[Vector, float]:
        """Return a displacement clear of the lines of queues with lower numbers, and the room."""
        places, others = self._places(view, queue), self._others(view, queue)
        return clear_displacement(wanted, places, others, self._clear_m)

    def _others(self, view: View, queue: int) -> list[tuple[Vector, list[Vector]]]:
        """Return displacement and places of the lines to keep clear of, and of the vertices."""
        lines = [line for line in self.lines[:queue] if line and not has_left(line, view.now_s)]
        found = [
            (displacement_of(each, view.now_s), self._places(view, each.queue)) for each in lines
        ]
        return [*found, ((0.0, 0.0, 0.0), self._map.vertex_points)]

    def _places(self, view: View, queue: int) -> list[Vector]:
        members = view.shares[queue]
        slots = [self._map.slot(queue, k, members) for k in range(1, members + 1)]
        return [slot.point for slot in slots if slot is not None]

    def _publish(self, line: Line) -> None:
        self.lines[line.queue], self.news = line, True


def _ends(line: Line) -> bool:
    """Whether a line arrives in time."""
    return line.arrives - line.version <= MOST_S * VERSIONS_PER_S


def _sum(queue: int, parent: int, parts: Sequence[LinePart]) -> LinePart:
    """Return the sum of some agents' parts of a queue, as the own agent passes it on."""
    members, ready = sum(each.members for each in parts), sum(each.ready for each in parts)
    mean = [
        round(sum(each.members * each[axis] for each in parts) / members) if members else 0
        for axis in (4, 5, 6)
    ]
    return LinePart(queue, parent, min(members, MAX_TEAM), min(ready, MAX_TEAM), *mean)


def _add(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _subtract(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])
