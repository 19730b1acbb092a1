"""Detection of jumping sensors: most of a reading is quite elsewhere than in the one before.

No vehicle is so fast, and no flight past obstacles does that to most rays at once. A sensor that
jumps several times in a row measures nothing real.
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
SLACK_M: Final = 0.05


class _Jumps:
    """Counts readings that jumped; ``wrong``: whether the sensor's readings are arbitrary."""

    def __init__(self) -> None:
        self.wrong = False
        self._jumps = self._quiet = 0

    def count(self, *, jumped: bool) -> None:
        """Count a reading that could be compared with the one before."""
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

    def add(self, now_s: float, vehicles: tuple[Vector, ...]) -> None:
        """Take the next reading, relative to the own centre [m; world axes].

        A vehicle near the edge of the sensor's range may have come in from outside.
        """
        step_m = self._slack_m + self._closing_mps * (now_s - self._read_s)
        inside = new = 0
        for each in vehicles:
            if length(each) < PROXIMITY_RANGE_M - step_m:
                inside += 1
                if _is_new(each, self._before, step_m):
                    new += 1
        if inside:
            self.count(jumped=2 * new > inside)
        self._before, self._read_s = vehicles, now_s


def _is_new(vehicle: Vector, before: tuple[Vector, ...], step_m: float) -> bool:
    for old in before:  # noqa: SIM110  # several times as fast as all()
        if apart(vehicle, old) <= step_m:
            return False
    return True


class ScanJumps(_Jumps):
    """Watches the scans of one sensor."""

    def __init__(self) -> None:
        super().__init__()
        self._before = array("H")

    def add(self, scan: Scan) -> None:
        """Take the next scan; with too few echoes in common with the last it changes nothing."""
        ranges = array("H", scan.ranges) if len(scan.ranges) % 2 == 0 else array("H")
        jumped = [
            abs(now - before) > JUMP_MM
            for now, before in zip(ranges, self._before, strict=False)
            if NO_ECHO_MM not in (now, before)
        ]
        self._before = ranges
        if len(jumped) >= MIN_ECHOES:
            self.count(jumped=2 * sum(jumped) > len(jumped))
