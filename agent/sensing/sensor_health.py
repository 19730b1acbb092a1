"""Sensor health: whether an agent may trust its sensors; one that does not stands still.

Stuck: a reading stays exactly the same while the vehicle moves. Silent: due scans do not arrive.
Silent or wrong: no vehicle is sensed where a near neighbour reports itself. Wrong: most echoes of a
scan, or most sensed vehicles, jump several times in a row.
"""

from collections.abc import Sequence
from math import hypot
from typing import Final

from agent.heard_beacon import HeardBeacon
from agent.messages import PROXIMITY_RANGE_M, Observation, Vector
from agent.sensing.own_pose import JUMP_M
from agent.sensing.ray_pattern import Pattern
from agent.sensing.scan_jumps import ScanJumps, VehicleJumps
from agent.sensing.seclusion import Seclusion
from agent.vectors import apart

MOVED_M: Final = 0.03
"""Once a vehicle has moved this far, its reading must have changed."""
LOST_SCANS: Final = 3
PROXIMITY: Final = -1
"""The proximity sensor's number beside the indices of SCANNERS."""
NO_ECHO_BYTE = b"\xff"
NEAR_M: Final = 1.2
FRESH_S: Final = 0.5
SLACK_M: Final = 0.3
LOOKS: Final = 3
"""So many looks in a row that miss a near neighbour make the sensors distrusted; so many that find
one, however far, make them trusted again: an agent that stands still is not where its team is.
Neighbours that have flown away prove nothing; then it follows them slowly (seclusion.py)."""
NO_READING: tuple[object, ...] = ((), (), ())


class SensorHealth:
    """Watches one agent's sensors. max_speed: limit of the fleet's fastest vehicle [m/s].

    vehicle_jumps: of the proximity sensor; None without one.

    noisy: sensors of which no two readings are equal. Without noise, vehicles side by side sense
    one another at the same position for ever, and so does a vehicle along a wall. Then only
    surfaces at rest prove a stuck sensor, to a vehicle that approaches or leaves them.
    """

    def __init__(
        self,
        patterns: Sequence[Pattern],
        vehicle_jumps: VehicleJumps | None,
        noisy: frozenset[int],
        tick_hz: float,
        max_speed: float,
    ) -> None:
        self._noisy = noisy
        self._due_s = {p.kind: LOST_SCANS * p.every / tick_hz for p in patterns}
        self._scanned_s: dict[int, float] = {}
        self._jumps = {p.kind: ScanJumps() for p in patterns}
        self._vehicle_jumps = vehicle_jumps
        self._max_speed = max_speed
        self._reading: tuple[object, ...] = ()
        self._read_at: Vector | None = None
        self._stuck = False
        self._missed = self._met = 0
        self._missed_s: dict[int, float] = {}
        self._accusers: dict[int, HeardBeacon] = {}
        """The last reports of those that were missed where they reported themselves."""
        self._blind = False
        self._has_jumped = False
        """Whether the proximity sensor has jumped since it was last trusted."""
        self._seclusion = Seclusion(max_speed)

        self.probing_mps = 0.0
        """How fast the agent may fly while its sensors may not be trusted [m/s]; 0: it stands."""

    def update(self, observation: Observation) -> bool:
        """Take a new observation; return whether the sensors may be trusted."""
        self._update_stuck(observation)
        faulty = bool(self._due_s) and (self._is_late(observation) or self._jumped(observation))
        faulty = faulty or self._stuck or self._vehicles_jumped(observation)
        self.probing_mps = 0.0 if faulty else self._seclusion.probing_mps
        return not (faulty or self._blind)

    def compare(self, observation: Observation, neighbours: Sequence[HeardBeacon]) -> None:
        """Check that near neighbours are sensed where they report themselves."""
        if self._vehicle_jumps is None:
            return
        here = observation.position
        self._discredit(neighbours)
        if self._has_jumped and any(self._is_unread(observation, each) for each in neighbours):
            self._vehicle_jumps.interrupt()
        near = [beacon for beacon in neighbours if apart(here, beacon.position) <= NEAR_M]
        looks = [(beacon, self._is_missed(observation, beacon)) for beacon in near]
        missed = {beacon.id: beacon.stamp_s for beacon, missed in looks if missed}
        met = any(missed is False for _, missed in looks)
        self._seclusion.update(observation, neighbours, met=met)
        self._accusers |= {beacon.id: beacon for beacon, missed in looks if missed}
        if missed:
            # A departed neighbour is missed too, but counts only once: it sends no new beacon.
            fresh = any(self._missed_s.get(other) != stamp_s for other, stamp_s in missed.items())
            self._missed, self._met = self._missed + fresh, 0
            self._blind = self._blind or self._missed >= LOOKS
        elif met or (
            self._blind and any(self._is_missed(observation, b) is False for b in neighbours)
        ):
            self._missed, self._met = 0, self._met + 1
            self._blind = self._blind and self._met < LOOKS
        self._missed_s = missed

    def _discredit(self, neighbours: Sequence[HeardBeacon]) -> None:
        """Trust the sensors again where all that were missed have misreported themselves.

        A report that jumps where no vehicle can have flown shows that the earlier ones were wrong.
        """
        if not self._accusers:
            return
        for beacon in neighbours:
            before = self._accusers.get(beacon.id)
            if before is None:
                continue
            flown_m = 2.0 * self._max_speed * abs(beacon.stamp_s - before.stamp_s)
            if apart(before.position, beacon.position) > flown_m + JUMP_M:
                del self._accusers[beacon.id]
            else:
                self._accusers[beacon.id] = beacon
        if not self._accusers:
            self._missed, self._blind = 0, False

    def _update_stuck(self, observation: Observation) -> None:
        if not observation.scans:
            if self._due_s:
                return
            if PROXIMITY not in self._noisy and not observation.obstacles:
                self._reading, self._stuck = NO_READING, False
                return
        reading = (
            observation.vehicles if PROXIMITY in self._noisy else (),
            observation.obstacles,
            tuple(
                scan.ranges
                for scan in observation.scans
                if scan.kind in self._noisy and scan.ranges.strip(NO_ECHO_BYTE)
            ),
        )
        if reading == NO_READING or reading != self._reading or self._read_at is None:
            self._reading, self._read_at, self._stuck = reading, observation.position, False
        elif self._must_have_changed(observation, self._read_at):
            self._stuck = True

    def _must_have_changed(self, observation: Observation, read_at: Vector) -> bool:
        """Whether the vehicle has moved too far for an unchanged reading to be true.

        Without noise a reading changes only as the vehicle approaches a surface or leaves it, not
        along a wall.
        """
        if apart(observation.position, read_at) <= MOVED_M:
            return False
        if PROXIMITY in self._noisy or self._reading[2]:
            return True
        x, y, z = (b - a for a, b in zip(read_at, observation.position, strict=True))
        return any(
            abs(x * u + y * v + z * w) > MOVED_M * hypot(u, v, w)
            for u, v, w in observation.obstacles
        )

    def _is_late(self, observation: Observation) -> bool:
        """Whether a due scan has not arrived."""
        now_s = observation.time_s
        for scan in observation.scans:
            self._scanned_s[scan.kind] = now_s
        return any(
            now_s - self._scanned_s.setdefault(kind, now_s) > due_s + 1e-9
            for kind, due_s in self._due_s.items()
        )

    def _jumped(self, observation: Observation) -> bool:
        """Whether a scanning sensor jumps."""
        for scan in observation.scans:
            if scan.kind in self._jumps:
                self._jumps[scan.kind].add(observation.time_s, scan)
        return any(jumps.wrong for jumps in self._jumps.values())

    def _vehicles_jumped(self, observation: Observation) -> bool:
        """Whether the proximity sensor jumps."""
        if self._vehicle_jumps is None:
            return False
        if self._vehicle_jumps.add(observation.time_s, observation.vehicles) and self._has_jumped:
            self._accusers.clear()
            self._missed, self._blind = 0, False
        wrong = self._vehicle_jumps.wrong
        self._has_jumped = wrong or (self._has_jumped and self._blind)
        return wrong

    def _is_unread(self, observation: Observation, beacon: HeardBeacon) -> bool:
        """Whether a neighbour reports itself within the sensor's range and is not sensed."""
        away_m = apart(observation.position, beacon.position)
        return away_m <= PROXIMITY_RANGE_M - SLACK_M and bool(self._is_missed(observation, beacon))

    def _is_missed(self, observation: Observation, beacon: HeardBeacon) -> bool | None:
        """Whether a near neighbour is not sensed; None where its beacon is too old to tell."""
        here, there = observation.position, beacon.position
        age_s = max(0.0, observation.time_s - beacon.stamp_s)
        if age_s > FRESH_S:
            return None
        slack = SLACK_M + self._max_speed * age_s
        away = (there[0] - here[0], there[1] - here[1], there[2] - here[2])
        return all(apart(away, vehicle) > slack for vehicle in observation.vehicles)
