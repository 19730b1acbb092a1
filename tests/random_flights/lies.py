"""What a lying member may say of the Q-structure: any value of the wire types, well aimed or not.

A lie is aimed where it takes up what honest members say: their keys, places, ids and times.
"""

from collections.abc import Sequence
from random import Random
from typing import TypeVar

from agent.comms.neighbours import Neighbours
from agent.controller import Senses, Words
from agent.heard_beacon import HeardBeacon
from agent.messages import (
    AGENT_IDS,
    MAX_CANDIDATES,
    MAX_CENTISECONDS,
    MAX_COST_MM,
    MAX_ORDERS,
    MAX_PLACES,
    MAX_TEAM,
    MAX_VERTICES,
    ZERO,
    Beacon,
    Branch,
    Candidate,
    LeaderSummary,
    Line,
    LinePart,
    Lines,
    Order,
    Place,
    RootKey,
    Standing,
    Subtree,
    Summary,
    Swap,
    TreeReport,
)
from agent.structure.tree import version_at

T = TypeVar("T")
BEACON_HZ = 20.0
GREATEST, LAST_INDEX = 2**53 - 1, 2**15 - 1


def liars_senses(own_id: int, heard: Sequence[Beacon], now_s: float) -> Senses:
    """Return what a liar knows that hears some beacons."""
    neighbours = Neighbours(own_id, BEACON_HZ, 0.1)
    for beacon in heard:
        neighbours.receive(HeardBeacon(beacon), now_s, {})
    return Senses(
        now_s=now_s,
        position=ZERO,
        velocity=ZERO,
        yaw=0.0,
        vehicles=(),
        neighbours=neighbours.heard(now_s),
        team=tuple,
        mission=None,
    )


class Lies:
    """The lies of one member, each time others. own_id: of the liar."""

    def __init__(self, own_id: int) -> None:
        self._own_id = own_id
        self._random, self._line_random = Random(own_id), Random(f"lines of {own_id}")

    def words(self, senses: Senses) -> Words:
        """Return what the liar says now."""
        summary = self.summary(senses) if self._random.random() < 0.3 else None
        return Words(standing=self.standing(senses), summary=summary)

    def place(self, senses: Senses) -> Place | None:
        """Return the place that the liar claims."""
        return Place(*self._place(senses)) if self._random.random() < 0.9 else None

    def standing(self, senses: Senses) -> Standing:
        """Return a standing: a root's or a follower's, with a claim, a swap or both."""
        return Standing(
            branches=tuple(self._branch(senses) for _ in range(self._among((0, 1, 4, 16)))),
            leads=self._among((-1, 0, 0, 1, LAST_INDEX)),
            queue=self._queue(),
            heard=self._among((0, 1, 3, len(senses.neighbours) + 1, AGENT_IDS - 1)),
            pushes=self._random.random() < 0.5,
            proposal=self._swap(senses),
            reservation=self._swap(senses),
            code=self._random.randrange(1, 256),
        )

    def summary(self, senses: Senses) -> Summary:
        """Return a summary: labels and news of anybody, reports on any trees."""
        random = self._random
        labels = random.randbytes(2 * random.randrange(64))
        return Summary(
            mission=senses.mission.key if senses.mission is not None else 0,
            first=self._among((0, 0, 3, AGENT_IDS - 1)),
            labels=labels if random.random() < 0.5 else bytes(len(labels)),
            news=tuple((self._id(senses), random.randrange(2**16)) for _ in range(8)),
            trees=tuple(self._report(senses, v) for v in range(self._among((1, 2)))),
            lines=self.lines(senses),
        )

    def lines(self, senses: Senses) -> Lines | None:
        """Return lines that gather anywhere, for any time, and reports about them."""
        draw = self._line_random
        if draw.random() < 0.5:
            return None
        now, queues = version_at(senses.now_s), (0, 0, 1, 2, LAST_INDEX)
        heard = [other.id for other in senses.neighbours]

        def way() -> list[int]:
            return [draw.choice((0, -300, 800, -90_000, 2**31 - 1)) for _ in range(3)]

        def time() -> int:
            return draw.choice((0, now, now + 50, now + 3000, MAX_CENTISECONDS))

        lines = [
            Line(draw.choice(queues), time(), *way(), time(), time())
            for _ in range(draw.choice((0, 1, 4)))
        ]
        parts = [
            LinePart(
                draw.choice(queues),
                draw.choice([-1, self._own_id, *heard]),
                draw.choice((0, 1, 9, MAX_TEAM)),
                draw.choice((0, 1, 9, MAX_TEAM)),
                *way(),
            )
            for _ in range(draw.choice((0, 1, 4)))
        ]
        return Lines(tuple(lines), tuple(parts))

    def _report(self, senses: Senses, vertex: int) -> TreeReport:
        return TreeReport(
            vertex=self._among((vertex, MAX_VERTICES - 1)),
            tier=self._among((0, 0, 1, LAST_INDEX)),
            parent=self._id(senses),
            down=self._down(senses) if self._random.random() < 0.9 else None,
            up=self._up(senses) if self._random.random() < 0.5 else None,
        )

    def _down(self, senses: Senses) -> LeaderSummary:
        total = self._among((0, 1, len(senses.neighbours) + 1, 9, MAX_TEAM))
        queues = self._among((1, 2, 4))
        version = self._version(senses)
        return LeaderSummary(
            root=self._root(senses),
            version=version,
            total=total,
            counts=tuple(self._among((0, 1, total // queues, total)) for _ in range(queues)),
            highest=tuple(self._among((0, 1, total, MAX_TEAM)) for _ in range(queues)),
            histogram=self._random.randbytes(self._among((0, 3, 16))),
            go=self._random.random() < 0.7,
            order=self._among((0, version, GREATEST)),
            orders=tuple(
                Order(self._id(senses), self._queue(), self._queue())
                for _ in range(self._among((0, 2, MAX_ORDERS)))
            ),
            blocked=self._places(senses),
        )

    def _up(self, senses: Senses) -> Subtree:
        queues = self._among((1, 2, 4))
        return Subtree(
            highest=tuple(self._among((0, 3, MAX_TEAM)) for _ in range(queues)),
            histogram=self._random.randbytes(self._among((0, 3, 16))),
            candidates=tuple(
                tuple(
                    Candidate(self._among((-(2**31), -9, 0)), self._id(senses), self._queue())
                    for _ in range(self._among((0, 1, MAX_CANDIDATES)))
                )
                for _ in range(queues)
            ),
            blocked=self._places(senses),
        )

    def _branch(self, senses: Senses) -> Branch | None:
        if self._random.random() < 0.1:
            return None
        tier = self._among((-1, 0, 0, 1, LAST_INDEX))
        return Branch(self._root(senses), self._version(senses), tier, self._id(senses))

    def _root(self, senses: Senses) -> RootKey:
        """Return the liar's own key, one that nobody beats, or one that an honest member states."""
        stated = [
            branch.root
            for other in senses.neighbours
            if other.standing is not None
            for branch in other.standing.branches
            if branch is not None
        ]
        invented = RootKey(self._among((0, MAX_COST_MM)), self._id(senses))
        return self._among([RootKey(0, self._own_id), invented, *stated[:4]])

    def _version(self, senses: Senses) -> int:
        now = version_at(senses.now_s)
        return self._among((0, now, now, now + 50, now + 100, GREATEST))

    def _swap(self, senses: Senses) -> Swap | None:
        """Return a swap with anybody, most often about a place that it holds."""
        if self._random.random() < 0.3:
            return None
        return Swap(self._id(senses), self._place(senses), self._place(senses))

    def _id(self, senses: Senses) -> int:
        heard = [other.id for other in senses.neighbours]
        return self._among([self._own_id, AGENT_IDS - 1, self._random.randrange(12), *heard])

    def _place(self, senses: Senses) -> tuple[int, int]:
        held = [tuple(other.place) for other in senses.neighbours if other.place is not None]
        rank = self._among((-1, 0, 1, 2, self._random.randrange(40), MAX_TEAM, LAST_INDEX))
        return self._among([*held, (self._queue(), rank), (self._queue(), rank)])

    def _places(self, senses: Senses) -> tuple[tuple[int, int], ...]:
        return tuple(self._place(senses) for _ in range(self._among((0, 0, 3, MAX_PLACES))))

    def _queue(self) -> int:
        return self._among((-1, 0, 0, 1, 2, 64, LAST_INDEX))

    def _among(self, values: "tuple[T, ...] | list[T]") -> T:
        return self._random.choice(values)
