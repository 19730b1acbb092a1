"""Messages of an agent: observations, radio frames, commands and telemetry.

Unless a field says otherwise, numbers are in SI units and in the world frame (x, y horizontal, z
up). Yaw is counted from +x towards +y. Decoding checks every number: it is finite and within the
bounds given here.
"""

from typing import Annotated, Final, Literal, NamedTuple

import msgspec
from msgspec import Meta

from netem.wire.channels import MAX_PAYLOAD_B

AllocationKind = Literal["structure", "assignment"]
"""Who takes which place; see agent.config.Control."""

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)

MAX_M: Final = 1e6
MAX_SPEED_MPS: Final = 100.0
MAX_ANGLE_RAD: Final = 100.0
MAX_FORCE: Final = 1e9
FRAME_M: Final = 930e3
"""The frame's origin lies within this distance of the world's, along each axis [m]."""
REACH_M: Final = 50e3
"""A slot lies within this distance of the frame's origin [m]."""
FLIGHT_M: Final = 985e3
"""The world's edge, along each axis [m]: vehicles start within it and cannot fly past it. It leaves
room up to MAX_M for targets ahead of a vehicle."""
LEAST_SPEED_MPS: Final = 1e-3
MAX_COMMAND_MPS: Final = 174.0
"""The longest velocity whose components are within MAX_SPEED_MPS [m/s]."""
MAX_COST_MM: Final = 2**31 - 1
MAX_HEARD: Final = 256
"""Most neighbours in one telemetry, and most vehicles in one observation."""
AGENT_IDS: Final = 2**16
"""Number of agent ids: 0 to AGENT_IDS - 1."""

MAX_TEAM: Final = 1024
"""Most agents of a team."""

Metres = Annotated[float, Meta(ge=-MAX_M, le=MAX_M)]
FrameMetres = Annotated[float, Meta(ge=-FRAME_M, le=FRAME_M)]
FlightMetres = Annotated[float, Meta(ge=-FLIGHT_M, le=FLIGHT_M)]
Speed = Annotated[float, Meta(ge=-MAX_SPEED_MPS, le=MAX_SPEED_MPS)]
Seconds = Annotated[float, Meta(ge=0, le=1e9)]
Radians = Annotated[float, Meta(ge=-MAX_ANGLE_RAD, le=MAX_ANGLE_RAD)]
Count = Annotated[int, Meta(ge=0, lt=2**53)]
AgentId = Annotated[int, Meta(ge=0, lt=AGENT_IDS)]
ParentId = Annotated[int, Meta(ge=-1, lt=AGENT_IDS)]
"""An agent id, or -1 for no parent."""
NO_MISSION: Final = -1
MissionKey = Annotated[int, Meta(ge=NO_MISSION, lt=2**53)]
"""Key of the mission that an agent flies: 0 for the one it was briefed with at the start, more for
later ones, NO_MISSION for none. Keys are ordered, so a team's first mission is newer than none."""
Index = Annotated[int, Meta(ge=-1, lt=2**15)]
"""A queue, a rank or a tier; -1 for none."""

Position = tuple[Metres, Metres, Metres]
FramePosition = tuple[FrameMetres, FrameMetres, FrameMetres]
"""Of the frame's origin."""
FlightPosition = tuple[FlightMetres, FlightMetres, FlightMetres]
"""Where a vehicle may be."""
Velocity = tuple[Speed, Speed, Speed]
Cost = Annotated[int, Meta(ge=0, le=MAX_COST_MM)]
MAX_VERTICES: Final = 16
"""Most vertices of a formation whose places leaders allocate."""
MAX_LABELS_B: Final = 512
"""Longest run of labels in one frame [B]."""
Label = Annotated[int, Meta(ge=0, lt=2**16)]
"""Age and queue of a member; see agent.structure.census."""
MAX_PLACES: Final = 12
"""Most occupied places in one report: with more, a whole table would not fit a transmission."""
Places = Annotated[tuple[tuple[Index, Index], ...], Meta(max_length=MAX_PLACES)]
"""Some places, each (queue, rank)."""

Role = Literal["member", "sub-vertex", "vertex", "distress"]
ROLES: tuple[Role, ...] = ("member", "sub-vertex", "vertex", "distress")
MEMBER: Final = 0
SUB_VERTEX: Final = 1
VERTEX: Final = 2
DISTRESS: Final = 3
"""Roles of an agent in its queue. A sub-vertex is a member that another agent follows."""

CAUSES = (
    *("oversize", "corrupt", "garbage", "invalid", "spoofed", "replay", "future", "old", "offset"),
    *("mission", "observation", "batch", "speed", "overflow"),
)
"""Causes for which an agent rejects a message; see RejectedError."""
CauseIndex = Annotated[int, Meta(ge=0, lt=len(CAUSES))]
Rejections = Annotated[tuple[tuple[CauseIndex, Count], ...], Meta(max_length=len(CAUSES))]


class Place(NamedTuple):
    """A place in a formation: rank 0 is the queue's first vertex.

    A vertex shared by several queues is one place, named after the first of these queues.
    """

    queue: int
    rank: int


class Message(msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """Base of all messages: immutable, encoded as an array, rejected with a field too many."""


class Pose(NamedTuple):
    """Pose of the target's frame in the world frame."""

    x: FrameMetres  # [m]
    y: FrameMetres  # [m]
    z: FrameMetres  # [m]
    yaw: Radians  # [rad]


HOME = Pose(x=0.0, y=0.0, z=0.0, yaw=0.0)


class Drift(NamedTuple):
    """Velocity of a frame, and the time at which it had the pose that goes with it."""

    stamp_s: Seconds  # Observation time [s]
    x: Speed  # [m/s; world frame]
    y: Speed  # [m/s; world frame]
    z: Speed  # [m/s; world frame]
    yaw_rate: Annotated[float, Meta(ge=-100, le=100)]  # [rad/s]


class FramePath(Message, frozen=True):
    """Path of the target's frame from waypoint to waypoint; with one waypoint it rests there.

    With a turn_rate above 0 the yaw turns into the direction of each next leg, and ``yaw`` is added
    to that direction. Otherwise ``yaw`` is the whole yaw.
    """

    waypoints: Annotated[tuple[FramePosition, ...], Meta(min_length=1, max_length=16)]
    """[m; world]"""
    speed: Annotated[float, Meta(ge=LEAST_SPEED_MPS, le=100)] = 0.25  # along the legs [m/s]
    start_s: Seconds = 0.0  # departure from the first waypoint, in Observation time [s]
    yaw: Radians = 0.0  # [rad]
    turn_rate: Annotated[float, Meta(ge=0, le=100)] = 0.0  # [rad/s]
    waits_s: Annotated[tuple[Seconds, ...], Meta(max_length=16)] = ()  # at each waypoint [s]


AT_HOME = FramePath(waypoints=(ZERO,))
"""The frame rests at the world's origin."""

MAX_ORDER_B: Final = 3000
"""Longest formation in an operator's order, as msgpack [B]."""
PIECE_B: Final = 900
"""Longest part of a mission in one frame [B]; the last part may be shorter."""
MAX_PIECES: Final = 16


class Mission(Message, frozen=True):
    """The formation that the team forms, and the path of its frame; the highest ``key`` wins."""

    key: Count  # 0 in an order: the agent chooses the next key
    frame: FramePath
    formation: Annotated[bytes, Meta(max_length=MAX_ORDER_B)]
    """A FormationSpec as msgpack; empty where the formation stays and only the frame moves."""


NO_ECHO_MM = 0xFFFF
"""The range of a ray that meets nothing within the sensor's range."""
MAX_OBSTACLE_POINTS: Final = 32
"""Most nearest points of obstacles in one observation."""
PROXIMITY_RANGE_M: Final = 2.0
"""Reach of the proximity sensor [m]."""


MAX_SCAN_B: Final = 60_000
"""Most bytes of one scan, two for each ray."""


class Scan(Message, frozen=True):
    """One scan of a scanning sensor: the range of each ray or beam, in the order of its pattern."""

    kind: Annotated[int, Meta(ge=0, lt=8)]  # index of agent.config.SCANNERS
    ranges: Annotated[bytes, Meta(max_length=MAX_SCAN_B)]
    """Unsigned 16-bit little-endian [mm]; NO_ECHO_MM: nothing within the sensor's range."""


class Observation(Message, frozen=True):
    """What one vehicle senses at the start of one of its slots.

    It never holds the truth about others: a sensed vehicle has no id.
    """

    slot: Count
    time_s: Seconds  # simulated time, the same for all vehicles [s]
    position: Position  # own centre [m; world frame]
    velocity: Velocity  # own [m/s; world frame]
    yaw: Radians  # own [rad; world frame]
    vehicles: Annotated[tuple[Position, ...], Meta(max_length=MAX_HEARD)]
    """Other vehicles within PROXIMITY_RANGE_M, relative to the own centre [m; world axes]."""
    obstacles: Annotated[tuple[Position, ...], Meta(max_length=MAX_OBSTACLE_POINTS)]
    """The nearest surface point of each obstacle within PROXIMITY_RANGE_M, relative to the own
    centre [m; world axes]; of more than MAX_OBSTACLE_POINTS, the nearest."""
    orders: Annotated[tuple[Mission, ...], Meta(max_length=4)]
    """Missions that an operator gives to this agent, for the whole team."""
    scans: Annotated[tuple[Scan, ...], Meta(max_length=2)]  # scans made at this time
    late_slots: Count = 0
    """By how many slots the agent answers late, by a fault."""
    takes_s: Annotated[float, Meta(ge=0, le=1000)] = 0.0
    """How long its process takes for that [s; wall time]; 0 where time waits for it."""


Believed = tuple[tuple[AgentId, Position], ...]
"""Neighbours and where an agent takes them to be [m; world frame]."""


MAX_SIGNALS: Final = 16
"""Most signals of one controller."""
MAX_SIGNAL: Final = 1e12
"""Largest absolute value of a signal."""
SIGNAL_NAME: Final = "^[a-z][a-z0-9_]{0,31}$"
SignalName = Annotated[
    str,
    Meta(
        pattern=SIGNAL_NAME,
        description="a name of lower-case letters, digits and '_', at most 32, a letter first",
    ),
]
Signal = Annotated[float, Meta(ge=-MAX_SIGNAL, le=MAX_SIGNAL)]
MAX_LOG_LINES: Final = 4
"""Most log lines in one telemetry."""
MAX_LOG_CHARACTERS: Final = 200
LogLine = Annotated[str, Meta(max_length=MAX_LOG_CHARACTERS)]


class Report(Message, frozen=True):
    """What an agent's controller tells of itself, and of the datagrams of one tick."""

    signals: Annotated[tuple[tuple[SignalName, Signal], ...], Meta(max_length=MAX_SIGNALS)]
    """Its own series, by name."""
    log: Annotated[tuple[LogLine, ...], Meta(max_length=MAX_LOG_LINES)]
    sent: tuple[Count, Count]  # datagrams of its own, and their bytes
    received: tuple[Count, Count]  # the same, of others
    oldest_s: Seconds  # age of the oldest one received [s]; 0 for none


class Telemetry(Message, frozen=True):
    """An agent's internal state, for the recording and the judge."""

    wanted: Velocity  # velocity before the safety filter [m/s; world frame]
    force: Annotated[float, Meta(ge=0, le=MAX_FORCE)]  # |u_i| of (28) before saturation [m/s]
    target: Position | None  # target-on-queue [m; world frame]
    place: tuple[Index, Index] | None  # (queue, rank) that it claims
    heard: Annotated[tuple[AgentId, ...], Meta(max_length=MAX_HEARD)]  # ids heard directly
    rejected: Rejections  # (index of CAUSES, number of messages) since the start
    mission: MissionKey  # of the mission that it flies
    tier: Index  # see Beacon
    parent: ParentId  # see Beacon
    role: Annotated[int, Meta(ge=0, lt=len(ROLES))]  # index of ROLES
    record_age_s: Seconds = 0.0  # age of the oldest team record at the last housekeeping [s]
    believed: Annotated[Believed, Meta(max_length=MAX_HEARD)] = ()  # told now and then
    filter_mps: Annotated[float, Meta(ge=0, le=2 * MAX_COMMAND_MPS)] = 0.0
    """By how much the safety filter changes the velocity, or would change it [m/s]."""
    report: Report | None = None  # of a controller that has something to tell


class Command(Message, frozen=True):
    """What a vehicle flies from now until ``expires_slot``; then it stops and hovers."""

    slot: Count  # slot of the observation that it answers
    incarnation: Count
    expires_slot: Count
    velocity: Velocity  # [m/s; world frame]
    yaw: Radians  # heading to turn to [rad; world frame]
    tilt: tuple[Radians, Radians]
    """Pitch and roll [rad], nose up and right side down positive; ignored by level vehicles."""
    telemetry: Telemetry


class RootKey(NamedTuple):
    """Who leads a vertex: of two roots the lower key wins."""

    cost_cm: Cost  # distance to the vertex at the election [cm]
    id: AgentId


class Branch(Message, frozen=True):
    """An agent's position in the tree of one vertex (E15)."""

    root: RootKey
    version: Count  # the root's time as it came down the tiers [10 ms]
    tier: Index  # 0: the root; else the parent's tier + 1; -1: in distress
    parent: ParentId  # the agent that it follows, -1 for none


class Swap(NamedTuple):
    """A swap of places with another agent, proposed or agreed to."""

    partner: AgentId
    place: tuple[Index, Index]  # own, at the proposal
    other: tuple[Index, Index]  # the partner's


class Standing(Message, frozen=True):
    """An agent's standing in the Q-structure: what is urgent of it, for the local channel."""

    branches: Annotated[tuple[Branch | None, ...], Meta(max_length=MAX_VERTICES)]
    """In the tree of each vertex; None where no root is known."""
    leads: Index  # the vertex that it leads, -1 for none
    queue: Index  # the queue that it belongs to, -1 for none
    heard: Annotated[int, Meta(ge=0, lt=AGENT_IDS)]  # members that it hears, itself included
    pushes: bool  # its claim comes before others', up the queue to the tail
    proposal: Swap | None
    reservation: Swap | None  # it took the partner's place and keeps its own for the partner
    code: Annotated[int, Meta(ge=1, lt=256)]  # of its label, see agent.structure.label_code


class Order(NamedTuple):
    """A leader's order to one agent: leave one queue for another."""

    agent: AgentId
    queue: Index  # from here
    to: Index


class Candidate(NamedTuple):
    """An agent that could leave its queue for another."""

    extra_dm: Annotated[int, Meta(ge=-(2**31), lt=2**31)]  # its way, less its present way [0.1 m]
    agent: AgentId
    to: Index


MAX_CANDIDATES: Final = 16
"""Most candidates of a queue in one report."""
MAX_ORDERS: Final = 16
"""Most orders of a leader at one time."""
Orders = Annotated[tuple[Order, ...], Meta(max_length=MAX_ORDERS)]
Histogram = Annotated[bytes, Meta(min_length=0, max_length=16)]
"""Agents by distance from the vertex, one byte a bin; see agent.structure.histogram."""
Members = Annotated[int, Meta(ge=0, le=MAX_TEAM)]
Counts = Annotated[tuple[Members, ...], Meta(max_length=64)]


class LeaderSummary(Message, frozen=True):
    """What the leader of a vertex says of the queues that begin there; it comes down the tiers."""

    root: RootKey
    version: Count  # the leader's time at the writing [10 ms]
    total: Members  # of the team
    counts: Counts  # members of each queue, those in vertices apart
    highest: Counts  # number of the last claimed place of each queue
    histogram: Histogram
    go: bool  # whether the counts were steady once: agents may take ranks
    order: Count  # number of the orders
    orders: Orders
    blocked: Places  # places taken by unidentified vehicles, as its tree reports them (E18)


class Subtree(Message, frozen=True):
    """What an agent reports up the tiers: of itself and of those that follow it."""

    highest: Counts
    histogram: Histogram
    candidates: Annotated[
        tuple[Annotated[tuple[Candidate, ...], Meta(max_length=MAX_CANDIDATES)], ...],
        Meta(max_length=64),
    ]
    blocked: Places


class TreeReport(Message, frozen=True):
    """An agent's report on one vertex's tree."""

    vertex: Annotated[int, Meta(ge=0, lt=MAX_VERTICES)]
    tier: Index
    parent: ParentId
    down: LeaderSummary | None
    up: Subtree | None


QueueIndex = Annotated[int, Meta(ge=0, lt=2**15)]
Centimetres = Annotated[int, Meta(ge=-(2**31), lt=2**31)]
MAX_CENTISECONDS = 2**32 - 1
Centiseconds = Annotated[int, Meta(ge=0, le=MAX_CENTISECONDS)]
"""A time, or a leader's version [10 ms]."""
MAX_LINES: Final = 64
"""Most lines, and most parts of them, in one frame."""


class Line(NamedTuple):
    """The line in which a queue's members gather: its places, displaced until it flies to them."""

    queue: QueueIndex
    version: Centiseconds  # the leader's time at the last change
    x: Centimetres  # displacement [cm; target's frame]
    y: Centimetres
    z: Centimetres
    leaves: Centiseconds  # when the displacement begins to shrink
    arrives: Centiseconds  # when it is zero


class LinePart(NamedTuple):
    """What an agent reports up the tiers of a queue's members that gather."""

    queue: QueueIndex
    parent: ParentId
    members: Members  # that may gather
    ready: Members  # in their places of the line, or not to be waited for
    x: Centimetres  # mean displacement of ``members`` from their slots [cm; target's frame]
    y: Centimetres
    z: Centimetres


class Lines(Message, frozen=True):
    """What an agent says of queues whose members gather."""

    lines: Annotated[tuple[Line, ...], Meta(max_length=MAX_LINES)]
    parts: Annotated[tuple[LinePart, ...], Meta(max_length=MAX_LINES)]


class Summary(Message, frozen=True):
    """What is slow of the Q-structure, for the multihop channel.

    ``lines`` is left out on the wire where it is None; see agent.codec.encode.
    """

    mission: Count  # key of the mission that it is about
    first: AgentId  # the id of the first label
    labels: Annotated[bytes, Meta(max_length=MAX_LABELS_B)]
    """Two bytes an id, from ``first`` on; see agent.structure.census."""
    news: Annotated[tuple[tuple[AgentId, Label], ...], Meta(max_length=64)]
    """Labels that changed since the sender's last frame."""
    trees: Annotated[tuple[TreeReport, ...], Meta(max_length=MAX_VERTICES)]
    lines: Lines | None = None


class Beacon(Message, frozen=True):
    """The local channel's broadcast (E22): heard directly, never forwarded."""

    id: AgentId
    incarnation: Count
    sequence: Count
    stamp_s: Seconds  # the sender's Observation time [s]
    position: Position  # [m; world frame]
    velocity: Velocity  # [m/s; world frame]
    target: Position
    """Immediate target, q_tg of the paper, which (22) needs [m; world frame]."""
    queue: Index  # of the claimed place, -1 for none
    rank: Index  # of the claimed place, -1 for none
    cost_mm: Cost
    """Distance to the claimed place when it was first claimed [mm]; it decides a contest."""
    speed_cap: Annotated[float, Meta(ge=0, le=100)]
    """The sender promises to stay below this speed for the next 3 s [m/s]."""
    echoes: Annotated[tuple[tuple[AgentId, Count], ...], Meta(max_length=128)]
    """(id, last sequence heard) of each neighbour."""
    mission: MissionKey  # of the mission that the sender flies
    frame_key: MissionKey
    """Key of the mission that ``frame`` belongs to; it may be newer than ``mission``, which then is
    still on its way."""
    frame: Pose  # of the target's frame; without meaning where ``frame_key`` is NO_MISSION
    drift: Drift | None  # velocity of the target's frame; None where it rests for good
    blocked: Places  # places that the sender sees taken by an unidentified vehicle (E18)
    standing: Standing | None  # in the Q-structure; None where the sender uses none


class Record(Message, frozen=True):
    """One agent's statement about itself, passed on over the multihop channel (E24).

    Only its subject writes it; ``version`` grows with each writing.
    """

    id: AgentId
    incarnation: Count
    version: Count
    stamp_s: Seconds  # the subject's Observation time at the writing [s]
    position: Position  # [m; world frame]
    queue: Index  # see Beacon
    rank: Index  # see Beacon
    cost_mm: Cost  # see Beacon [mm]
    mission: MissionKey  # of the mission in which (queue, rank) is a place
    blocked: Places  # see Beacon


class Piece(Message, frozen=True):
    """A part of an encoded mission (path and formation): number ``index`` of ``count``."""

    key: Count  # of the mission
    index: Annotated[int, Meta(ge=0, lt=MAX_PIECES)]
    count: Annotated[int, Meta(ge=1, le=MAX_PIECES)]
    data: Annotated[bytes, Meta(max_length=1000)]


class MissionData(Message, frozen=True):
    """What travels in the pieces of a mission."""

    frame: FramePath
    formation: bytes  # a FormationSpec as msgpack


DATAGRAM_HEAD_B: Final = 17
"""Bytes of a frame beside its datagram's own: see Datagram, and the checksum."""
MAX_DATAGRAM_B: Final = MAX_PAYLOAD_B - DATAGRAM_HEAD_B
"""Longest datagram of a controller [B]."""


class Datagram(Message, frozen=True):
    """Words of a controller to its like, on either channel: never forwarded, perhaps lost."""

    stamp_s: Seconds  # the sender's Observation time [s]
    data: Annotated[bytes, Meta(max_length=MAX_DATAGRAM_B)]


class Gossip(Message, frozen=True):
    """One frame of the multihop channel: records of the sender's table, a piece, or a summary."""

    id: AgentId  # the sender
    stamp_s: Seconds  # the sender's Observation time [s]
    records: Annotated[tuple[Record, ...], Meta(max_length=64)]
    piece: Piece | None
    summary: Summary | None = None
