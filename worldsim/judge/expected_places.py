"""Where a team must stand: the judge's own reading of a formation, in coordinates.

The rules are those of docs/method.md: vertices come first, the rest of the team is divided by the
queues' capacities, members of an open queue stand d_ir apart by arc length (E13), those of a closed
one evenly where most room is left. An agent's claim and the agents' own geometry have no part in
it.
"""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from math import inf
from typing import NamedTuple

import numpy as np

from agent.messages import Place, Vector
from agent.qstructure.formation_tables import FormationSpec, QueueSpec
from worldsim.judge.measured_curve import CHORD_M, Track, UnmeasuredError, chain_track, track_of
from worldsim.truth.vehicle import Floats

MATCH_M = 0.02
"""A slot is a place if it is no farther from it [m]: the measures of agents and judge differ."""
UNSURE = 1e-3
"""A curve may hold one member more or less if its length is so near to a multiple of d_ir."""
PLACES_KEPT = 64
SEARCHED_M = (20.0, 100.0, 500.0)
"""Arc lengths up to which a curve's vertices are searched for, one after the other [m]."""


class _Line(NamedTuple):
    """A queue as the judge measures it."""

    origin: Floats  # its first vertex [m; target's frame]
    track: Track
    stations: list[float]  # arc lengths of its vertices [m]
    rooms: list[int]  # how many members fit between two vertices; none for an open queue


class ExpectedPlaces:
    """The places of a formation for teams of any size. spacing_m: d_ir [m]."""

    def __init__(self, spec: FormationSpec, spacing_m: float) -> None:
        self._spec, self._spacing_m = spec, spacing_m
        self._places_of: dict[str, list[Place]] = {}
        for j, queue in enumerate(spec.queue):
            for rank, name in enumerate(queue.vertices):
                self._places_of.setdefault(name, []).append(Place(j, rank))
        self._shared = [places[0] for places in self._places_of.values() if len(places) > 1]
        self._lines: dict[int, _Line] = {}
        self.points = lru_cache(PLACES_KEPT)(self._points)

    def are(self, slots: Sequence[Vector], blocked: frozenset[Place]) -> bool:
        """Return whether slots are exactly the places of a team of so many, each once.

        slots [m; target's frame]; blocked: places that hovering vehicles take. True also where the
        judge cannot measure a curve: then it has no opinion.
        """
        expected = self.points(len(slots), blocked)
        if expected is None or not slots:
            return True
        if len(expected) != len(slots):
            return False
        away = np.linalg.norm(np.array(slots)[:, None] - expected, axis=2)
        nearest = away.argmin(axis=1)
        return len(set(nearest.tolist())) == len(slots) and bool(away.min(axis=1).max() <= MATCH_M)

    def _points(self, agents: int, blocked: frozenset[Place]) -> Floats | None:
        """Return the places of a team (n, 3) [m; target's frame]; None where one is not measured.

        n is less than the number of agents where all queues are closed and full.
        """
        try:
            return self._filled(agents, blocked)
        except UnmeasuredError:
            return None

    def _filled(self, agents: int, blocked: frozenset[Place]) -> Floats:
        counts = self._counts(agents, blocked)
        shared = [place for place in self._shared if place not in blocked][:agents]
        found = [self._vertex(place) for place in shared]
        for j, count in enumerate(counts):
            own = [place for place in self._own(j) if place not in blocked][:count]
            found += [self._vertex(place) for place in own]
            found += self._members(j, count - len(own), blocked)
        return np.array(found).reshape(-1, 3)

    def _own(self, queue: int) -> list[Place]:
        """Return the places of a queue's vertices that belong to it alone."""
        ends = self._spec.queue[queue].vertices
        return [Place(queue, k) for k, name in enumerate(ends) if len(self._places_of[name]) == 1]

    def _counts(self, agents: int, blocked: frozenset[Place]) -> list[int]:
        """Return how many agents each queue gets besides shared vertices (E16).

        Own vertices come first. Then each next agent goes to the queue that lacks most of its
        share, of those that have room; ties go to the queue named first.
        """
        left = max(0, agents - sum(place not in blocked for place in self._shared))
        own = [sum(place not in blocked for place in self._own(j)) for j in range(self._queues)]
        counts = own if sum(own) <= left else [0] * self._queues
        room = [self._room(j, blocked) for j in range(self._queues)]
        for _ in range(left - sum(counts)):
            lacking = [
                (round(share * left - counts[j], 9), -j)
                for j, share in enumerate(self._shares)
                if counts[j] < room[j]
            ]
            if not lacking:
                break
            counts[-max(lacking)[1]] += 1
        return counts

    @property
    def _queues(self) -> int:
        return len(self._spec.queue)

    @property
    def _shares(self) -> list[float]:
        """Each queue's share of the team; those without one share the rest equally."""
        given = [queue.capacity for queue in self._spec.queue]
        rest = 1.0 - sum(share for share in given if share is not None)
        return [rest / given.count(None) if share is None else share for share in given]

    def _room(self, queue: int, blocked: frozenset[Place]) -> float:
        """Return how many agents a queue holds besides shared vertices."""
        line = self._line(queue, self._spacing_m)
        if len(line.stations) == 1:
            return inf
        lost = sum(place.queue == queue and place not in self._shared for place in blocked)
        return max(0, len(self._own(queue)) + sum(line.rooms) - lost)

    def _members(self, queue: int, count: int, blocked: frozenset[Place]) -> list[Floats]:
        """Return the first free places of a queue besides its vertices [m; target's frame]."""
        first = len(self._spec.queue[queue].vertices)
        free, k = list[int](), 0
        while len(free) < count:
            if Place(queue, first + k) not in blocked:
                free.append(k)
            k += 1
        if not free:
            return []
        arc_lengths = self._arc_lengths(queue, free[-1] + 1)[free]
        line = self._line(queue, float(arc_lengths[-1]))
        return list(line.origin + line.track(arc_lengths))

    def _arc_lengths(self, queue: int, count: int) -> Floats:
        line = self._line(queue, self._spacing_m)
        if len(line.stations) == 1:
            return self._spacing_m * np.arange(1.0, count + 1)
        lengths = np.diff(line.stations)
        held = np.zeros(len(lengths), dtype=int)
        for _ in range(count):
            wide = np.where(held < line.rooms, lengths / (held + 1), -1.0)
            held[wide.argmax()] += 1
        inside = [
            start + length * np.arange(1, number + 1) / (number + 1)
            for start, length, number in zip(line.stations, lengths, held, strict=False)
        ]
        return np.concatenate(inside)

    def _vertex(self, place: Place) -> Floats:
        return np.array(self._spec.vertices[self._spec.queue[place.queue].vertices[place.rank]])

    def _line(self, queue: int, until_m: float) -> _Line:
        """Return a queue, measured up to an arc length [m] at least."""
        table = self._spec.queue[queue]
        vertices = np.array([self._spec.vertices[name] for name in table.vertices])
        known = self._lines.get(queue)
        if known is None:
            known = self._lines[queue] = self._measured(table, vertices)
        if len(vertices) == 1 and table.shape is not None:
            return known._replace(track=_track_to(table, until_m))
        return known

    def _measured(self, table: QueueSpec, vertices: Floats) -> _Line:
        if table.shape is None:
            track = chain_track(vertices)
            legs = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
            stations = np.concatenate(([0.0], np.cumsum(legs))).tolist()
        elif len(vertices) == 1:
            track, stations = track_of(table.shape, self._spacing_m), [0.0]
        else:
            track, stations = _passing(table, vertices, self._spacing_m)
        fitting = [(b - a) / self._spacing_m + 1e-9 for a, b in pairwise(stations)]
        if table.shape is not None and any(abs(each - round(each)) < UNSURE for each in fitting):
            raise UnmeasuredError("as many members as just fit")
        return _Line(vertices[0], track, stations, [int(each) - 1 for each in fitting])


@lru_cache(PLACES_KEPT)
def _track_to(table: QueueSpec, until_m: float) -> Track:
    if table.shape is None:
        raise UnmeasuredError("no shape")
    return track_of(table.shape, until_m)


def _passing(table: QueueSpec, vertices: Floats, least_m: float) -> tuple[Track, list[float]]:
    """Return the curve of a closed queue and the arc lengths of its vertices [m]."""
    for until_m in SEARCHED_M:
        track = _track_to(table, until_m)
        s = np.arange(0.0, until_m, CHORD_M)
        stations = _stations(track(s), vertices - vertices[0], 0.5 * least_m)
        if stations is not None:
            return track, stations
    raise UnmeasuredError("a vertex is not found on the curve")


def _stations(points: Floats, vertices: Floats, least_m: float) -> list[float] | None:
    """Return where a curve, sampled every CHORD_M, passes vertices in turn; None if it does not.

    least_m: to the next vertex, by arc length [m].
    """
    stations = [0.0]
    for vertex in vertices[1:]:
        away = np.linalg.norm(points - vertex, axis=1)
        away[: int((stations[-1] + least_m) / CHORD_M)] = inf
        near = np.flatnonzero(away < CHORD_M)
        if not len(near):
            return None
        passed = near[0] + int(away[near[0] : near[0] + 4].argmin())
        stations.append(float(_nearest(points, passed, vertex)))
    return stations


def _nearest(points: Floats, at: int, vertex: Floats) -> float:
    """Return the arc length nearest to a vertex [m], beside the point that is nearest."""
    before, after = points[max(at - 1, 0)], points[min(at + 1, len(points) - 1)]
    along = (after - before) / np.linalg.norm(after - before)
    return CHORD_M * at + float(np.dot(vertex - points[at], along))
