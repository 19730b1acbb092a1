"""Detection of jumping scans: most echoes at quite another distance than in the scan before.

No vehicle is so fast, and no flight past obstacles does that to most rays at once. A sensor that
jumps several times in a row measures nothing real.
"""

from array import array

from agent.messages import NO_ECHO_MM, Scan

JUMP_MM = 1000
MIN_ECHOES = 8
"""Scans with fewer rays that have an echo in both are not compared."""
SCANS = 3
"""So many jumps in a row make a sensor wrong; so many quiet scans in a row make it right again."""


class ScanJumps:
    """Watches the scans of one sensor; ``wrong``: whether its readings are arbitrary."""

    def __init__(self) -> None:
        self.wrong = False
        self._before = array("H")
        self._jumps = self._quiet = 0

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
            self._count(jumped=2 * sum(jumped) > len(jumped))

    def _count(self, *, jumped: bool) -> None:
        self._jumps = self._jumps + 1 if jumped else 0
        self._quiet = 0 if jumped else self._quiet + 1
        self.wrong = self._jumps >= SCANS or (self.wrong and self._quiet < SCANS)
