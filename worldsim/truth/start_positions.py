"""Where vehicles start: positions and headings, drawn from the seed or given."""

from typing import NamedTuple

import numpy as np

from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.tables import Scenario
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.vehicle import Floats

TRIES = 10_000
"""For one vehicle; a box that refuses so many draws has no room."""
NOBODY: Floats = np.empty((0, 3))


class StartError(ValueError):
    """A start for which there is no room."""


class Room(NamedTuple):
    """Where vehicles may start: ``clear_m`` away from obstacles at a time."""

    obstacles: Obstacles
    clear_m: float
    time_s: float = 0.0

    def taken_by(self, place: Floats) -> int | None:
        """Return the obstacle that is too near to a place (3,) [m; world frame], None if none."""
        if not len(self.obstacles):
            return None
        distance = self.obstacles.nearest(place.reshape(1, 3), self.time_s).distance[0]
        near = np.flatnonzero(distance < self.clear_m)
        return int(near[0]) if len(near) else None


EVERYWHERE = Room(Obstacles(()), 0.0)


def room_of(scenario: Scenario, obstacles: Obstacles, time_s: float = 0.0) -> Room:
    """Return where a scenario's vehicles may start at a time [s]."""
    return Room(obstacles, scenario.obstacle_bound_m, time_s)


def starts_of(scenario: Scenario, obstacles: Obstacles) -> tuple[Floats, Floats]:
    """Return where a scenario's fleet starts, as ``starts`` does."""
    room = room_of(scenario, obstacles)
    return starts(scenario.fleet.start, scenario.fleet.agents, scenario.seed, room=room)


def starts(
    start: BoxStart | ListStart,
    agents: int,
    seed: int,
    *,
    event: int = 0,
    present: Floats = NOBODY,
    apart_m: float = 0.0,
    room: Room = EVERYWHERE,
) -> tuple[Floats, Floats]:
    """Return positions (N, 3) [m; world frame] and yaws (N,) [rad], or raise StartError.

    event: makes draws of one seed differ; 0 at the start of a run. present (K, 3): vehicles to stay
    away from [m; world frame], by ``apart_m`` at least where the places are given. room: what else
    must be clear.
    """
    if isinstance(start, ListStart):
        yaws = start.yaws_deg if start.yaws_deg is not None else (0.0,) * agents
        given = _given(np.array(start.positions_m), present, apart_m, room)
        return given, np.radians(np.array(yaws))
    generator = np.random.Generator(np.random.Philox(key=[seed, event << 20 | 0x57A27]))
    placed = _drawn(start, agents, generator, present, room)
    return placed, generator.uniform(-np.pi, np.pi, agents)


def _given(positions: Floats, present: Floats, apart_m: float, room: Room) -> Floats:
    for x, y, z in positions.tolist():
        taken = room.taken_by(np.array((x, y, z)))
        if taken is not None:
            raise StartError(
                f"obstacle[{taken}] is within {room.clear_m:g} m of [{x:g}, {y:g}, {z:g}]"
            )
        if not _clear(present - (x, y, z), apart_m):
            raise StartError(f"a vehicle is within {apart_m:g} m of [{x:g}, {y:g}, {z:g}]")
    return positions


def _drawn(
    start: BoxStart, agents: int, generator: np.random.Generator, present: Floats, room: Room
) -> Floats:
    centre, size = np.array(start.centre_m), np.array(start.size_m)
    placed = np.concatenate((present, np.empty((agents, 3))))
    for row in range(len(present), len(placed)):
        for _ in range(TRIES):
            placed[row] = centre + size * (generator.random(3) - 0.5)
            apart = _clear(placed[:row] - placed[row], start.spacing_m)
            if apart and room.taken_by(placed[row]) is None:
                break
        else:
            raise StartError(
                f"no room for {agents} agents {start.spacing_m:g} m apart in a box of "
                f"{' x '.join(f'{edge:g}' for edge in start.size_m)} m{_beside(room)}"
            )
    return placed[len(present) :]


def _beside(room: Room) -> str:
    return f", {room.clear_m:g} m from obstacles" if len(room.obstacles) else ""


def _clear(away: Floats, apart_m: float) -> bool:
    return bool(np.all(np.sqrt(np.sum(away * away, axis=1)) >= apart_m))
