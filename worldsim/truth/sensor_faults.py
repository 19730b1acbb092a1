"""Sensors that fail: stuck at their last reading, silent, or wrong, until they work again.

Wrong readings are keyed by (seed, agent, slot), as all noise is.
"""

from typing import assert_never

import numpy as np

from agent.config import SCANNERS
from agent.messages import PROXIMITY_RANGE_M, Scan, Vector
from worldsim.scenario.faults import FailureMode
from worldsim.truth.proximity_sensor import NO_READING, ProximityReading

SENSORS = ("proximity", *SCANNERS)
KEY_SALT = 1 << 60


class SensorFaults:
    """Which sensors of which agents have failed, and the readings at which they are stuck.

    Of several faults of a sensor the latest acts; when it ends, the one before acts again.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._faults: dict[tuple[int, str], dict[int, FailureMode]] = {}
        """Faults in force by number, in the order in which they began."""
        self._acting: dict[tuple[int, str], tuple[int, FailureMode]] = {}
        """The number and mode of the fault that acts on a sensor."""
        self.struck: dict[int, int] = {}
        """How many readings each fault changed, by its number."""
        self._stuck_readings: dict[int, ProximityReading] = {}
        self._stuck_scans: dict[tuple[int, str], Scan] = {}

    def redraw(self, seed: int) -> None:
        """Draw later wrong readings from another seed; faults in force stay."""
        self._seed = seed

    def __bool__(self) -> bool:
        return bool(self._acting)

    @property
    def agents(self) -> set[int]:
        """The agents that have a failed sensor."""
        return {agent for agent, _ in self._acting}

    def begin(self, number: int, agent: int, sensor: str | None, mode: FailureMode) -> None:
        """Begin a fault of an agent's sensor (None: of all its sensors)."""
        for name in SENSORS if sensor is None else (sensor,):
            self._faults.setdefault((agent, name), {})[number] = mode
            self._act(agent, name)

    def end(self, number: int, agent: int) -> None:
        """End a fault of an agent's sensors."""
        for name in SENSORS:
            if self._faults.get((agent, name), {}).pop(number, None) is not None:
                self._act(agent, name)

    def _act(self, agent: int, name: str) -> None:
        """Let the latest fault in force act on a sensor, from its present reading on."""
        self._acting.pop((agent, name), None)
        self._stuck_scans.pop((agent, name), None)
        if name == "proximity":
            self._stuck_readings.pop(agent, None)
        faults = list(self._faults[agent, name].items())
        if faults:
            self._acting[agent, name] = faults[-1]

    def reading(self, agent: int, true: ProximityReading, slot: int) -> ProximityReading:
        """Return the reading of an agent's proximity sensor, given the true one."""
        acting = self._acting.get((agent, "proximity"))
        if acting is None:
            return true
        number, mode = acting
        reading = self._failed_reading(mode, agent, true, slot)
        shown, seen = (reading.vehicles, reading.obstacles), (true.vehicles, true.obstacles)
        self._count(number, changed=shown != seen)
        return reading

    def _failed_reading(
        self, mode: FailureMode, agent: int, true: ProximityReading, slot: int
    ) -> ProximityReading:
        match mode:
            case "silent":
                return NO_READING
            case "stuck":
                return self._stuck_readings.setdefault(agent, true)
            case "wrong":
                return self._wrong_reading(true, agent, slot)
        assert_never(mode)

    def _count(self, number: int, *, changed: bool) -> None:
        self.struck[number] = self.struck.get(number, 0) + changed

    def scans(self, agent: int, true: tuple[Scan, ...], slot: int) -> tuple[Scan, ...]:
        """Return the scans of an agent's scanning sensors, given the true ones."""
        scans = (self._scan(agent, scan, slot) for scan in true)
        return tuple(scan for scan in scans if scan is not None)

    def _scan(self, agent: int, true: Scan, slot: int) -> Scan | None:
        acting = self._acting.get((agent, SCANNERS[true.kind]))
        if acting is None:
            return true
        number, mode = acting
        scan = self._failed_scan(mode, agent, true, slot)
        self._count(number, changed=scan != true)
        return scan

    def _failed_scan(self, mode: FailureMode, agent: int, true: Scan, slot: int) -> Scan | None:
        match mode:
            case "silent":
                return None
            case "stuck":
                return self._stuck_scans.setdefault((agent, SCANNERS[true.kind]), true)
            case "wrong":
                return self._wrong_scan(true, agent, slot)
        assert_never(mode)

    def _wrong_scan(self, true: Scan, agent: int, slot: int) -> Scan:
        """Return random ranges, as many as there are."""
        count = len(true.ranges) // 2
        ranges = self._generator(agent, slot).integers(1 << 16, size=count)
        return Scan(true.kind, ranges.astype("<u2").tobytes())

    def _wrong_reading(self, true: ProximityReading, agent: int, slot: int) -> ProximityReading:
        """Return as many vehicles and points as there are, at random places within the range."""
        count = len(true.vehicles) + len(true.obstacles)
        reach = PROXIMITY_RANGE_M / 3.0**0.5
        drawn = self._generator(agent, slot).uniform(-reach, reach, (count, 3)).tolist()
        places: list[Vector] = [(x, y, z) for x, y, z in drawn]
        vehicles = len(true.vehicles)
        return ProximityReading(tuple(places[:vehicles]), tuple(places[vehicles:]))

    def _generator(self, agent: int, slot: int) -> np.random.Generator:
        key = [self._seed, KEY_SALT | agent << 40 | slot]
        return np.random.Generator(np.random.Philox(key=key))
