"""What a component can know of the places that hovering vehicles take from it (E18).

It cannot know of a vehicle that none of its agents surely senses, nor whether one takes a place
that hovers half a spacing from it, give or take what the sensor's noise hides. Nor can it know that
a place is free that a vehicle has left, where an agent of it sensed the vehicle and none has come
near since: agents then remember the vehicle, for a limited time.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from agent.comms.unidentified_vehicles import REMEMBERED_S, SURE_RANGE_M, UNMOVED_RANGE_M
from agent.messages import PROXIMITY_RANGE_M, Place, Vector
from worldsim.judge.hovering_vehicles import HoveringVehicles
from worldsim.judge.phase import Phase
from worldsim.judge.tick import Tick
from worldsim.truth.vehicle import Floats


class BlockedPlaces:
    """The places that hovering vehicles take from a component, as far as it can know them.

    senses: for each agent, whether it senses every vehicle near by.
    """

    def __init__(self, hovering: HoveringVehicles, senses: Sequence[bool]) -> None:
        self._hovering = hovering
        self._watchers, self._departures = Watchers(senses), Departures(senses)

    def restart(self, agent: int) -> None:
        """Forget what an agent heard: its process starts anew."""
        self._watchers.restart(agent)

    def hear(self, hears: NDArray[np.bool_]) -> None:
        """Take which agent hears which from now on. hears: (N, N), row hears column."""
        self._watchers.hear(hears)

    def see(self, tick: Tick, *, parted: bool, news_s: float) -> None:
        """Take a tick; ticks come in order.

        parted: whether there is a vehicle outside a component; news_s: how long it takes that all
        agents of a component act on what one of them no longer remembers [s].
        """
        self._watchers.see(tick.position)
        if parted:
            hovering = self._hovering.hovering(tick)
            self._departures.see(tick, hovering, REMEMBERED_S + news_s)
        else:
            self._departures.clear()

    def of(self, tick: Tick, phase: Phase, rows: list[int]) -> frozenset[Place] | None:
        """Return the places that others take from a component.

        None where it cannot know them, or where its own agent stands in such a place.
        """
        occupied = self._hovering.occupied_places(tick, phase, rows)
        if self._is_unclear(tick, phase, rows, occupied):
            return None
        if occupied and occupied & self._hovering.held_places(tick, phase, rows):
            return None
        return occupied

    def is_unclear(self, tick: Tick, phase: Phase, rows: list[int]) -> bool:
        """Whether a component cannot know whether one of its places is taken."""
        occupied = self._hovering.occupied_places(tick, phase, rows)
        return self._is_unclear(tick, phase, rows, occupied)

    def _is_unclear(
        self, tick: Tick, phase: Phase, rows: list[int], occupied: frozenset[Place]
    ) -> bool:
        if self._hovering.is_doubtful(tick, phase, rows):
            return True
        if occupied:
            seen = self._watchers.seen_by(tick.position, rows)
            if occupied != self._hovering.occupied_places(tick, phase, rows, seen):
                return True
        left = self._departures.unknown_to(rows)
        return bool(left) and occupied != self._hovering.places_near(
            tick, phase, rows, left, occupied
        ).union(occupied)


class Watchers:
    """Knows which hovering vehicles agents surely take for occupants of a place.

    As in the agents' own rule, an agent is near enough to sense the vehicle, and has ever heard a
    member that was no nearer. senses: for each agent, whether it senses every vehicle near by.
    """

    def __init__(self, senses: Sequence[bool]) -> None:
        self._senses = senses
        self._farthest_m = [0.0] * len(senses)
        """The farthest distance from which each agent ever heard a member [m]."""
        self._heard: dict[int, list[int]] = {}
        """By hearer: those that it hears, while it senses farther than it has heard."""
        self._hears: NDArray[np.bool_] | None = None
        """What they were found from; None after a restart."""

    def restart(self, agent: int) -> None:
        """Forget what an agent heard: its process starts anew."""
        self._farthest_m[agent] = 0.0
        self._hears = None

    def hear(self, hears: NDArray[np.bool_]) -> None:
        """Take which agent hears which from now on. hears: (N, N), row hears column."""
        if hears is self._hears:
            return
        self._hears, self._heard = hears, {}
        hearers, heard = np.nonzero(hears)
        for hearer, other in zip(hearers.tolist(), heard.tolist(), strict=True):
            if self._farthest_m[hearer] < SURE_RANGE_M:
                self._heard.setdefault(hearer, []).append(other)

    def see(self, position: Floats) -> None:
        """Take where the vehicles are (N, 3) [m; world frame]; ticks come in order."""
        if not self._heard:
            return
        rows: list[Vector] = [(x, y, z) for x, y, z in position.tolist()]
        for hearer, heard in list(self._heard.items()):
            x, y, z = rows[hearer]
            farthest = self._farthest_m[hearer]
            for other in heard:
                a, b, c = rows[other]
                u, v, w = x - a, y - b, z - c
                farthest = max(farthest, sqrt(u * u + v * v + w * w))
            self._farthest_m[hearer] = farthest
            if farthest >= SURE_RANGE_M:
                del self._heard[hearer]

    def seen_by(self, position: Floats, team: list[int]) -> NDArray[np.bool_]:
        """Return which vehicles (N,) some agents of a team (rows) surely take for occupants.

        position: (N, 3) [m; world frame].
        """
        watchers = [row for row in team if self._senses[row]]
        away = position[watchers, None] - position[None]
        distance = np.sqrt(np.sum(away * away, axis=2))
        reach_m = [min(SURE_RANGE_M, self._farthest_m[row]) for row in watchers]
        seen: NDArray[np.bool_] = np.any(distance <= np.array(reach_m)[:, None], axis=0)
        return seen


@dataclass(frozen=True)
class _Departure:
    """A vehicle's flight from where it hovered."""

    position: Floats  # where it hovered (3,) [m; world frame]
    left_s: float  # [s; simulated time]
    remember: NDArray[np.bool_]  # (N,), which agents sensed it there
    informed: NDArray[np.bool_]  # (N,), which have been near enough since to miss it


class Departures:
    """Which places hovering vehicles left lately, and which agents can know that.

    senses: for each agent, whether it senses every vehicle near by.
    """

    def __init__(self, senses: Sequence[bool]) -> None:
        agents = len(senses)
        self._senses = np.array(senses, dtype=np.bool_)
        self._sensed = np.zeros((agents, agents), dtype=np.bool_)
        """Row i: which agents have sensed vehicle i where it hovers; none if it does not."""
        self._hovered = np.zeros(agents, dtype=np.bool_)
        """(N,): which vehicles hovered at the last tick."""
        self._position = np.zeros((agents, 3))
        """(N, 3): where they were then [m; world frame]."""
        self._clear = True
        """Whether none hovered, and none has left."""
        self._left: list[_Departure] = []

    def clear(self) -> None:
        """Forget all departures: every agent is in one component."""
        if not self._clear:
            self._clear = True
            self._hovered, self._sensed = np.zeros_like(self._hovered), np.zeros_like(self._sensed)
            self._left = []

    def see(self, tick: Tick, hovering: NDArray[np.bool_], lasting_s: float) -> None:
        """Take which vehicles (N,) hover; ticks come in order. A departure counts lasting_s [s]."""
        self._clear = False
        self._left = [each for each in self._left if tick.time_s - each.left_s < lasting_s]
        for row in np.flatnonzero(self._hovered & ~hovering).tolist():
            itself = np.arange(len(hovering)) == row
            sensed = self._sensed[row].copy()
            self._left.append(_Departure(self._position[row], tick.time_s, sensed, itself))
        self._hovered, self._position = hovering, tick.position
        looking = self._senses & tick.alive
        self._sensed[~hovering] = False
        for row in np.flatnonzero(hovering).tolist():
            self._sensed[row] |= looking & _within(PROXIMITY_RANGE_M, tick, tick.position[row])
        for each in self._left:
            each.informed[looking & _within(UNMOVED_RANGE_M, tick, each.position)] = True

    def unknown_to(self, team: list[int]) -> list[Vector]:
        """Return where a team (rows) may remember vehicles that have left [m; world frame]."""
        unknown = [
            each.position.tolist()
            for each in self._left
            if each.remember[team].any() and not each.informed[team].any()
        ]
        return [(x, y, z) for x, y, z in unknown]


def _within(reach_m: float, tick: Tick, point: Floats) -> NDArray[np.bool_]:
    """Return which vehicles (N,) are within reach of a point (3,) [m; world frame]."""
    away = tick.position - point
    near: NDArray[np.bool_] = np.sum(away * away, axis=1) <= reach_m * reach_m
    return near
