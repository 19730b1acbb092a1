"""The interface that a controller implements: a built-in one, or a user's own.

A controller is a class that takes an :class:`~agent.config.AgentSetup` and has ``decide``. It owns
no socket, clock, thread or global random state; the only time is in its senses. The agent around it
tracks the neighbours, applies the safety filter to the intent, and talks to the radio and the
vehicle.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.metadata import entry_points
from types import MappingProxyType
from typing import NamedTuple, Protocol

import msgspec

from agent.config import AgentSetup
from agent.messages import MEMBER, Place, Standing, Summary, Vector
from agent.senses import (
    UNHEARD,
    Flown,
    Heard,
    HeardFrame,
    HeardSummary,
    Link,
    Peer,
    Received,
    Senses,
)
from netem.wire.channels import ChannelName

__all__ = [
    "BUILT_IN",
    "ENTRY_POINTS",
    "NO_WORDS",
    "UNHEARD",
    "Controller",
    "ControllerError",
    "FaultyControllerError",
    "Flown",
    "Heard",
    "HeardFrame",
    "HeardSummary",
    "Intent",
    "Link",
    "Outgoing",
    "Peer",
    "Received",
    "Senses",
    "Words",
    "load",
]

BUILT_IN = {
    "q_structure": "agent.guidance.q_structure:QStructure",
    "flocking": "agent.guidance.flocking:Flocking",
    "leader_follower": "agent.schemes.leader_follower:LeaderFollower",
    "virtual_structure": "agent.schemes.virtual_structure:VirtualStructure",
    "former_q_structure": "agent.schemes.former_q_structure:FormerQStructure",
    "printed_q_structure": "agent.schemes.printed_q_structure:PrintedQStructure",
}
COMMAND = "command"
"""The name of a controller that is a program of its own; see agent.command_controller."""
_COMMAND_CLASS = "agent.command_controller:CommandController"
ENTRY_POINTS = "qswarm.controllers"
"""The entry-point group in which an installed package names its controllers."""


class ControllerError(ValueError):
    """A controller that cannot be loaded; the text says why."""


class FaultyControllerError(RuntimeError):
    """A controller failed; the text names the controller, the agent, the time and the error."""


class FailedProgramError(FaultyControllerError):
    """The controller is a program, and failed: there is no trace of Python to show."""


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


class Outgoing(NamedTuple):
    """A datagram to the controllers of all agents in range, which may lose it or get it late."""

    channel: ChannelName
    data: bytes  # at most MAX_DATAGRAM_B


NO_SIGNALS: Mapping[str, float] = MappingProxyType({})


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
    messages: tuple[Outgoing, ...] = ()  # to send now, at most MAX_DATAGRAMS
    signals: Mapping[str, float] = NO_SIGNALS
    """Numbers of its own to record as series, by name: at most MAX_SIGNALS."""


class Controller(Protocol):
    """Decides one agent's motion, once a tick."""

    def __init__(self, setup: AgentSetup) -> None: ...

    def decide(self, senses: Senses) -> Intent:
        """Return the intent for this tick."""


Decide = Callable[[Controller, Senses], Intent]
"""How a controller is asked: a debugger stands between."""


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
    if name == COMMAND:
        return _COMMAND_CLASS
    return next((each.value for each in entry_points(group=ENTRY_POINTS, name=name)), name)
