"""The target's frame in a scenario: its path as tables, and as the message that agents get."""

from math import radians
from typing import Annotated, Literal, assert_never

import msgspec
from msgspec import Meta

from agent.config import FrameSpeed, Table
from agent.messages import FramePath, FramePosition
from worldsim.scenario.problem import Problem
from worldsim.scenario.start import Degrees

TurnRate = Annotated[float, Meta(ge=0.01, le=5000)]
Time = Annotated[float, Meta(ge=0, le=86_400)]
Waypoints = Annotated[tuple[FramePosition, ...], Meta(min_length=1, max_length=16)]
Pauses = Annotated[tuple[Time, ...], Meta(max_length=16)]


class FrameTable(Table, frozen=True):
    """The target's frame, in which the vertices stand. Without this table it rests at the origin.

    waypoints_m: one point, where the frame rests, or the points along which it flies at
    ``speed_mps`` from ``start_s`` on [world frame]. pauses_s: how long it waits at each waypoint.
    yaw: "fixed" at ``yaw_deg``, or along the "path" plus yaw_deg. With "path" it turns on the spot
    at each waypoint, at ``turn_dps``.
    """

    waypoints_m: Waypoints = ((0.0, 0.0, 0.0),)
    speed_mps: FrameSpeed | None = None
    start_s: Time = 0.0
    pauses_s: Pauses = ()
    yaw: Literal["fixed", "path"] = "fixed"
    yaw_deg: Degrees = 0.0
    turn_dps: TurnRate = 10.0


REST = FrameTable()


class FrameChange(Table, frozen=True):
    """The keys of [frame] that a mission changes; all others keep their values.

    With waypoints_m a new path begins: at the event's time, or at a later ``start_s``.
    """

    waypoints_m: Waypoints | None = None
    speed_mps: FrameSpeed | None = None
    start_s: Time | None = None
    pauses_s: Pauses | None = None
    yaw: Literal["fixed", "path"] | None = None
    yaw_deg: Degrees | None = None
    turn_dps: TurnRate | None = None

    @property
    def given(self) -> dict[str, object]:
        """The keys that are given, with their values."""
        keys = msgspec.structs.asdict(self)
        return {key: value for key, value in keys.items() if value is not None}


def changed_frame(frame: FrameTable, change: FrameChange, at_s: float) -> FrameTable:
    """Return a frame's table after the change of an event at ``at_s`` [s]."""
    new_path: dict[str, object] = {}
    if change.waypoints_m is not None:
        new_path = {"speed_mps": None, "start_s": at_s, "pauses_s": ()}
    if change.waypoints_m is not None and len(change.waypoints_m) == 1:
        new_path |= {"start_s": REST.start_s, "yaw": REST.yaw}
    return msgspec.structs.replace(frame, **{**new_path, **change.given})


def path_of(frame: FrameTable) -> FramePath:
    """Return the path of a frame's table as agents get it."""
    return FramePath(
        waypoints=frame.waypoints_m,
        speed=frame.speed_mps or 1.0,
        start_s=frame.start_s,
        yaw=radians(frame.yaw_deg),
        turn_rate=_turn_rate(frame),
        waits_s=frame.pauses_s,
    )


def frame_problem(frame: FrameTable) -> Problem | None:
    """Return the first key of a frame's table that contradicts the others; None if none does."""
    points = len(frame.waypoints_m)
    if points == 1:
        return _rest_problem(frame)
    if frame.speed_mps is None:
        detail = f"is missing; the frame's speed along its {points} waypoints"
        return Problem("speed_mps", detail)
    if frame.pauses_s and len(frame.pauses_s) != points:
        return Problem("pauses_s", f"{len(frame.pauses_s)} for {points} waypoints; one for each")
    return None


def _rest_problem(frame: FrameTable) -> Problem | None:
    """Return the first key that has no meaning with one waypoint."""
    for key in ("speed_mps", "start_s", "pauses_s", "yaw"):
        if getattr(frame, key) != getattr(REST, key):
            detail = "needs two waypoints or more; with one waypoint the frame rests"
            return Problem(key, detail)
    return None


def _turn_rate(frame: FrameTable) -> float:
    """Return how fast the yaw turns at waypoints [rad/s]; 0 where it stays fixed."""
    match frame.yaw:
        case "path":
            return radians(frame.turn_dps)
        case "fixed":
            return 0.0
        case _:
            assert_never(frame.yaw)
