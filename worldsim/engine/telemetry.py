"""What agents told of their reasons, and beside the truth as rows of a tick."""

from math import atan2, degrees, hypot, nan, pi

import msgspec
import numpy as np
from numpy.typing import NDArray

from agent.messages import Telemetry, Vector
from worldsim.judge.tick import HierarchyRows, Packets, Tick
from worldsim.truth.world import World

MOVING_MPS = 0.02
NO_LINKS: NDArray[np.int32] = np.zeros((0, 2), dtype=np.int32)


class TelemetryRow(msgspec.Struct, frozen=True, gc=False):
    """What an agent last told of its reasons, as a row of a tick; see Telemetry and Tick."""

    target: Vector
    place: tuple[int, int]
    force: float
    turn_deg: float
    heard: tuple[int, ...]
    mission: int
    tier: int
    parent: int
    role: int
    record_age_s: float


NO_TELEMETRY = TelemetryRow((nan, nan, nan), (-1, -1), nan, nan, (), 0, -1, -1, -1, nan)


def telemetry_row(telemetry: Telemetry, heading: float) -> TelemetryRow:
    """Return an agent's telemetry as its row; heading: what it observed as its own [rad]."""
    return TelemetryRow(
        telemetry.target or NO_TELEMETRY.target,
        telemetry.place or NO_TELEMETRY.place,
        telemetry.force,
        _turn_deg(telemetry.wanted, heading),
        telemetry.heard,
        telemetry.mission,
        telemetry.tier,
        telemetry.parent,
        telemetry.role,
        telemetry.record_age_s,
    )


def tick_of(
    world: World, told: list[TelemetryRow], awake: NDArray[np.bool_], shown: bool, packets: Packets
) -> Tick:
    """Return the present tick; shown: with what is recorded and not judged, links first of all.

    awake (N,): who steps; the others tell nothing.
    """
    rows = [row if up else NO_TELEMETRY for row, up in zip(told, awake.tolist(), strict=True)]
    fleet = world.vehicles
    reasons = np.array([(*row.target, row.force, row.turn_deg) for row in rows], dtype=np.float32)
    attitude = np.empty((len(rows), 3), dtype=np.float32)
    attitude[:, 0], attitude[:, 1:] = fleet.yaw, fleet.tilt
    return Tick(
        index=world.slot // world.clock.slots_per_tick,
        time_s=world.time_s,
        position=fleet.position.astype(np.float32),
        attitude=attitude,
        target=reasons[:, :3],
        place=np.array([row.place for row in rows], dtype=np.int16),
        force=reasons[:, 3],
        turn_deg=reasons[:, 4],
        alive=awake.copy(),
        mission=np.array([row.mission for row in rows], dtype=np.int64),
        links=_links(rows) if shown else NO_LINKS,
        packets=packets,
        hierarchy=_hierarchy_rows(rows) if shown else None,
    )


def _links(rows: list[TelemetryRow]) -> NDArray[np.int32]:
    pairs = [(row, other) for row, each in enumerate(rows) for other in each.heard]
    return np.array(pairs, dtype=np.int32).reshape(-1, 2)


def _hierarchy_rows(rows: list[TelemetryRow]) -> HierarchyRows:
    return HierarchyRows(
        tier=np.array([row.tier for row in rows], dtype=np.int16),
        parent=np.array([row.parent for row in rows], dtype=np.int32),
        role=np.array([row.role for row in rows], dtype=np.int8),
        record_age_s=np.array([row.record_age_s for row in rows], dtype=np.float32),
    )


def _turn_deg(wanted: Vector, heading: float) -> float:
    """Return the wanted turn [deg] in (-180, 180]; NaN for a step too slow to have an azimuth."""
    if hypot(wanted[0], wanted[1]) <= MOVING_MPS:
        return float("nan")
    turn = atan2(wanted[1], wanted[0]) - heading
    return degrees(turn - 2.0 * pi * round(turn / (2.0 * pi)))
