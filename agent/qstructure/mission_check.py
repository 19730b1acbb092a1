"""The one check of a mission: a formation, and the path of its frame.

The scenario's file, an operator's request and the radio all pass through it. What it lets through
flies in every team: a slot lies within REACH_M of the frame's origin and the frame within FRAME_M
of the world's, so no slot leaves the world, whichever formation meets whichever frame.
"""

from math import dist, hypot

from agent.messages import (
    MAX_SPEED_MPS,
    MAX_VERTICES,
    REACH_M,
    AllocationKind,
    Drift,
    FramePath,
    Vector,
)
from agent.qstructure.formation import Formation
from agent.qstructure.target_frame import Frame

LEAST_LEG_M = 1e-3
LEAST_TURN_RPS = 1e-4
"""Least turn rate of a frame that turns [rad/s]; it makes a whole turn in a day."""


class MissionError(ValueError):
    """A mission that cannot be flown; ``key`` is the offending key of a mission."""

    def __init__(self, key: str, detail: str) -> None:
        super().__init__(f"{key}: {detail}")
        self.key = key
        self.detail = detail


def check_mission(
    formation: Formation, path: FramePath, agents: int, allocation: AllocationKind
) -> None:
    """Raise MissionError for a mission that a team of up to ``agents`` cannot fly."""
    _check_reach(formation, agents)
    if allocation == "structure" and len(formation.vertices) > MAX_VERTICES:
        raise MissionError(
            "formation.vertices",
            f"{len(formation.vertices)} vertices; a beacon has room for the trees of at most"
            f' {MAX_VERTICES}, or set control.allocation = "assignment"',
        )
    _check_path(path)
    turning_mps = path.turn_rate * formation.reach_m(agents)
    if turning_mps > MAX_SPEED_MPS:
        raise MissionError("frame.turn_dps", _too_fast(turning_mps))


def check_drift(formation: Formation, drift: Drift, agents: int) -> None:
    """Raise MissionError for a frame that moves slots faster than any vehicle flies."""
    turning_mps = abs(drift.yaw_rate) * formation.reach_m(agents)
    if turning_mps > MAX_SPEED_MPS:
        raise MissionError("frame", _too_fast(turning_mps))


def can_hold(frame: Frame, point: Vector) -> bool:
    """Whether a mission could have a slot at a point [m; frame] of a frame that moves so."""
    reach_m = hypot(*point)
    return reach_m <= REACH_M and abs(frame.yaw_rate) * reach_m <= MAX_SPEED_MPS


def _check_reach(formation: Formation, agents: int) -> None:
    reach_m = formation.reach_m(agents)
    if reach_m > REACH_M:
        raise MissionError(
            "formation",
            f"with up to {agents} agents its slots reach {reach_m:.6g} m from the frame's origin;"
            f" at most {REACH_M:g} m",
        )


def _check_path(path: FramePath) -> None:
    for index, (here, there) in enumerate(zip(path.waypoints, path.waypoints[1:], strict=False)):
        if dist(here, there) < LEAST_LEG_M:
            detail = "the same point as before; use pauses_s to wait there"
            raise MissionError(f"frame.waypoints_m[{index + 1}]", detail)
    if 0.0 < path.turn_rate < LEAST_TURN_RPS:
        raise MissionError("frame.turn_dps", "too slow to end within a day")


def _too_fast(turning_mps: float) -> str:
    return f"it moves slots at {turning_mps:.3g} m/s; at most {MAX_SPEED_MPS:g} m/s"
