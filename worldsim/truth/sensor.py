"""What vehicles sense of one another, for all that look at once."""

import numpy as np

from agent.messages import Vector
from worldsim.truth.vehicle import Floats

PROXIMITY_RANGE_M = 2.0


class ProximitySensor:
    """True relative positions of the vehicles within 2 m, with normal noise per axis [m].

    The noise of one reading is keyed by (seed, agent, slot): it does not depend on who else looks.
    """

    def __init__(self, seed: int, noise_m: float) -> None:
        self._seed = seed
        self._noise_m = noise_m

    def read(self, position: Floats, looking: list[int], slot: int) -> list[tuple[Vector, ...]]:
        """Return for each agent in ``looking`` the vehicles it senses [m; world axes, relative].

        position: (N, 3) [m; world frame], NaN for no vehicle. Order of bodies: by agent's row.
        """
        relative = position - position.take(looking, axis=0)[:, None]
        square = relative * relative
        near = square[:, :, 0] + square[:, :, 1] + square[:, :, 2] <= PROXIMITY_RANGE_M**2
        for row, agent in enumerate(looking):
            near[row, agent] = False
        return [
            self._sensed(relative[row, near[row]], agent, slot) for row, agent in enumerate(looking)
        ]

    def _sensed(self, bodies: Floats, agent: int, slot: int) -> tuple[Vector, ...]:
        if self._noise_m > 0.0 and len(bodies):
            generator = np.random.Generator(np.random.Philox(key=[self._seed, agent << 40 | slot]))
            bodies = bodies + self._noise_m * generator.standard_normal(bodies.shape)
        return tuple(map(tuple, bodies.tolist()))
