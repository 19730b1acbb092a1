"""Sensors that fail: stuck at their last reading, silent, or wrong, until they work again.

What a wrong sensor tells is keyed by (seed, agent, slot), like all noise.
"""

from typing import Literal

import numpy as np

from agent.messages import PROXIMITY_RANGE_M, Scan, Vector
from agent.sensing.ray_pattern import SCANNERS
from worldsim.truth.proximity_sensor import Sensed

Mode = Literal["stuck", "silent", "wrong"]
SENSORS = ("proximity", *SCANNERS)
NOTHING = Sensed(())
SALT = 1 << 60


class SensorFaults:
    """Which sensors of which agents have failed, and what they told when they got stuck."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._modes: dict[tuple[int, str], Mode] = {}
        self._frozen: dict[tuple[int, str], Sensed | Scan] = {}

    def __bool__(self) -> bool:
        return bool(self._modes)

    def set(self, agent: int, sensor: str | None, mode: Mode | None) -> None:
        """Let an agent's sensor fail, or all with None; with no mode it works again."""
        for name in SENSORS if sensor is None else (sensor,):
            self._frozen.pop((agent, name), None)
            self._modes.pop((agent, name), None)
            if mode is not None:
                self._modes[agent, name] = mode

    def sensed(self, agent: int, true: Sensed, slot: int) -> Sensed:
        """Return what the proximity sensor tells of what is truly there."""
        mode = self._modes.get((agent, "proximity"))
        if mode == "silent":
            return NOTHING
        if mode == "stuck":
            frozen = self._frozen.setdefault((agent, "proximity"), true)
            return frozen if isinstance(frozen, Sensed) else true
        return self._anywhere(true, agent, slot) if mode == "wrong" else true

    def scans(self, agent: int, true: tuple[Scan, ...], slot: int) -> tuple[Scan, ...]:
        """Return what the scanning sensors tell of what is truly there."""
        told = (self._scan(agent, scan, slot) for scan in true)
        return tuple(scan for scan in told if scan is not None)

    def _scan(self, agent: int, true: Scan, slot: int) -> Scan | None:
        name = SCANNERS[true.kind]
        mode = self._modes.get((agent, name))
        if mode == "silent":
            return None
        if mode == "stuck":
            frozen = self._frozen.setdefault((agent, name), true)
            return frozen if isinstance(frozen, Scan) else true
        if mode == "wrong":
            count = len(true.ranges) // 2
            ranges = self._generator(agent, slot).integers(1 << 16, size=count)
            return Scan(true.kind, ranges.astype("<u2").tobytes())
        return true

    def _anywhere(self, true: Sensed, agent: int, slot: int) -> Sensed:
        """Return as many bodies and points as there are, each somewhere within the range."""
        count = len(true.vehicles) + len(true.obstacles)
        reach = PROXIMITY_RANGE_M / 3.0**0.5
        strewn = self._generator(agent, slot).uniform(-reach, reach, (count, 3)).tolist()
        told: list[Vector] = [(x, y, z) for x, y, z in strewn]
        vehicles = len(true.vehicles)
        return Sensed(tuple(told[:vehicles]), tuple(told[vehicles:]))

    def _generator(self, agent: int, slot: int) -> np.random.Generator:
        key = [self._seed, SALT | agent << 40 | slot]
        return np.random.Generator(np.random.Philox(key=key))
