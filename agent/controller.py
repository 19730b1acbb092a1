"""The interface that a controller implements: a built-in one, or a user's own.

A controller is a class that takes an :class:`~agent.config.AgentSetup` and has ``decide``. It owns
no socket, clock, thread or global random state; the only time is in its senses. The agent around it
tracks the neighbours, applies the safety filter to the intent, and talks to the radio and the
vehicle.
"""

from collections.abc import Callable
from importlib import import_module
from importlib.metadata import entry_points
from math import inf
from typing import NamedTuple, Protocol

import msgspec

from agent.config import AgentSetup
from agent.messages import MEMBER, Place, Standing, Summary, Vector
from agent.qstructure.formation import Formation
from agent.qstructure.target_frame import Frame

BUILT_IN = {
    "q_structure": "agent.guidance.q_structure:QStructure",
    "flocking": "agent.guidance.flocking:Flocking",
}
ENTRY_POINTS = "qswarm.controllers"
"""The entry-point group in which an installed package names its controllers."""


class ControllerError(ValueError):
    """A controller that cannot be loaded; the text says why."""


class Heard(msgspec.Struct, frozen=True, gc=False, order=True):
    """A neighbour heard directly, extrapolated to now."""

    id: int
    age_s: float  # age of its last beacon [s]
    position: Vector  # last reported position plus velocity times age [m; world frame]
    velocity: Vector  # as reported [m/s; world frame]
    target: Vector  # its immediate target q_tg, as reported [m; world frame]
    place: Place | None  # the place that it claims
    mission: int = 0  # key of the mission that it flies
    cost_m: float | None = None  # see Peer
    standing: Standing | None = None  # in the Q-structure, None where it uses none
    hears_me: bool = False  # whether it echoed an own beacon of late


class Link(NamedTuple):
    """The radio as the agent measures it, over all neighbours."""

    loss: float  # share of beacons lost, from gaps in their sequence
    latency_s: float  # mean delay of beacons [s]
    reach_m: float  # from how far two neighbours were heard, or the only one [m]


UNHEARD = Link(loss=0.0, latency_s=0.0, reach_m=inf)
"""Before any neighbour was heard."""


class HeardSummary(NamedTuple):
    """A summary of the Q-structure, heard on the multihop channel."""

    sender: int
    stamp_s: float  # the sender's time [s]
    summary: Summary


class Peer(msgspec.Struct, frozen=True, gc=False, order=True):
    """A known member of the team, the own agent included; heard directly or through others."""

    id: int
    position: Vector  # last reported [m; world frame]
    place: Place | None  # the place that it claims
    cost_m: float | None = None
    """Reported distance to its place when it first claimed it [m]."""


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


class Senses(msgspec.Struct, frozen=True, gc=False):
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
    silent: tuple[Vector, ...] = ()  # unidentified vehicles [m; world frame] (E18)
    blocked: frozenset[Place] = frozenset()
    """Places that others see taken by an unidentified vehicle (E18)."""
    link: Link = UNHEARD
    summaries: tuple[HeardSummary, ...] = ()  # heard since the last step
    obstacles: tuple[Vector, ...] = ()
    """Near points of obstacles, relative to the own centre [m; world axes]."""
    heard_frame: HeardFrame | None = None
    """Without a mission: the frame that a neighbour with a tier reported last, for up to 5 s."""


class Words(NamedTuple):
    """What an agent says of its part in the Q-structure."""

    standing: Standing | None = None  # for the beacons
    summary: Summary | None = None  # for the multihop channel, where one is due now
    tier: int = -1  # in the queue's tree: 0 for its vertex agent, -1 in distress
    parent: int = -1  # the agent that it follows, -1 for none
    role: int = MEMBER  # index of ROLES
    agents: int = 0  # size of the team as the structure counts it, 0 where it is not known


NO_WORDS = Words()
"""Of a controller without a Q-structure."""


class Intent(msgspec.Struct, frozen=True, gc=False):
    """What a controller wants, before the safety filter."""

    wanted: Vector  # desired velocity whatever the heading [m/s; world frame]
    velocity: Vector  # velocity to fly now; a vehicle may have to turn first [m/s; world frame]
    yaw: float  # heading to turn to [rad; world frame]
    force: float  # |u_i| of (28) before saturation [m/s]
    heading_for: Vector  # immediate target q_tg [m; world frame]
    target: Vector | None = None  # target-on-queue [m; world frame]
    place: Place | None = None  # the claimed place in the formation
    tilt: tuple[float, float] = (0.0, 0.0)  # pitch and roll [rad]
    cost_m: float = 0.0
    """Distance to the place when it was first claimed [m]; it decides a contest."""
    vertex: bool = False  # whether the agent is a queue-vertex agent at its place
    blocked: tuple[Place, ...] = ()  # places seen taken by an unidentified vehicle (E18)
    words: Words = NO_WORDS


class Controller(Protocol):
    """Decides one agent's motion, once a tick."""

    def __init__(self, setup: AgentSetup) -> None: ...

    def decide(self, senses: Senses) -> Intent:
        """Return the intent for this tick."""


def load(name: str) -> type[Controller]:
    """Return the controller class of a built-in name, an entry point or ``package.module:Class``.

    Raises :class:`ControllerError` if there is none.
    """
    module_name, _, class_name = _import_path(name).partition(":")
    if not module_name or not class_name:
        known = ", ".join([*BUILT_IN, *(each.name for each in entry_points(group=ENTRY_POINTS))])
        raise ControllerError(
            f"{name!r} is neither a known controller ({known}) nor 'package.module:Class'"
        )
    try:
        found = getattr(import_module(module_name), class_name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ControllerError(f"{name!r} cannot be imported: {error}") from error
    if not callable(getattr(found, "decide", None)):
        raise ControllerError(f"{name!r} has no method 'decide'")
    return found  # type: ignore[no-any-return]


def _import_path(name: str) -> str:
    """Return ``package.module:Class`` of a known name; any other name stays as it is."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    return next((each.value for each in entry_points(group=ENTRY_POINTS, name=name)), name)
