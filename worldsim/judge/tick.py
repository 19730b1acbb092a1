"""What is judged and recorded once a tick: the same rows for both, so that both agree.

What is judged is stored as it is: positions and turns in double precision, so that a figure is as
exact far from the origin as at it. A verdict recomputed from the recording therefore has the
numbers of the first one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from worldsim.truth.vehicle import Floats

Float32s = NDArray[np.float32]
Packets = dict[str, int]
"""Counters of the medium by name, as in summary.json."""
NO_SIGNALS: Mapping[str, Floats] = {}
NO_ROLE: Final = -1
"""The role of an agent that is not running (dead, paused or booting)."""


@dataclass(frozen=True, slots=True)
class HierarchyRows:
    """Agents in the hierarchy of their queues, as they report it: shown, not judged.

    Row i is agent i.
    """

    tier: NDArray[np.int16]  # (N,), -1 for none
    parent: NDArray[np.int32]  # (N,), an agent's id, -1 for none
    role: NDArray[np.int8]  # (N,), an index of agent.messages.ROLES, or NO_ROLE
    record_age_s: Float32s  # (N,), age [s] of the oldest team record, NaN for one not running

    def __reduce__(self) -> tuple[Any, ...]:
        return HierarchyRows, _values(self)


@final
@dataclass(init=False, eq=False)
class Tick:
    """One tick of truth and telemetry; nobody changes it.

    Row i is agent i. NaN means that the vehicle is not in the world. Where ticks are not recorded,
    what is not judged is NaN or empty.
    """

    index: int
    time_s: float  # simulated time [s]
    position: Floats  # (N, 3) [m; world frame]
    attitude: Float32s  # (N, 3) yaw, pitch, roll [rad]
    target: Float32s  # (N, 3) target-on-queue [m; world frame], NaN for none; not judged
    place: NDArray[np.int16]  # (N, 2) queue and rank claimed, -1 for none
    force: Float32s  # (N,) |u_i| of (28); not judged
    turn_deg: Floats  # (N,) desired azimuth minus heading [deg], NaN for a step without motion
    alive: NDArray[np.bool_]  # (N,) whether the process takes part, and is not paused
    links: NDArray[np.int32]  # (L, 2) hearer and heard
    mission: NDArray[np.int64]  # (N,) key of the mission that the agent flies, or NO_MISSION
    packets: Packets
    """The newest counters; empty before the first come."""
    hierarchy: HierarchyRows | None
    """None where ticks are not recorded."""
    filtered_mps: Float32s | None
    """(N,), by how much each agent's safety filter changes its velocity, or would [m/s]. Not
    judged; None where ticks are not recorded."""
    signals: Mapping[str, Floats]
    """The controllers' own numbers by name, each (N,); NaN for an agent that does not state it."""

    def __init__(  # noqa: PLR0913, PLR0917
        self,
        index: int,
        time_s: float,
        position: Floats,
        attitude: Float32s,
        target: Float32s,
        place: NDArray[np.int16],
        force: Float32s,
        turn_deg: Floats,
        alive: NDArray[np.bool_],
        links: NDArray[np.int32],
        mission: NDArray[np.int64],
        packets: Packets | None = None,
        hierarchy: HierarchyRows | None = None,
        filtered_mps: Float32s | None = None,
        signals: Mapping[str, Floats] = NO_SIGNALS,
    ) -> None:
        self.index = index
        self.time_s = time_s
        self.position = position
        self.attitude = attitude
        self.target = target
        self.place = place
        self.force = force
        self.turn_deg = turn_deg
        self.alive = alive
        self.links = links
        self.mission = mission
        self.packets = packets if packets is not None else {}
        self.hierarchy = hierarchy
        self.filtered_mps = filtered_mps
        self.signals = signals

    def __reduce__(self) -> tuple[Any, ...]:
        return Tick, _values(self)


def _values(rows: HierarchyRows | Tick) -> tuple[Any, ...]:
    """Return the values of all fields: what to pickle, as the compiled classes have no slots."""
    return tuple(getattr(rows, each.name) for each in fields(rows))


def same_claims(one: Tick, other: Tick) -> bool:
    """Return whether the same agents run in two ticks, and claim the same places and missions.

    Ticks of a run share these rows for as long as none changes.
    """
    return (
        _same(one.alive, other.alive)
        and _same(one.place, other.place)
        and _same(one.mission, other.mission)
    )


def _same(one: NDArray[Any], other: NDArray[Any]) -> bool:
    return one is other or one.tobytes() == other.tobytes()
