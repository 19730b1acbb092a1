"""Where vehicles start: positions and headings, drawn from the seed or given."""

import numpy as np

from worldsim.scenario.starting import BoxStart, ListStart
from worldsim.truth.vehicle import Floats

TRIES = 10_000
"""For one vehicle; a box that refuses so many draws has no room."""
NOBODY: Floats = np.empty((0, 3))


class StartError(ValueError):
    """A start for which there is no room."""


def starts(
    start: BoxStart | ListStart,
    agents: int,
    seed: int,
    *,
    event: int = 0,
    present: Floats = NOBODY,
    apart_m: float = 0.0,
) -> tuple[Floats, Floats]:
    """Return positions (N, 3) [m; world frame] and yaws (N,) [rad], or raise StartError.

    event: makes draws of one seed differ; 0 at the start of a run. present (K, 3): vehicles to stay
    away from [m; world frame], by ``apart_m`` at least where the places are given.
    """
    if isinstance(start, ListStart):
        yaws = start.yaws_deg if start.yaws_deg is not None else (0.0,) * agents
        return _given(np.array(start.positions_m), present, apart_m), np.radians(np.array(yaws))
    generator = np.random.Generator(np.random.Philox(key=[seed, event << 20 | 0x57A27]))
    placed = _drawn(start, agents, generator, present)
    return placed, generator.uniform(-np.pi, np.pi, agents)


def _given(positions: Floats, present: Floats, apart_m: float) -> Floats:
    for x, y, z in positions.tolist():
        if not _clear(present - (x, y, z), apart_m):
            raise StartError(f"a vehicle is within {apart_m:g} m of [{x:g}, {y:g}, {z:g}]")
    return positions


def _drawn(start: BoxStart, agents: int, generator: np.random.Generator, present: Floats) -> Floats:
    centre, size = np.array(start.centre_m), np.array(start.size_m)
    placed = np.concatenate((present, np.empty((agents, 3))))
    for row in range(len(present), len(placed)):
        for _ in range(TRIES):
            placed[row] = centre + size * (generator.random(3) - 0.5)
            if _clear(placed[:row] - placed[row], start.spacing_m):
                break
        else:
            raise StartError(
                f"no room for {agents} agents {start.spacing_m:g} m apart in a box of "
                f"{' x '.join(f'{edge:g}' for edge in start.size_m)} m"
            )
    return placed[len(present) :]


def _clear(away: Floats, apart_m: float) -> bool:
    return bool(np.all(np.sqrt(np.sum(away * away, axis=1)) >= apart_m))
