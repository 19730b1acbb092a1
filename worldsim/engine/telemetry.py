"""The newest telemetry of each agent, and the tick that truth and telemetry make together."""

from math import atan2, degrees, hypot, nan, pi
from typing import Final

import numpy as np
from numpy.typing import NDArray

from agent.messages import NO_MISSION, Telemetry, Vector
from worldsim.judge.tick import HierarchyRows, Packets, Tick
from worldsim.truth.world import World

MOVING_MPS: Final = 0.02
"""A slower step has no azimuth [m/s]."""
NO_TARGET = (nan, nan, nan)
NO_PLACE = (-1, -1)
NO_LINKS: NDArray[np.int32] = np.zeros((0, 2), dtype=np.int32)
NO_TELEMETRY = Telemetry(
    wanted=(0.0, 0.0, 0.0),
    force=nan,
    target=None,
    place=None,
    heard=(),
    rejected=(),
    mission=NO_MISSION,
    tier=-1,
    parent=-1,
    role=-1,
    record_age_s=nan,
)
"""The row of an agent that has sent none."""


class FleetTelemetry:
    """The newest telemetry of each agent; row i = agent i."""

    def __init__(self, rows: int) -> None:
        self._newest = [NO_TELEMETRY] * rows
        self._turn_deg = [nan] * rows

    def update(self, agent: int, telemetry: Telemetry, heading: float) -> None:
        """Keep an agent's telemetry; heading: the yaw that it observed [rad; world frame]."""
        self._newest[agent] = telemetry
        self._turn_deg[agent] = _turn_deg(telemetry.wanted, heading)

    def forget(self, agent: int) -> None:
        """Drop the telemetry of an agent's earlier incarnation."""
        self._newest[agent] = NO_TELEMETRY
        self._turn_deg[agent] = nan

    def tick(
        self, world: World, running: NDArray[np.bool_], recorded: bool, packets: Packets
    ) -> Tick:
        """Return the present tick; agents that are not running have no telemetry in it.

        running: (N,). recorded: also fill links and hierarchy, which are recorded and not judged.
        """
        rows, turns_deg = self._rows(running)
        reasons = np.array(
            [(*(row.target or NO_TARGET), row.force) for row in rows], dtype=np.float32
        )
        return Tick(
            index=world.slot // world.clock.slots_per_tick,
            time_s=world.time_s,
            position=world.vehicles.position.copy(),
            attitude=_attitude(world),
            target=reasons[:, :3],
            place=np.array([row.place or NO_PLACE for row in rows], dtype=np.int16),
            force=reasons[:, 3],
            turn_deg=np.array(turns_deg, dtype=np.float64),
            alive=running.copy(),
            mission=np.array([row.mission for row in rows], dtype=np.int64),
            links=_links(rows) if recorded else NO_LINKS,
            packets=packets,
            hierarchy=_hierarchy_rows(rows) if recorded else None,
        )

    def _rows(self, running: NDArray[np.bool_]) -> tuple[list[Telemetry], list[float]]:
        """Return the telemetry and the turn [deg] of each agent that is running."""
        up = running.tolist()
        if False not in up:
            return self._newest, self._turn_deg
        return (
            [row if runs else NO_TELEMETRY for row, runs in zip(self._newest, up, strict=True)],
            [turn if runs else nan for turn, runs in zip(self._turn_deg, up, strict=True)],
        )


def _attitude(world: World) -> NDArray[np.float32]:
    attitude = np.empty((len(world.vehicles.yaw), 3), dtype=np.float32)
    attitude[:, 0], attitude[:, 1:] = world.vehicles.yaw, world.vehicles.tilt
    return attitude


def _links(rows: list[Telemetry]) -> NDArray[np.int32]:
    """Return (hearer, heard) pairs (L, 2)."""
    pairs = [(hearer, heard) for hearer, row in enumerate(rows) for heard in row.heard]
    return np.array(pairs, dtype=np.int32).reshape(-1, 2)


def _hierarchy_rows(rows: list[Telemetry]) -> HierarchyRows:
    return HierarchyRows(
        tier=np.array([row.tier for row in rows], dtype=np.int16),
        parent=np.array([row.parent for row in rows], dtype=np.int32),
        role=np.array([row.role for row in rows], dtype=np.int8),
        record_age_s=np.array([row.record_age_s for row in rows], dtype=np.float32),
    )


def _turn_deg(wanted: Vector, heading: float) -> float:
    """Return the wanted turn [deg] in (-180, 180]; NaN for a step too slow to have an azimuth."""
    if hypot(wanted[0], wanted[1]) <= MOVING_MPS:
        return nan
    turn = atan2(wanted[1], wanted[0]) - heading
    return degrees(turn - 2.0 * pi * round(turn / (2.0 * pi)))
