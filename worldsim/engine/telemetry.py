"""The newest telemetry of each agent, and the tick that truth and telemetry make together."""

from math import atan2, degrees, hypot, nan, pi
from struct import pack
from typing import Final, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from agent.messages import NO_MISSION, Telemetry, Vector
from worldsim.judge.tick import NO_SIGNALS, HierarchyRows, Packets, Tick
from worldsim.truth.vehicle import array_of
from worldsim.truth.world import World

_Row = TypeVar("_Row")
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
    filter_mps=nan,
)
"""The row of an agent that has sent none."""


@final
class _Claims:
    """What each agent claims in a tick; row i = agent i, NO_TELEMETRY for one not running."""

    def __init__(self, newest: list[Telemetry], running: NDArray[np.bool_]) -> None:
        self.alive = running.copy()
        self.up: list[bool] = running.tolist()
        self._all_up = False not in self.up
        rows = self.among(newest, NO_TELEMETRY)
        self.place = np.array([row.place or NO_PLACE for row in rows], dtype=np.int16)
        self.mission = np.array([row.mission for row in rows], dtype=np.int64)
        for each in (self.alive, self.place, self.mission):
            each.flags.writeable = False  # many ticks share them

    def among(self, rows: list[_Row], none: _Row) -> list[_Row]:
        """Return the rows of the agents that are running, and ``none`` for the others."""
        if self._all_up:
            return rows
        return [row if runs else none for row, runs in zip(rows, self.up, strict=True)]


class FleetTelemetry:
    """The newest telemetry of each agent; row i = agent i."""

    def __init__(self, rows: int) -> None:
        self._newest = [NO_TELEMETRY] * rows
        self._turn_deg = [nan] * rows
        self._reporting: set[int] = set()
        """The agents whose controllers state signals."""
        self._claims: _Claims | None = None
        """None once an agent claims another place or mission."""
        self._no_reasons = np.full((rows, 4), nan, dtype=np.float32)

    def update(self, agent: int, telemetry: Telemetry, heading: float) -> None:
        """Keep an agent's telemetry. heading: the yaw that it observed [rad; world frame]."""
        last = self._newest[agent]
        if telemetry.place != last.place or telemetry.mission != last.mission:
            self._claims = None
        self._newest[agent] = telemetry
        self._turn_deg[agent] = _turn_deg(telemetry.wanted, heading)
        report = telemetry.report
        if report is not None and report.signals:
            self._reporting.add(agent)
        elif self._reporting:
            self._reporting.discard(agent)

    def forget(self, agent: int) -> None:
        """Drop the telemetry of an agent's earlier incarnation."""
        self._claims = None
        self._newest[agent] = NO_TELEMETRY
        self._turn_deg[agent] = nan
        self._reporting.discard(agent)

    def tick(
        self, world: World, running: NDArray[np.bool_], recorded: bool, packets: Packets
    ) -> Tick:
        """Return the present tick; agents that are not running have no telemetry in it.

        running: (N,). recorded: also fill what is recorded and not judged: targets, forces, links
        and the hierarchy.
        """
        claims = self._claims_of(running)
        rows = claims.among(self._newest, NO_TELEMETRY) if recorded else []
        reasons = _reasons(rows) if recorded else self._no_reasons
        return Tick(
            index=world.slot // world.clock.slots_per_tick,
            time_s=world.time_s,
            position=world.vehicles.position,
            attitude=_attitude(world),
            target=reasons[:, :3],
            place=claims.place,
            force=reasons[:, 3],
            turn_deg=array_of(claims.among(self._turn_deg, nan)),
            alive=claims.alive,
            mission=claims.mission,
            links=_links(rows) if recorded else NO_LINKS,
            packets=packets,
            hierarchy=_hierarchy_rows(rows) if recorded else None,
            filtered_mps=_filtered_mps(rows) if recorded else None,
            signals=self._signals(claims.up) if self._reporting else NO_SIGNALS,
        )

    def _signals(self, up: list[bool]) -> dict[str, NDArray[np.float64]]:
        """Return the signals of the agents that are running, each (N,)."""
        signals: dict[str, NDArray[np.float64]] = {}
        for agent in sorted(self._reporting):
            report = self._newest[agent].report
            for name, value in report.signals if report is not None and up[agent] else ():
                if name not in signals:
                    signals[name] = np.full(len(up), nan)
                signals[name][agent] = value
        return signals

    def _claims_of(self, running: NDArray[np.bool_]) -> _Claims:
        claims = self._claims
        if claims is None or claims.alive.tobytes() != running.tobytes():
            claims = self._claims = _Claims(self._newest, running)
        return claims


def _reasons(rows: list[Telemetry]) -> NDArray[np.float32]:
    """Return each agent's target-on-queue and force (N, 4)."""
    return np.array([(*(row.target or NO_TARGET), row.force) for row in rows], dtype=np.float32)


def _filtered_mps(rows: list[Telemetry]) -> NDArray[np.float32]:
    """Return by how much each agent's safety filter changes its velocity, or would (N,) [m/s]."""
    return np.array([row.filter_mps for row in rows], dtype=np.float32)


def _attitude(world: World) -> NDArray[np.float32]:
    tilts = world.vehicles.tilts
    rows: list[float] = []
    for agent, yaw in enumerate(world.vehicles.yaws):
        pitch, roll = tilts[agent]
        rows.append(yaw)
        rows.append(pitch)
        rows.append(roll)
    return np.frombuffer(pack(f"{len(rows)}f", *rows), dtype=np.float32).reshape(-1, 3)


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
    turns = turn / (2.0 * pi)
    if not -0.5 <= turns <= 0.5:  # seldom, and round() takes long
        turn -= 2.0 * pi * round(turns)
    return degrees(turn)
