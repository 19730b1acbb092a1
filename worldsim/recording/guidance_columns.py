"""What Fig. 5 of the paper draws: cast-zones, bobber points, and the way to the target-on-queue.

They are computed here from the truth, as each agent would from its pose: of the Q-structure's
guidance, telemetry holds the target-on-queue only. Of a moving frame the lead of the aim point is
left out. Hidden by the layout until asked for, and recorded at a lower rate.
"""

from collections.abc import Iterator, Sequence
from math import cos, radians, sin

import numpy as np

from agent.guidance.bobber import CastZone, bobber, cast_reach, cast_zone
from agent.guidance.cone import cone_of
from agent.messages import Vector
from netem.conditions import LinkModels
from netem.wire.channels import LOCAL
from worldsim.judge.tick import Tick
from worldsim.recording import layout
from worldsim.recording.columns import ColumnBlock
from worldsim.recording.components import POINTS, STRIPS
from worldsim.scenario.tables import Scenario
from worldsim.truth.vehicle import Floats

SAMPLES_HZ = 2.0
ARC_POINTS = 9
RESTING_M = 1e-3
"""A vehicle so near to its target has no way to it."""


class GuidanceColumns:
    """Makes the columns of one block of ticks after the other; none for a large fleet."""

    def __init__(self, scenario: Scenario) -> None:
        range_m = LinkModels(scenario.netem).of_channel(LOCAL).reach_m
        reach_m = cast_reach(scenario.control, range_m)
        self._zones = [
            cast_zone(
                cone_of(vehicle),
                reach_m,
                vehicle.max_speed_mps,
                radians(vehicle.max_yaw_rate_dps),
            )
            for vehicle in (scenario.vehicles if scenario.rows <= layout.NAMED_MAX else ())
        ]
        self._outline = np.array([_outline(zone) for zone in self._zones])
        samples_hz = SAMPLES_HZ if scenario.rows <= layout.FEW_MAX else 0.5 * SAMPLES_HZ
        self._ticks_per_sample = max(1, round(scenario.fleet.tick_hz / samples_hz))

    def blocks(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Yield the columns of a block; blocks come in order."""
        rows = [row for row, tick in enumerate(ticks) if tick.index % self._ticks_per_sample == 0]
        if not rows or not self._zones:
            return
        drawn = [self._ways(ticks[row]) for row in rows]
        lengths = [len(each) for each in drawn]
        ways = np.array([way for each in drawn for way in each]).reshape(-1, 3, 3)
        yield ColumnBlock(layout.BOBBERS, rows, [POINTS.parts(ways[:, 1], lengths)])
        yield ColumnBlock(layout.WAYS, rows, [STRIPS.parts(ways, lengths)])
        zones = [self._outlines(ticks[row]) for row in rows]
        outlines = STRIPS.parts(np.concatenate(zones), [len(each) for each in zones])
        yield ColumnBlock(layout.CAST_ZONES, rows, [outlines])

    def _ways(self, tick: Tick) -> list[list[Vector]]:
        """Return a line of each agent with a target: vehicle, bobber, target (3, 3) [m]."""
        ways = []
        yaws = tick.attitude[:, 0].tolist()
        aims, places = tick.target.astype(np.float64), tick.position
        away = np.linalg.norm(aims - places, axis=1)  # NaN without a target
        for agent in np.flatnonzero(tick.alive & (away > RESTING_M)).tolist():
            (x, y, z), (u, v, w) = places[agent].tolist(), aims[agent].tolist()
            point = bobber((x, y, z), yaws[agent], (u, v, w), self._zones[agent])
            ways.append([(x, y, z), point, (u, v, w)])
        return ways

    def _outlines(self, tick: Tick) -> Floats:
        """Return the outlines of the running agents' cast-zones (K, P, 3) [m; world frame]."""
        running = tick.alive & np.isfinite(tick.position).all(axis=1)
        yaw = tick.attitude[running, 0].astype(np.float64)[:, None, None]
        x, y = self._outline[running, :, :1], self._outline[running, :, 1:]
        turned = (x * np.cos(yaw) - y * np.sin(yaw), x * np.sin(yaw) + y * np.cos(yaw))
        level = np.concatenate((*turned, np.zeros_like(x)), axis=2)
        outlines: Floats = tick.position[running, None, :] + level
        return outlines


def _outline(zone: CastZone) -> list[tuple[float, float]]:
    """Return the outline of a cast-zone about its vehicle (P, 2) [m; ahead and to the left]."""
    angles = np.linspace(-zone.cone.right, zone.cone.left, ARC_POINTS).tolist()
    arc = [(zone.reach * cos(angle), zone.reach * sin(angle)) for angle in angles]
    return [(0.0, 0.0), *arc, (0.0, 0.0)]
