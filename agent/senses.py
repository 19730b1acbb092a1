"""What an agent perceives: itself, its neighbours, the team, its mission.

The agent makes these once a tick; a controller reads them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import NamedTuple, final

from agent.heard_beacon import HeardStanding
from agent.messages import Place, Summary, Vector
from agent.qstructure.formation import Formation
from agent.qstructure.target_frame import Frame
from netem.wire.channels import ChannelName


@final
class Heard:
    """A neighbour heard directly, extrapolated to now."""

    def __init__(  # noqa: PLR0913, PLR0917
        self,
        id: int,
        age_s: float,  # age of its last beacon [s]
        position: Vector,  # last reported position plus velocity times age [m; world frame]
        velocity: Vector,  # as reported [m/s; world frame]
        target: Vector,  # its immediate target q_tg, as reported [m; world frame]
        place: Place | None,  # the place that it claims
        mission: int = 0,  # key of the mission that it flies
        cost_m: float | None = None,  # see Peer
        standing: HeardStanding | None = None,  # in the Q-structure, None where it uses none
        hears_me: bool = False,  # whether it echoed an own beacon of late
    ) -> None:
        self.id = id
        self.age_s = age_s
        self.position = position
        self.velocity = velocity
        self.target = target
        self.place = place
        self.mission = mission
        self.cost_m = cost_m
        self.standing = standing
        self.hears_me = hears_me


class Link(NamedTuple):
    """The radio as the agent measures it, over all neighbours."""

    loss: float  # share of beacons lost, from gaps in their sequence
    latency_s: float  # mean delay of beacons [s]
    reach_m: float  # from how far two neighbours were heard, or the only one [m]


UNHEARD = Link(loss=0.0, latency_s=0.0, reach_m=inf)
"""Before any neighbour was heard."""


@final
class HeardSummary:
    """A summary of the Q-structure, heard on the multihop channel."""

    def __init__(
        self,
        sender: int,
        stamp_s: float,  # the sender's time [s]
        summary: Summary,
    ) -> None:
        self.sender = sender
        self.stamp_s = stamp_s
        self.summary = summary


@final
@dataclass(init=False)
class Peer:
    """A known member of the team, the own agent included; heard directly or through others."""

    id: int
    position: Vector  # last reported [m; world frame]
    place: Place | None  # the place that it claims
    cost_m: float | None
    """Reported distance to its place when it first claimed it [m]."""

    def __init__(
        self, id: int, position: Vector, place: Place | None, cost_m: float | None = None
    ) -> None:
        self.id = id
        self.position = position
        self.place = place
        self.cost_m = cost_m


class Flown(NamedTuple):
    """The mission that an agent flies at present."""

    key: int
    formation: Formation
    frame: Frame  # the target's frame at present
    frame_key: int = 0  # of the mission whose frame it is: a newer one's may come first


class HeardFrame(NamedTuple):
    """The frame of a team whose mission the agent does not know."""

    key: int  # of the mission
    frame: Frame  # at present


class Received(NamedTuple):
    """A datagram of another agent's controller; see agent.controller.Outgoing."""

    source: int  # id of the agent that sent it
    channel: ChannelName
    age_s: float  # since it was sent [s]
    data: bytes


@final
@dataclass(init=False)
class Senses:
    """Everything that a controller decides on."""

    now_s: float  # simulated time, the same for all agents [s]
    position: Vector  # own [m; world frame]
    velocity: Vector  # own [m/s; world frame]
    yaw: float  # own [rad; world frame]
    vehicles: tuple[Vector, ...]
    """Vehicles within the proximity sensor's range, relative to the own centre [m; world axes]."""
    neighbours: tuple[Heard, ...]  # sorted by id
    team: Callable[[], tuple[Peer, ...]]  # all known members, sorted by id; gathered when called
    mission: Flown | None  # None: not briefed, and none heard yet
    silent: tuple[Vector, ...]  # unidentified vehicles [m; world frame] (E18)
    blocked: frozenset[Place]
    """Places that others see taken by an unidentified vehicle (E18)."""
    link: Link
    summaries: tuple[HeardSummary, ...]  # heard since the last step
    obstacles: tuple[Vector, ...]
    """Near points of obstacles, relative to the own centre [m; world axes]."""
    heard_frame: HeardFrame | None
    """Without a mission: the frame that a neighbour with a tier reported last, for up to 5 s."""
    inbox: tuple[Received, ...]
    """Datagrams heard since the last step, sorted by source, channel and time of sending."""

    def __init__(  # noqa: PLR0913, PLR0917
        self,
        now_s: float,
        position: Vector,
        velocity: Vector,
        yaw: float,
        vehicles: tuple[Vector, ...],
        neighbours: tuple[Heard, ...],
        team: Callable[[], tuple[Peer, ...]],
        mission: Flown | None,
        silent: tuple[Vector, ...] = (),
        blocked: frozenset[Place] = frozenset(),
        link: Link = UNHEARD,
        summaries: tuple[HeardSummary, ...] = (),
        obstacles: tuple[Vector, ...] = (),
        heard_frame: HeardFrame | None = None,
        inbox: tuple[Received, ...] = (),
    ) -> None:
        self.now_s = now_s
        self.position = position
        self.velocity = velocity
        self.yaw = yaw
        self.vehicles = vehicles
        self.neighbours = neighbours
        self.team = team
        self.mission = mission
        self.silent = silent
        self.blocked = blocked
        self.link = link
        self.summaries = summaries
        self.obstacles = obstacles
        self.heard_frame = heard_frame
        self.inbox = inbox
