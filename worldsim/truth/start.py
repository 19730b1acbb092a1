"""Where a fleet starts: positions and headings, drawn from the seed or given."""

import numpy as np

from worldsim.scenario.starting import BoxStart, ListStart
from worldsim.truth.vehicle import Floats

TRIES = 10_000
"""For one vehicle; a box that refuses so many draws has no room."""


class StartError(ValueError):
    """A start for which there is no room."""


def starts(start: BoxStart | ListStart, agents: int, seed: int) -> tuple[Floats, Floats]:
    """Return positions (N, 3) [m; world frame] and yaws (N,) [rad], or raise StartError."""
    if isinstance(start, ListStart):
        yaws = start.yaws_deg if start.yaws_deg is not None else (0.0,) * agents
        return np.array(start.positions_m), np.radians(np.array(yaws))
    generator = np.random.Generator(np.random.Philox(key=[seed, 0x57A27]))
    centre, size = np.array(start.centre_m), np.array(start.size_m)
    placed = np.empty((agents, 3))
    for row in range(agents):
        for _ in range(TRIES):
            placed[row] = centre + size * (generator.random(3) - 0.5)
            away = placed[:row] - placed[row]
            if np.all(np.sqrt(np.sum(away * away, axis=1)) >= start.spacing_m):
                break
        else:
            raise StartError(
                f"no room for {agents} agents {start.spacing_m:g} m apart in a box of "
                f"{' x '.join(f'{edge:g}' for edge in start.size_m)} m"
            )
    return placed, generator.uniform(-np.pi, np.pi, agents)
