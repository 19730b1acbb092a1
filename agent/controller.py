"""The interface a controller implements; the Q-structure is one, a user brings another.

A controller is a class that takes an :class:`~agent.config.AgentSetup` and has ``decide``. It owns
no socket, clock, thread or global random state: time is in what it senses. The agent around it
keeps the neighbours, applies the safety filter to what the controller wants, and talks to radio
and vehicle.
"""

from collections.abc import Callable
from importlib import import_module
from importlib.metadata import entry_points
from typing import NamedTuple, Protocol

import msgspec

from agent.config import AgentSetup
from agent.messages import Place, Vector
from agent.qstructure.formation import Formation
from agent.qstructure.target_frame import Frame

BUILT_IN = {
    "q_structure": "agent.guidance.q_structure:QStructure",
    "flocking": "agent.guidance.flocking:Flocking",
}
ENTRY_POINTS = "qswarm.controllers"
"""The entry-point group under which another package names its controllers."""


class ControllerError(ValueError):
    """A controller that cannot be had; the text says why."""


class Heard(msgspec.Struct, frozen=True, gc=False, order=True):
    """A neighbour heard directly, brought forward to now.

    position [m; world frame]: as told plus velocity times age; target [m; world frame]: where it
    is heading right now (q_tg); age_s: how old what it told is.
    """

    id: int
    age_s: float
    position: Vector
    velocity: Vector
    target: Vector
    place: Place | None


class Peer(msgspec.Struct, frozen=True, gc=False, order=True):
    """A member of the team as far as known, oneself included; told directly or passed on.

    position [m; world frame]: where it last said it was; cost_m: how far from its place it was when
    it first claimed it, as it says.
    """

    id: int
    position: Vector
    place: Place | None
    cost_m: float | None = None


class Flown(NamedTuple):
    """The mission an agent flies: its key, the formation, and the target's frame."""

    key: int
    formation: Formation
    frame: Frame


class Senses(msgspec.Struct, frozen=True, gc=False):
    """What a controller decides on: own pose, what is heard, who is known, what is near.

    vehicles: bodies within the proximity sensor, relative to the own centre [m; world axes].
    obstacles: nearest points of what else is near, relative likewise.
    team(): all members known, sorted by id; gathered when it is asked for. mission: what the team
    shall form. silent: where bodies stand from which nothing is heard [m; world frame]; blocked:
    places that others see taken by such a body (E18).
    """

    now_s: float
    position: Vector
    velocity: Vector
    yaw: float
    vehicles: tuple[Vector, ...]
    neighbours: tuple[Heard, ...]
    team: Callable[[], tuple[Peer, ...]]
    mission: Flown
    silent: tuple[Vector, ...] = ()
    blocked: frozenset[Place] = frozenset()
    obstacles: tuple[Vector, ...] = ()


class Intent(msgspec.Struct, frozen=True, gc=False):
    """What a controller wants, before the safety filter.

    wanted [m/s; world frame]: the velocity it would like, whatever its heading; velocity: what it
    asks for now, given that a vehicle may have to turn first; yaw [rad]: the heading it asks for;
    force: |u_i| of (28) before saturation; heading_for: its immediate target q_tg [m];
    target: its target-on-queue [m] and ``place`` its place in the formation, if it has any; cost_m:
    how far it was from there when it first claimed it, which decides a contest; tilt:
    pitch and roll it asks for [rad]; vertex: whether it is a queue-vertex agent there; blocked: the
    places that it sees taken by a silent body.
    """

    wanted: Vector
    velocity: Vector
    yaw: float
    force: float
    heading_for: Vector
    target: Vector | None = None
    place: Place | None = None
    tilt: tuple[float, float] = (0.0, 0.0)
    cost_m: float = 0.0
    vertex: bool = False
    blocked: tuple[Place, ...] = ()


class Controller(Protocol):
    """Decides one agent's motion, once a tick."""

    def __init__(self, setup: AgentSetup) -> None: ...

    def decide(self, senses: Senses) -> Intent:
        """Return what to do now."""


def load(name: str) -> type[Controller]:
    """Return the controller class of a built-in name, an entry point or ``package.module:Class``.

    Raises :class:`ControllerError` where there is none.
    """
    module_name, _, class_name = _where(name).partition(":")
    if not module_name or not class_name:
        known = ", ".join([*BUILT_IN, *(each.name for each in entry_points(group=ENTRY_POINTS))])
        raise ControllerError(f"{name!r} is neither known ({known}) nor 'package.module:Class'")
    try:
        found = getattr(import_module(module_name), class_name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ControllerError(f"{name!r} cannot be imported: {error}") from error
    if not callable(getattr(found, "decide", None)):
        raise ControllerError(f"{name!r} has no method 'decide'")
    return found  # type: ignore[no-any-return]


def _where(name: str) -> str:
    """Return ``package.module:Class`` of a controller's name; a name that is not known stays."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    return next((each.value for each in entry_points(group=ENTRY_POINTS, name=name)), name)
