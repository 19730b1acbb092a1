"""The target's frame in a scenario: where it goes, as tables, and as the path that agents get."""

from math import dist, radians
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from agent.config import Positive, Table
from agent.messages import FramePath
from worldsim.scenario.start import Degrees, Triple

LEAST_LEG_M = 1e-3
Time = Annotated[float, Meta(ge=0, le=86_400)]
Waypoints = Annotated[tuple[Triple, ...], Meta(min_length=1, max_length=16)]
Pauses = Annotated[tuple[Time, ...], Meta(max_length=16)]


class FrameTable(Table, frozen=True):
    """The target's frame, in which the vertices stand; left out, it rests at the origin.

    waypoints_m: one point, where its origin stands, or the points that it flies along at
    ``speed_mps`` from ``start_s`` on; pauses_s: how long it waits at each. yaw: "fixed" at
    ``yaw_deg``, or along the "path", to which yaw_deg is added; it turns on the spot at waypoints.
    """

    waypoints_m: Waypoints = ((0.0, 0.0, 0.0),)
    speed_mps: Positive | None = None
    start_s: Time = 0.0
    pauses_s: Pauses = ()
    yaw: Literal["fixed", "path"] = "fixed"
    yaw_deg: Degrees = 0.0
    turn_dps: Positive = 10.0


class FrameChange(Table, frozen=True):
    """What a mission changes of the frame; what is left out stays as it was.

    With waypoints_m the path begins anew, at the event's time unless ``start_s`` says a later one.
    """

    waypoints_m: Waypoints | None = None
    speed_mps: Positive | None = None
    start_s: Time | None = None
    pauses_s: Pauses | None = None
    yaw: Literal["fixed", "path"] | None = None
    yaw_deg: Degrees | None = None
    turn_dps: Positive | None = None

    @property
    def given(self) -> dict[str, object]:
        """The keys that are given, with their values."""
        told = msgspec.structs.asdict(self)
        return {key: value for key, value in told.items() if value is not None}


def changed(frame: FrameTable, change: FrameChange, at_s: float) -> FrameTable:
    """Return a frame's table as an event at ``at_s`` [s] changes it."""
    begun: dict[str, object] = {}
    if change.waypoints_m is not None:
        begun = {"speed_mps": None, "start_s": at_s, "pauses_s": ()}
    if change.waypoints_m is not None and len(change.waypoints_m) == 1:
        begun |= {"start_s": 0.0, "yaw": "fixed"}
    return msgspec.structs.replace(frame, **{**begun, **change.given})


def path_of(frame: FrameTable) -> FramePath:
    """Return the path that a frame's table means."""
    return FramePath(
        frame.waypoints_m,
        frame.speed_mps or 1.0,
        frame.start_s,
        radians(frame.yaw_deg),
        radians(frame.turn_dps) if frame.yaw == "path" else 0.0,
        frame.pauses_s,
    )


def broken_key(frame: FrameTable) -> tuple[str, str] | None:
    """Return the key of a frame's table that does not go with the others, and why; else None."""
    points = len(frame.waypoints_m)
    if points == 1:
        return _at_rest(frame)
    if frame.speed_mps is None:
        return "speed_mps", f"is missing; how fast the frame flies along its {points} waypoints"
    if frame.pauses_s and len(frame.pauses_s) != points:
        return "pauses_s", f"{len(frame.pauses_s)} for {points} waypoints; one for each"
    for index in range(1, points):
        if dist(frame.waypoints_m[index - 1], frame.waypoints_m[index]) < LEAST_LEG_M:
            return (
                f"waypoints_m[{index}]",
                "the point before once more; pauses_s makes it wait",
            )
    return None


def _at_rest(frame: FrameTable) -> tuple[str, str] | None:
    """Say what one waypoint has no use for."""
    rest = FrameTable()
    for key in ("speed_mps", "start_s", "pauses_s", "yaw"):
        if getattr(frame, key) != getattr(rest, key):
            return key, "needs a path of two waypoints or more; at one waypoint the frame stands"
    return None
