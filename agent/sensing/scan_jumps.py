"""Detection of jumping sensors: most of a reading is quite elsewhere than in the one before.

No vehicle is so fast, and no flight past obstacles does that to most rays at once. A sensor that
jumps several times in a row measures nothing real. Where nothing is in reach it cannot jump; after
some time of that it counts as right again, as it did at first: if it is not, it jumps as soon as
something comes into reach.
"""

from array import array
from typing import Final

from agent.messages import NO_ECHO_MM, PROXIMITY_RANGE_M, Scan, Vector
from agent.vectors import apart, length

JUMP_MM: Final = 1000
MIN_ECHOES: Final = 8
"""Scans with fewer rays that have an echo in both are not compared."""
READINGS: Final = 3
"""So many jumps in a row make a sensor wrong; so many quiet readings make it right again."""
EMPTY_S: Final = 2.0
"""So long with nothing in reach makes a sensor right again [s]."""
SLACK_M: Final = 0.05


class _Jumps:
    """Counts readings that jumped; ``wrong``: whether the sensor's readings are arbitrary."""

    def __init__(self) -> None:
        self.wrong = False
        self._jumps = self._quiet = 0
        self._empty_since_s: float | None = None

    def interrupt(self) -> None:
        """Let the time with nothing in reach begin anew: there is something, but it is not read."""
        self._empty_since_s = None

    def count_empty(self, now_s: float) -> bool:
        """Count a reading with nothing in reach; return whether that has lasted for EMPTY_S."""
        if self._empty_since_s is None:
            self._empty_since_s = now_s
        if now_s - self._empty_since_s < EMPTY_S:
            return False
        self.wrong = False
        self._jumps = self._quiet = 0
        return True

    def count(self, *, jumped: bool) -> None:
        """Count a reading that could be compared with the one before."""
        self._empty_since_s = None
        self._jumps = self._jumps + 1 if jumped else 0
        self._quiet = 0 if jumped else self._quiet + 1
        self.wrong = self._jumps >= READINGS or (self.wrong and self._quiet < READINGS)


class VehicleJumps(_Jumps):
    """Watches the vehicles that a proximity sensor reads.

    max_speed: of the fleet's fastest vehicle [m/s]; noise_m: of a reading, per axis [m].
    """

    def __init__(self, max_speed: float, noise_m: float) -> None:
        super().__init__()
        self._closing_mps = 2.0 * max_speed
        self._slack_m = SLACK_M + 2.0**0.5 * 6.0 * noise_m
        self._before: tuple[Vector, ...] = ()
        self._read_s = 0.0

    def add(self, now_s: float, vehicles: tuple[Vector, ...]) -> bool:
        """Take the next reading, relative to the own centre [m; world axes].

        A vehicle near the edge of the sensor's range may have come in from outside, and counts as
        out of reach.

        Returns whether nothing has been in reach for EMPTY_S.
        """
        step_m = self._slack_m + self._closing_mps * (now_s - self._read_s)
        inside = new = 0
        for k, each in enumerate(vehicles):
            if length(each) < PROXIMITY_RANGE_M - step_m:
                inside += 1
                if _is_new(each, self._before, k, step_m):
                    new += 1
        self._before, self._read_s = vehicles, now_s
        if not inside:
            return self.count_empty(now_s)
        self.count(jumped=2 * new > inside)
        return False


def _is_new(vehicle: Vector, before: tuple[Vector, ...], likely: int, step_m: float) -> bool:
    """Whether no vehicle was near before. likely: number of the one that mostly was."""
    if likely < len(before) and apart(vehicle, before[likely]) <= step_m:
        return False
    for old in before:  # noqa: SIM110  # several times as fast as all()
        if apart(vehicle, old) <= step_m:
            return False
    return True


class ScanJumps(_Jumps):
    """Watches the scans of one sensor."""

    def __init__(self) -> None:
        super().__init__()
        self._before = array("H")

    def add(self, now_s: float, scan: Scan) -> None:
        """Take the next scan; one with too few echoes in common with the last is not compared."""
        ranges = array("H", scan.ranges) if len(scan.ranges) % 2 == 0 else array("H")
        jumped = [
            abs(now - before) > JUMP_MM
            for now, before in zip(ranges, self._before, strict=False)
            if NO_ECHO_MM not in (now, before)
        ]
        self._before = ranges
        if len(jumped) >= MIN_ECHOES:
            self.count(jumped=2 * sum(jumped) > len(jumped))
        elif len(ranges) - ranges.count(NO_ECHO_MM) < MIN_ECHOES:
            self.count_empty(now_s)
        else:
            self.interrupt()
