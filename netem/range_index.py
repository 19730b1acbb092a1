"""Who is near: which radios a frame may reach at all, and how far away they are.

Small fleets are walked through in plain floats, large ones as arrays. Both take the same steps
(differences, a written-out sum of three squares, a square root), so both find the same numbers.
"""

from math import nan, sqrt

import numpy as np
from numpy.typing import NDArray

from netem.faults import Position

LARGE = 40
"""From so many radios on, arrays are quicker."""
Near = list[tuple[int, float]]


class RangeIndex:
    """The radios at their places; ``receivers``: those who may hear, in order."""

    def __init__(self, radios: int, receivers: tuple[int, ...]) -> None:
        self._receivers = receivers
        self._rows = np.array(receivers, dtype=np.int64)
        self.positions: tuple[Position | None, ...] = (None,) * radios
        self._array: NDArray[np.float64] | None = None
        self._found: dict[tuple[int, float], Near] = {}

    def place(self, positions: tuple[Position | None, ...]) -> None:
        """Take the true positions, row i = radio i [m; world frame]; None where none is."""
        self.positions = positions
        self._array = None
        self._found.clear()

    def of(self, source: int, reach_m: float) -> Near:
        """Return (receiver, distance [m]) of the others within reach of a radio, by their ids."""
        found = self._found.get((source, reach_m))
        if found is None:
            here = self.positions[source]
            if here is None:
                found = []
            elif len(self._receivers) < LARGE:
                found = self._walked(source, here, reach_m)
            else:
                found = self._by_array(source, here, reach_m)
            self._found[source, reach_m] = found
        return found

    def _walked(self, source: int, here: Position, reach_m: float) -> Near:
        x, y, z = here
        near = []
        for receiver in self._receivers:
            there = self.positions[receiver]
            if there is None or receiver == source:
                continue
            dx, dy, dz = there[0] - x, there[1] - y, there[2] - z
            distance_m = sqrt(dx * dx + dy * dy + dz * dz)
            if distance_m <= reach_m:
                near.append((receiver, distance_m))
        return near

    def _by_array(self, source: int, here: Position, reach_m: float) -> Near:
        if self._array is None:
            where = [self.positions[receiver] or (nan, nan, nan) for receiver in self._receivers]
            self._array = np.array(where).T.copy()
        dx, dy, dz = (self._array[axis] - here[axis] for axis in range(3))
        distance_m = np.sqrt(dx * dx + dy * dy + dz * dz)
        within = np.flatnonzero(distance_m <= reach_m)
        pairs = zip(self._rows[within].tolist(), distance_m[within].tolist(), strict=True)
        return [pair for pair in pairs if pair[0] != source]
