"""Whether an agent may believe its sensors: one that doubts them stops.

Stuck: a reading stays the very same while the vehicle moves. Silent: scans that are due do not
come. Silent or wrong: nothing is sensed where a neighbour near by says it is. Wrong: most echoes of
a scan leap, time after time.
"""

from collections.abc import Sequence
from math import dist, hypot

from agent.messages import Beacon, Observation, Vector
from agent.sensing.ray_pattern import Pattern
from agent.sensing.scan_jumps import ScanJumps

MOVED_M = 0.03
"""By so much a vehicle moves before a reading must have changed."""
LOST_SCANS = 3
PROXIMITY = -1
"""Stands for the proximity sensor beside the kinds of scans."""
NOWHERE = b"\xff"
NEAR_M = 1.2
FRESH_S = 0.5
SLACK_M = 0.3
LOOKS = 3
"""So many looks in a row miss a neighbour before the sensor is doubted, and find one before it is
believed again: that they have flown on proves nothing."""


class SensorHealth:
    """Watches one agent's sensors; max_speed: of any vehicle [m/s].

    noisy: sensors of which no two readings are the same. Without noise, those who fly side by side
    see one another at the very same place for ever, and so does who flies along a wall; then only
    what does not move shows it, to those who come nearer or go away.
    """

    def __init__(
        self,
        patterns: Sequence[Pattern],
        ranging: bool,
        noisy: frozenset[int],
        tick_hz: float,
        max_speed: float,
    ) -> None:
        self._noisy = noisy
        self._due_s = {p.kind: LOST_SCANS * p.every / tick_hz for p in patterns}
        self._scanned_s: dict[int, float] = {}
        self._leaps = {p.kind: ScanJumps() for p in patterns}
        self._ranging = ranging
        self._max_speed = max_speed
        self._reading: tuple[object, ...] = ()
        self._read_at: Vector | None = None
        self._stuck = False
        self._missed = self._met = 0
        self._missed_s: dict[int, float] = {}
        self._blind = False

    def note(self, observation: Observation) -> bool:
        """Take what is sensed now; return whether it may be believed."""
        self._note_change(observation)
        amiss = bool(self._due_s) and (self._late(observation) or self._leap(observation))
        return not (self._stuck or amiss or self._blind)

    def compare(self, observation: Observation, neighbours: Sequence[Beacon]) -> None:
        """Look whether neighbours near by are sensed where they say they are."""
        if not self._ranging:
            return
        here = observation.position
        near = [beacon for beacon in neighbours if dist(here, beacon.position) <= NEAR_M]
        looks = [(beacon, self._is_missed(observation, beacon)) for beacon in near]
        missed = {beacon.id: beacon.stamp_s for beacon, missed in looks if missed}
        if missed:
            # Whoever left is missed too, but says so only once: what it said last stays the last.
            spoken = any(self._missed_s.get(who) != stamp_s for who, stamp_s in missed.items())
            self._missed, self._met = self._missed + spoken, 0
            self._blind = self._blind or self._missed >= LOOKS
        elif any(missed is False for _, missed in looks):
            self._missed, self._met = 0, self._met + 1
            self._blind = self._blind and self._met < LOOKS
        self._missed_s = missed

    def _note_change(self, observation: Observation) -> None:
        if self._due_s and not observation.scans:
            return
        reading = (
            observation.vehicles if PROXIMITY in self._noisy else (),
            observation.obstacles,
            tuple(
                scan.ranges
                for scan in observation.scans
                if scan.kind in self._noisy and scan.ranges.strip(NOWHERE)
            ),
        )
        if reading == NO_READING or reading != self._reading or self._read_at is None:
            self._reading, self._read_at, self._stuck = reading, observation.position, False
        elif self._must_have_changed(observation, self._read_at):
            self._stuck = True

    def _must_have_changed(self, observation: Observation, read_at: Vector) -> bool:
        """Whether the vehicle has moved too far for a reading that stayed the same.

        Without noise one sees no change along a wall, but as one comes nearer or goes away.
        """
        if dist(observation.position, read_at) <= MOVED_M:
            return False
        if PROXIMITY in self._noisy or self._reading[2]:
            return True
        x, y, z = (b - a for a, b in zip(read_at, observation.position, strict=True))
        return any(
            abs(x * u + y * v + z * w) > MOVED_M * hypot(u, v, w)
            for u, v, w in observation.obstacles
        )

    def _late(self, observation: Observation) -> bool:
        now_s = observation.time_s
        for scan in observation.scans:
            self._scanned_s[scan.kind] = now_s
        return any(
            now_s - self._scanned_s.setdefault(kind, now_s) > due_s + 1e-9
            for kind, due_s in self._due_s.items()
        )

    def _leap(self, observation: Observation) -> bool:
        for scan in observation.scans:
            if scan.kind in self._leaps:
                self._leaps[scan.kind].note(scan)
        return any(leaps.wrong for leaps in self._leaps.values())

    def _is_missed(self, observation: Observation, beacon: Beacon) -> bool | None:
        """Whether a neighbour near by is not sensed; None where its word proves nothing."""
        here, there = observation.position, beacon.position
        age_s = max(0.0, observation.time_s - beacon.stamp_s)
        if age_s > FRESH_S:
            return None
        slack = SLACK_M + self._max_speed * age_s
        away = (there[0] - here[0], there[1] - here[1], there[2] - here[2])
        return all(dist(away, body) > slack for body in observation.vehicles)


NO_READING: tuple[object, ...] = ((), (), ())
