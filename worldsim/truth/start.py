"""Where a fleet starts: positions and headings, drawn from the seed or given."""

import numpy as np

from worldsim.scenario import BoxStart, ListStart
from worldsim.truth.vehicle import Floats

TRIES = 10_000


class StartError(ValueError):
    """A start for which there is no room."""


def starts(start: BoxStart | ListStart, agents: int, seed: int) -> tuple[Floats, Floats]:
    """Return positions (N, 3) [m; world frame] and yaws (N,) [rad], or raise StartError."""
    if isinstance(start, ListStart):
        yaws = start.yaws_deg if start.yaws_deg is not None else (0.0,) * agents
        return np.array(start.positions_m), np.radians(np.array(yaws))
    generator = np.random.Generator(np.random.Philox(key=[seed, 0x57A27]))
    centre, size = np.array(start.centre_m), np.array(start.size_m)
    placed: list[Floats] = []
    for _ in range(TRIES * agents):
        if len(placed) == agents:
            break
        candidate = centre + size * (generator.random(3) - 0.5)
        if all(np.linalg.norm(candidate - other) >= start.spacing_m for other in placed):
            placed.append(candidate)
    if len(placed) < agents:
        raise StartError(
            f"no room for {agents} agents {start.spacing_m:g} m apart in a box of "
            f"{' x '.join(f'{edge:g}' for edge in start.size_m)} m"
        )
    return np.array(placed), generator.uniform(-np.pi, np.pi, agents)
