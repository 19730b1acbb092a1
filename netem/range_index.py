"""Which radios are in range of a sender, and at which distance.

Small fleets are searched in a loop over plain floats, large ones as arrays. Both do the same
operations (differences, a written-out sum of three squares, a square root) and so find equal
numbers.
"""

from math import nan, sqrt

import numpy as np
from numpy.typing import NDArray

from netem.faults import Position

ARRAYS_FROM = 40
"""Number of receivers from which arrays are faster."""
InRange = list[tuple[int, float]]
"""Receivers and their distances [m], by receiver id."""


class RangeIndex:
    """The positions of all radios; receivers: the ids that are searched, ascending."""

    def __init__(self, radios: int, receivers: tuple[int, ...]) -> None:
        self._receivers = receivers
        self._rows = np.array(receivers, dtype=np.int64)
        self.positions: tuple[Position | None, ...] = (None,) * radios
        self._array: NDArray[np.float64] | None = None
        self._found: dict[tuple[int, float], InRange] = {}

    def place(self, positions: tuple[Position | None, ...]) -> None:
        """Set the true positions, row i = radio i [m; world frame]; None where there is none."""
        self.positions = positions
        self._array = None
        self._found.clear()

    def in_range(self, source: int, reach_m: float) -> InRange:
        """Return the receivers other than the source within a distance [m] of it."""
        found = self._found.get((source, reach_m))
        if found is None:
            here = self.positions[source]
            if here is None:
                found = []
            elif len(self._receivers) < ARRAYS_FROM:
                found = self._by_loop(source, here, reach_m)
            else:
                found = self._by_array(source, here, reach_m)
            self._found[source, reach_m] = found
        return found

    def _by_loop(self, source: int, here: Position, reach_m: float) -> InRange:
        x, y, z = here
        found = []
        for receiver in self._receivers:
            there = self.positions[receiver]
            if there is None or receiver == source:
                continue
            dx, dy, dz = there[0] - x, there[1] - y, there[2] - z
            distance_m = sqrt(dx * dx + dy * dy + dz * dz)
            if distance_m <= reach_m:
                found.append((receiver, distance_m))
        return found

    def _by_array(self, source: int, here: Position, reach_m: float) -> InRange:
        if self._array is None:
            known = [self.positions[receiver] or (nan, nan, nan) for receiver in self._receivers]
            self._array = np.array(known).T.copy()
        dx, dy, dz = (self._array[axis] - here[axis] for axis in range(3))
        distance_m = np.sqrt(dx * dx + dy * dy + dz * dz)
        within = np.flatnonzero(distance_m <= reach_m)
        pairs = zip(self._rows[within].tolist(), distance_m[within].tolist(), strict=True)
        return [pair for pair in pairs if pair[0] != source]
