"""Scans that leap: most echoes at quite another distance than a scan ago, time after time.

No vehicle is so fast, and no way past obstacles does that to most rays at once: such a sensor tells
anything.
"""

from array import array

from agent.messages import NO_ECHO_MM, Scan

LEAP_MM = 1000
ECHOES = 8
"""Of fewer rays that met something twice nothing follows."""
SCANS = 3
"""So many leaps in a row make a sensor wrong, so many quiet scans right again."""


class ScanJumps:
    """Watches the scans of one sensor; ``wrong``: whether it tells anything."""

    def __init__(self) -> None:
        self.wrong = False
        self._before = array("H")
        self._leaps = self._quiet = 0

    def note(self, scan: Scan) -> None:
        """Take the next scan; one that has too few echoes in common with the last says nothing."""
        ranges = array("H", scan.ranges) if len(scan.ranges) % 2 == 0 else array("H")
        common = [
            abs(now - before) > LEAP_MM
            for now, before in zip(ranges, self._before, strict=False)
            if NO_ECHO_MM not in (now, before)
        ]
        self._before = ranges
        if len(common) >= ECHOES:
            self._count(leapt=2 * sum(common) > len(common))

    def _count(self, *, leapt: bool) -> None:
        self._leaps = self._leaps + 1 if leapt else 0
        self._quiet = 0 if leapt else self._quiet + 1
        self.wrong = self._leaps >= SCANS or (self.wrong and self._quiet < SCANS)
