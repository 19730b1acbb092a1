"""Which radios are in range of a sender, and at which distance.

Few receivers are searched in a loop over plain floats, many as arrays. Both do the same operations
(differences, a written-out sum of three squares, a square root) and so find equal numbers.

Of a large fleet only those near the sender are searched, as in a Verlet list: they were within the
reach and a margin at one time, the same for all senders, and the lists hold until some radio has
moved half of the margin since then.
"""

from collections.abc import Sequence
from math import nan, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from netem.compiled import is_preferred
from netem.faults import Position

KEPT_FROM: Final = 40
"""Number of receivers from which those near a sender are kept."""
ARRAYS_FROM: Final = 400 if is_preferred() else 40
"""Number of receivers from which arrays are faster than a loop, compiled or not."""
MARGIN_M: Final = 1.0
"""Receivers so far beyond the reach are kept among those that are near [m]."""
MOST_MOVED_M: Final = 0.499 * MARGIN_M
"""Less than half of the margin by more than any rounding [m]."""
InRange = list[tuple[int, float]]
"""Receivers and their distances [m], by receiver id."""
Floats = NDArray[np.float64]


class RangeIndex:
    """The positions of all radios; receivers: the ids that are searched, ascending."""

    def __init__(self, radios: int, receivers: tuple[int, ...]) -> None:
        self._receivers = receivers
        self._rows = np.array(receivers, dtype=np.int64)
        self.positions: tuple[Position | None, ...] = (None,) * radios
        self._array: Floats | None = None
        """The receivers' positions now, (3, R); None until they are needed."""
        self._before: tuple[Position | None, ...] = self.positions
        """The positions when ``_near`` was begun, and the receivers' as an array (3, R)."""
        self._array_before: Floats = np.full((3, len(receivers)), nan)
        self._near_holds = False
        """Whether it is known that ``_near`` holds now."""
        self._near: dict[float, list[Sequence[int] | None]] = {}
        """By reach, the receivers that were near each radio; None where it was not asked for."""
        self._found: dict[tuple[int, float], InRange] = {}

    def place(self, positions: tuple[Position | None, ...]) -> None:
        """Set the true positions, row i = radio i [m; world frame]; None where there is none."""
        self.positions = positions
        self._array = None
        self._near_holds = False
        self._found.clear()

    def in_range(self, source: int, reach_m: float) -> InRange:
        """Return the receivers other than the source within a distance [m] of it."""
        found = self._found.get((source, reach_m))
        if found is None:
            here = self.positions[source]
            found = [] if here is None else self._among_near(source, here, reach_m)
            self._found[source, reach_m] = found
        return found

    def near(self, source: int, reach_m: float) -> Sequence[int]:
        """Return receivers, all within a distance [m] of the source among them, ascending."""
        if len(self._receivers) < KEPT_FROM:
            return self._receivers
        if self.positions[source] is None:
            return ()
        if not self._near_holds:
            self._check_near()
        lists = self._near.get(reach_m)
        if lists is None:
            lists = self._near[reach_m] = [None for _ in self.positions]
        near = lists[source]
        if near is None:
            near = lists[source] = self._near_before(source, reach_m + MARGIN_M)
        return near

    def _among_near(self, source: int, here: Position, reach_m: float) -> InRange:
        near = self.near(source, reach_m)
        if len(near) < ARRAYS_FROM:
            return _by_loop(self.positions, source, here, reach_m, near)
        return self._by_array(self._placed(), source, here, reach_m)

    def _near_before(self, source: int, within_m: float) -> Sequence[int]:
        """Return the receivers within a distance [m] when ``_near`` was begun."""
        here = self._before[source]
        if here is None:
            return ()  # not asked for: ``_near`` is begun anew with a radio that appears
        if len(self._receivers) < ARRAYS_FROM:
            pairs = _by_loop(self._before, source, here, within_m, self._receivers)
        else:
            pairs = self._by_array(self._array_before, source, here, within_m)
        return [receiver for receiver, _ in pairs]

    def _check_near(self) -> None:
        """Begin ``_near`` anew if any radio has moved too far."""
        self._near_holds = True
        for radio, here in enumerate(self.positions):
            if here is None:
                continue
            before = self._before[radio]
            if before is None or not _is_within(here, before, MOST_MOVED_M):
                self._before = self.positions
                if len(self._receivers) >= ARRAYS_FROM:
                    self._array_before = self._placed()
                self._near.clear()
                return

    def _placed(self) -> Floats:
        """Return the receivers' positions (3, R) [m]."""
        if self._array is None:
            known = [self.positions[receiver] or (nan, nan, nan) for receiver in self._receivers]
            self._array = np.array(known).T.copy()
        return self._array

    def _by_array(self, positions: Floats, source: int, here: Position, reach_m: float) -> InRange:
        dx, dy, dz = (positions[axis] - here[axis] for axis in range(3))
        distance_m = np.sqrt(dx * dx + dy * dy + dz * dz)
        within = np.flatnonzero(distance_m <= reach_m)
        pairs = zip(self._rows[within].tolist(), distance_m[within].tolist(), strict=True)
        return [pair for pair in pairs if pair[0] != source]


def _by_loop(
    positions: tuple[Position | None, ...],
    source: int,
    here: Position,
    reach_m: float,
    receivers: Sequence[int],
) -> InRange:
    x, y, z = here
    found = []
    for receiver in receivers:
        there = positions[receiver]
        if there is None or receiver == source:
            continue
        a, b, c = there
        dx, dy, dz = a - x, b - y, c - z
        distance_m = sqrt(dx * dx + dy * dy + dz * dz)
        if distance_m <= reach_m:
            found.append((receiver, distance_m))
    return found


def _is_within(a: Position, b: Position, distance_m: float) -> bool:
    dx, dy, dz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return dx * dx + dy * dy + dz * dz <= distance_m * distance_m
