"""What one agent knows of the structure at one time: those it hears, and what leaders said."""

from collections.abc import Mapping, Sequence
from math import dist

from agent.controller import Heard
from agent.messages import LeaderSummary, Place, Vector
from agent.places.place_points import OwnTarget
from agent.qstructure.target_frame import Frame
from agent.structure.claim import Claim
from agent.structure.link_timing import Timing
from agent.structure.queue_map import QueueMap
from agent.structure.transfers import transfers


class View:
    """One agent's knowledge at one time.

    around: all neighbours; heard: those that fly the same mission. summaries: of each vertex's
    leader, None where none was heard. blocked: places that are not available (E18).
    gathering: queues that are displaced.
    """

    def __init__(
        self,
        now_s: float,
        here: Vector,
        around: Sequence[Heard],
        mission: int,
        formation: QueueMap,
        frame: Frame,
    ) -> None:
        self.now_s, self.here, self.around = now_s, here, around
        self.mission = mission
        self.heard = [h for h in around if h.standing is not None and h.mission == mission]
        self.map, self.frame = formation, frame
        self.timing: Timing
        self.summaries: Sequence[LeaderSummary | None] = ()
        self.blocked: frozenset[Place] = frozenset()
        self.order: Sequence[int] = ()
        """The known members of the own queue along it, for an agent without a number."""
        self.gathering: frozenset[int] = frozenset()
        self.expected = 0
        """Members of the team that took its places over from another mission; holds until a
        leader's count is steady."""
        self.origin = frame.to_frame(here)
        # What follows is found when it is first asked for, and holds as long as the view.
        self._by_id: Mapping[int, Heard] | None = None
        self._counts: list[int] | None = None
        self._highest: list[int] | None = None
        self._latest: LeaderSummary | None = None
        self._knows_latest = False
        self._total = -1
        self._shares: tuple[int, ...] | None = None
        self._vacant: list[int] | None = None
        self._wanted: tuple[int, ...] | None = None
        self._transfers: Mapping[int, Sequence[int]] | None = None

    @property
    def by_id(self) -> Mapping[int, Heard]:
        """The members heard, by id."""
        if self._by_id is None:
            self._by_id = {each.id: each for each in self.heard}
        return self._by_id

    @property
    def counts(self) -> list[int]:
        """Members of each queue, as leaders count them."""
        if self._counts is None:
            self._counts = self._counted()
        return self._counts

    def _counted(self) -> list[int]:
        if self.is_under_way:
            return [*self.shares]
        counts = [0] * self.map.queues
        for v, summary in enumerate(self.summaries):
            if summary is not None:
                _spread(summary.counts, self.map.homed[v], counts)
        return counts

    @property
    def highest(self) -> list[int]:
        """Number of the last claimed place of each queue."""
        if self._highest is None:
            self._highest = self._last_claimed()
        return self._highest

    def _last_claimed(self) -> list[int]:
        highest = [0] * self.map.queues
        for v, summary in enumerate(self.summaries):
            if summary is not None:
                _spread(summary.highest, self.map.homed[v], highest)
        return highest

    @property
    def latest(self) -> LeaderSummary | None:
        """The latest summary of a leader whose counts were steady."""
        if not self._knows_latest:
            self._latest = _latest_of(self.summaries, steady=True)
            self._knows_latest = True
        return self._latest

    @property
    def is_under_way(self) -> bool:
        """Whether others of a team that took its places over may not have the mission yet."""
        return self.expected > 0 and self.latest is None

    @property
    def total(self) -> int:
        """Members of the team; without a leader's steady count those expected, 0 for none."""
        if self._total < 0:
            latest = self.latest
            self._total = latest.total if latest is not None else self.expected
        return self._total

    @property
    def shares(self) -> tuple[int, ...]:
        """Members that each queue should have besides those in vertices, as counted so far."""
        if self._shares is None:
            self._shares = self._shared()
        return self._shares

    def _shared(self) -> tuple[int, ...]:
        if self.is_under_way:
            return self.map.members(self.expected, self.blocked)
        latest = _latest_of(self.summaries, steady=False)
        return self.map.members(latest.total if latest is not None else 0, self.blocked)

    @property
    def vacant(self) -> list[int]:
        """The vertices that somebody is to lead, and of whose leader nothing was heard."""
        if self._vacant is None:
            led = self.map.led(self.total, self.blocked)
            self._vacant = [v for v in led if self.summaries[v] is None]
        return self._vacant

    def is_spare(self, vertex: int) -> bool:
        """Whether a vertex needs no leader, for the team is too small to fill all that there are.

        The leader of one that is taken stands in its queue, unless the vertices need all members.
        """
        led = self.map.led(self.total, self.blocked)
        if self.map.vertex_places[vertex] in self.blocked:
            return 0 < self.total <= len(led)
        return vertex not in led

    @property
    def wanted(self) -> tuple[int, ...]:
        """The shares, with those who are to lead a vertex that nobody is near."""
        if self._wanted is None:
            self._wanted = self.map.with_vacancies(self.shares, self.counts, self.vacant)
        return self._wanted

    @property
    def transfers(self) -> Mapping[int, Sequence[int]]:
        """For each queue that is to give members away, how many each other one may take from it."""
        if self._transfers is None:
            self._transfers = transfers(self.map, self.counts, self.wanted)
        return self._transfers

    def home_of(self, queue: int) -> LeaderSummary | None:
        """Return the summary of the leader of a queue's first vertex."""
        return self.summaries[self.map.home[queue]]

    def same_queue(self, queue: int) -> list[Heard]:
        """Return the members heard of a queue, without those that stand in a vertex.

        A leader whose vertex is taken stands in its queue (E18).
        """
        return [
            each
            for each in self.heard
            if queue_of(each) == queue and (not leads(each) or self.number_of(each) > 0)
        ]

    def number_of(self, heard: Heard) -> int:
        """Return the number that a member claims, 0 for none."""
        return max(0, self.map.number(heard.place)) if heard.place is not None else 0

    def to_vertex(self, vertex: int, position: Vector | None = None) -> float:
        """Return the distance of a position from a vertex [m]; the own one if left out."""
        point = self.frame.to_world(self.map.vertex_points[vertex])
        return dist(position if position is not None else self.here, point)

    def point(self, queue: int, number: int) -> Vector | None:
        """Return a member's place [m; world frame]; None where there is none."""
        if not 0 <= queue < self.map.queues:
            return None
        slot = self.map.slot(queue, number, self.extent(queue, number))
        return self.frame.to_world(slot.point) if slot is not None else None

    def extent(self, queue: int, number: int = 1) -> int:
        """Return with how many members a queue's places are computed (a closed queue's shift)."""
        members = self.shares[queue] if self.total else 0
        if self.blocked:
            for taken in sorted(self.map.blocked_numbers(queue, self.blocked)):
                members += taken <= members
        least = max(number, 1)
        return max(members, least)

    def distance(self, queue: int, number: int) -> float:
        """Return the own distance from a member's place [m]; infinite where there is none."""
        point = self.point(queue, number)
        return dist(self.here, point) if point is not None else float("inf")

    def nearest_number(self, queue: int, members: int) -> int:
        """Return the number of a queue's nearest place among its first members."""
        found = self.map.nearest(queue, self._length(queue, members), self.origin)
        return found.number if found is not None else 1

    def way_to(self, queue: int, members: int) -> float:
        """Return the distance from the nearest of a queue's first places [m]."""
        found = self.map.nearest(queue, self._length(queue, members), self.origin)
        return found.away_m if found is not None else float("inf")

    def number_near(self, queue: int, members: int, within_m: float) -> int | None:
        """Return the nearest number of a queue's first places within a distance [m], if any."""
        found = self.map.nearest(queue, self._length(queue, members), self.origin, within_m)
        return found.number if found is not None else None

    def _length(self, queue: int, members: int) -> int:
        return self.extent(queue, members) if self.map.closed[queue] else members

    def target(self, claim: Claim) -> OwnTarget | None:
        """Return where the claim's holder flies; None where there is no such place."""
        if claim.leads and claim.number < 1:
            slot = self.map.vertex_slot(claim.vertex)
            place = self.map.vertex_places[claim.vertex]
            return OwnTarget(place, slot, True) if slot is not None else None
        if claim.number < 1:
            return None
        slot = self.map.slot(claim.queue, claim.number, self.extent(claim.queue, claim.number))
        place = self.map.place(claim.queue, claim.number)
        return OwnTarget(place, slot, claim.leads) if slot is not None else None


def _spread(numbers: tuple[int, ...], queues: list[int], over: list[int]) -> None:
    """Note the numbers of a vertex's queues among those of all queues."""
    for k in range(min(len(numbers), len(queues))):
        over[queues[k]] = numbers[k]


def _latest_of(summaries: Sequence[LeaderSummary | None], *, steady: bool) -> LeaderSummary | None:
    """Return the latest summary, None for none. steady: of those whose counts were steady."""
    latest, version = None, -1
    for each in summaries:
        if each is not None and each.version > version and (each.go or not steady):
            latest, version = each, each.version
    return latest


def queue_of(heard: Heard) -> int:
    """Return the queue that a member heard belongs to, -1 for none."""
    return heard.standing.queue if heard.standing is not None else -1


def leads(heard: Heard) -> bool:
    """Whether a member heard leads a vertex."""
    return heard.standing is not None and heard.standing.leads >= 0
