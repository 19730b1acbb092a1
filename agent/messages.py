"""What an agent hears, sees, says and commands.

Everything is in SI units and in the world frame (x, y horizontal, z up) unless a field says
otherwise. Angles are radians, yaw counted from +x towards +y. Numbers are checked when a message
is decoded: finite, and within the bounds given here.
"""

from typing import Annotated, NamedTuple

import msgspec
from msgspec import Meta

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)

MAX_M, MAX_SPEED_MPS, MAX_ANGLE_RAD, MAX_FORCE = 1e6, 100.0, 100.0, 1e9
MAX_COST_MM = 2**31 - 1
MAX_HEARD = 256
"""Most neighbours in one telemetry, and most vehicles in one observation."""
AGENT_IDS = 2**16
"""Number of agent ids: 0 to AGENT_IDS - 1."""

Metres = Annotated[float, Meta(ge=-MAX_M, le=MAX_M)]
Speed = Annotated[float, Meta(ge=-MAX_SPEED_MPS, le=MAX_SPEED_MPS)]
Seconds = Annotated[float, Meta(ge=0, le=1e9)]
Radians = Annotated[float, Meta(ge=-MAX_ANGLE_RAD, le=MAX_ANGLE_RAD)]
Count = Annotated[int, Meta(ge=0, lt=2**53)]
AgentId = Annotated[int, Meta(ge=0, lt=AGENT_IDS)]
ParentId = Annotated[int, Meta(ge=-1, lt=AGENT_IDS)]
Index = Annotated[int, Meta(ge=-1, lt=2**15)]

Position = tuple[Metres, Metres, Metres]
Cost = Annotated[int, Meta(ge=0, le=MAX_COST_MM)]
MAX_PLACES = 8
Places = Annotated[tuple[tuple[Index, Index], ...], Meta(max_length=MAX_PLACES)]
Velocity = tuple[Speed, Speed, Speed]


ROLES = ("member", "sub-vertex", "vertex", "distress")
"""An agent's role in its queue; a sub-vertex is a member whom another follows."""


CAUSES = (
    *("oversize", "corrupt", "garbage", "invalid", "spoofed", "replay", "future", "old", "offset"),
    *("mission", "observation", "batch", "speed"),
)
"""Why a message is refused; RejectedError has the causes of those heard by radio."""
CauseIndex = Annotated[int, Meta(ge=0, lt=len(CAUSES))]
Rejections = Annotated[tuple[tuple[CauseIndex, Count], ...], Meta(max_length=len(CAUSES))]


class Place(NamedTuple):
    """A place in a formation: the rank-th slot of a queue, rank 0 at the queue's first vertex.

    A vertex that queues share is one place: that of the first of these queues.
    """

    queue: int
    rank: int


class Message(msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """A message: immutable, encoded as an array, refused when it has a field too many."""


class Pose(NamedTuple):
    """Where the target's frame stands [m; world frame], and its yaw [rad]."""

    x: Metres
    y: Metres
    z: Metres
    yaw: Radians


HOME = Pose(x=0.0, y=0.0, z=0.0, yaw=0.0)


class Drift(NamedTuple):
    """How a frame moves that was at its pose at ``stamp_s`` [s]: [m/s; world frame], [rad/s]."""

    stamp_s: Seconds
    x: Speed
    y: Speed
    z: Speed
    yaw_rate: Annotated[float, Meta(ge=-100, le=100)]


class FramePath(Message, frozen=True):
    """Where the target's frame goes: from waypoint to waypoint [m; world frame].

    One waypoint: it stands there. speed [m/s]; start_s: when it leaves the first one, in the
    Observation's time. turn_rate: how fast its yaw turns into the direction of the next leg
    [rad/s]; 0: it does not. yaw [rad] is added to that direction, or is all there is. waits_s: how
    long it waits at each waypoint [s].
    """

    waypoints: Annotated[tuple[Position, ...], Meta(min_length=1, max_length=16)]
    speed: Annotated[float, Meta(gt=0, le=100)] = 0.25
    start_s: Seconds = 0.0
    yaw: Radians = 0.0
    turn_rate: Annotated[float, Meta(ge=0, le=100)] = 0.0
    waits_s: Annotated[tuple[Seconds, ...], Meta(max_length=16)] = ()


AT_HOME = FramePath(waypoints=(ZERO,))


MAX_ORDER_B = 3000
"""Longest formation in an operator's order, as msgpack [B]."""
PIECE_B = 900
"""Longest part of a mission in one frame [B]; the last part may be shorter."""
MAX_PIECES = 16


class Mission(Message, frozen=True):
    """What the team shall form, and where; the highest ``key`` wins everywhere.

    key: 0 in an order means: whatever comes next. formation: a FormationSpec as msgpack; empty
    where the formation stays as it is and only the frame moves.
    """

    key: Count
    frame: FramePath
    formation: Annotated[bytes, Meta(max_length=MAX_ORDER_B)]


NO_ECHO_MM = 0xFFFF
"""The range of a ray that meets nothing within the sensor's range."""
MAX_OBSTACLE_POINTS = 32
"""Most nearest points of obstacles in one observation."""
PROXIMITY_RANGE_M = 2.0
"""Reach of the proximity sensor [m]."""


class Scan(Message, frozen=True):
    """What a scanning sensor met: for each ray or beam, in the order of its pattern, how far.

    kind: index of agent.sensing.ray_pattern.KINDS. ranges: unsigned 16-bit little-endian [mm];
    65535: nothing, within its range.
    """

    kind: Annotated[int, Meta(ge=0, lt=8)]
    ranges: Annotated[bytes, Meta(max_length=60_000)]


class Observation(Message, frozen=True):
    """What one vehicle senses at the start of one of its slots; never the truth about others.

    position [m], velocity [m/s], yaw [rad] are the vehicle's own.
    vehicles: other vehicles within the proximity sensor's 2 m, as positions relative to this
    vehicle's centre [m; axes of the world frame]. A body has no name.
    obstacles: of each obstacle within the sensor's 2 m the nearest point of its surface, relative
    likewise; of more than 32, the nearest.
    scans: of sensors that scan, those made at this time.
    orders: missions that an operator gives to this agent, for the whole team.
    """

    slot: Count
    time_s: Seconds
    position: Position
    velocity: Velocity
    yaw: Radians
    vehicles: Annotated[tuple[Position, ...], Meta(max_length=MAX_HEARD)]
    obstacles: Annotated[tuple[Position, ...], Meta(max_length=MAX_OBSTACLE_POINTS)]
    orders: Annotated[tuple[Mission, ...], Meta(max_length=4)]
    scans: Annotated[tuple[Scan, ...], Meta(max_length=2)]


class Telemetry(Message, frozen=True):
    """What an agent tells about its own reasons, for the recording and the judge.

    wanted: velocity before the safety filter [m/s]; force: |u_i| of (28) before saturation;
    target: its target-on-queue [m]; place: where in the formation it means to be; heard: ids
    heard directly of late; rejected: messages refused so far, (index of CAUSES, how many) each;
    mission: the key of the one it flies; tier, parent: its standing in its queue (see Beacon), -1
    for none; role: index of ROLES;
    record_age_s: the age of the oldest record it keeps of a member, when it last looked.
    """

    wanted: Velocity
    force: Annotated[float, Meta(ge=0, le=MAX_FORCE)]
    target: Position | None
    place: tuple[Index, Index] | None
    heard: Annotated[tuple[AgentId, ...], Meta(max_length=MAX_HEARD)]
    rejected: Rejections
    mission: Count
    tier: Index
    parent: ParentId
    role: Annotated[int, Meta(ge=0, lt=len(ROLES))]
    record_age_s: Seconds = 0.0


class Command(Message, frozen=True):
    """What a vehicle shall do from now until ``expires_slot``; then it stops and hovers.

    tilt: pitch and roll to take up [rad], nose up and right side down positive; vehicles that
    cannot, stay level.
    """

    slot: Count
    incarnation: Count
    expires_slot: Count
    velocity: Velocity
    yaw: Radians
    tilt: tuple[Radians, Radians]
    telemetry: Telemetry


class Beacon(Message, frozen=True):
    """The local channel's broadcast (E22): heard directly, never forwarded.

    stamp_s: the sender's Observation time. target: where it is heading right now, q_tg of the
    paper, which the potential of (22) needs. queue, rank: the place it claims, -1 for none;
    cost_mm: how far from there it was when it first claimed it, by which a contest is decided.
    speed_cap: it promises to stay below this speed for the next 3 s [m/s].
    echoes: for each neighbour the last sequence heard of it.
    mission: the key of the one it flies; frame: where the target's frame is, by the mission of
    ``frame_key``, which may be a newer one that is still on its way; drift: how it moves, None
    where it stands for good. tier: 0 for a
    queue-vertex agent, else its parent's + 1, -1 in distress. parent: whom it follows, -1 for none;
    root: the vertex agent's sequence as it came down the tiers (E15).
    """

    id: AgentId
    incarnation: Count
    sequence: Count
    stamp_s: Seconds
    position: Position
    velocity: Velocity
    target: Position
    queue: Index
    rank: Index
    cost_mm: Cost
    speed_cap: Annotated[float, Meta(ge=0, le=100)]
    echoes: Annotated[tuple[tuple[AgentId, Count], ...], Meta(max_length=128)]
    mission: Count
    frame_key: Count
    frame: Pose
    drift: Drift | None
    tier: Index
    parent: ParentId
    root: Count
    blocked: Places


class Record(Message, frozen=True):
    """What one agent last said of itself, passed on over the multihop channel (E24).

    Only its subject writes it; ``version`` grows with each writing. stamp_s is the subject's
    Observation time at the writing. queue, rank, cost_mm: the place it claims, as in Beacon;
    mission: the mission in which that is a place. blocked: places that it sees taken by a silent
    body (E18).
    """

    id: AgentId
    incarnation: Count
    version: Count
    stamp_s: Seconds
    position: Position
    queue: Index
    rank: Index
    cost_mm: Cost
    mission: Count
    blocked: Places


class Piece(Message, frozen=True):
    """A part of a mission under way, path and formation: the ``index``-th of ``count``."""

    key: Count
    index: Annotated[int, Meta(ge=0, lt=MAX_PIECES)]
    count: Annotated[int, Meta(ge=1, le=MAX_PIECES)]
    data: Annotated[bytes, Meta(max_length=1000)]


class Gossip(Message, frozen=True):
    """One frame of the multihop channel: some records, its sender's own among them or not."""

    id: AgentId
    stamp_s: Seconds
    records: Annotated[tuple[Record, ...], Meta(max_length=64)]
    piece: Piece | None
