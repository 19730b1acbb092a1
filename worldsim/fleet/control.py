"""What an operator asks of a flying fleet: events of the timeline's kind, and how things stand.

Each request is checked against the fleet as it is. What is refused changes nothing; what is done
is told in events as the timeline's own, by the operator.
"""

from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import zenoh

from netem.wire.bus import Bus, Waiting, drained
from worldsim.engine.barriers import in_force
from worldsim.engine.membership import Deed, Hold, Start, Stop
from worldsim.engine.step import Event, SlotLoop
from worldsim.scenario.decoding import decode
from worldsim.scenario.event_checks import Present, broken_now
from worldsim.scenario.events import UPON_PROCESSES, EventTable
from worldsim.scenario.tables import Scenario
from worldsim.scenario.timeline import Order
from worldsim.scenario.toml import ScenarioError

MAX_REQUEST_B = 64 * 1024
MAX_VERSION = 2**31
REQUESTS_A_SLOT = 4
MISSIONS = ("formation", "frame")
UNSPOKEN = frozenset({"tables", "conditions", "path"})
Do = Callable[[Deed], None]


class Request(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """An event to happen now, its keys but ``at_s``; none: only tell how things stand.

    to: the agent that a mission is given to; version: the mission's own.
    """

    event: dict[str, Any] | None = None
    to: int | None = None
    version: int | None = None


class Answer(msgspec.Struct, frozen=True):
    """What came of a request: the time [s], the events, and the radio as it is since then.

    barriers: what stands between radios, see ``in_force``.
    """

    t_s: float
    events: list[dict[str, Any]]
    conditions: dict[str, Any]
    barriers: dict[str, list[dict[str, Any]]]


class RequestError(ValueError):
    """A request that is refused; the text is the reason, in one line."""


class Control:
    """Carries out requests on a slot loop. launcher: whether processes can be started and ended."""

    def __init__(self, scenario: Scenario, loop: SlotLoop, launcher: bool) -> None:
        self._scenario = scenario
        self._loop = loop
        self._launcher = launcher

    def answer(self, asked: bytes, do: Do) -> Answer:
        """Carry out a request by ``do``, or raise RequestError."""
        request = _request(asked)
        before = len(self._loop.events)
        if request.event is not None:
            event = self._event(request.event)
            do(self._deed(event, request))
            self._loop.timeline.undo_later(event)
        return self._told(self._loop.events[before:])

    def _event(self, keys: dict[str, Any]) -> EventTable:
        if (unsaid := _unsaid(keys)) is not None:
            raise RequestError(f"{unsaid}: nothing, or a number that is not finite")
        try:
            event = decode({**keys, "at_s": self._loop.world.time_s}, EventTable, "")
        except ScenarioError as error:
            raise RequestError(f"{error.key}: {error.detail}") from error
        broken = broken_now(self._scenario, event, self._present())
        if broken is not None:
            raise RequestError(": ".join(part for part in broken if part))
        if event.kind in UPON_PROCESSES and not self._launcher:
            raise RequestError(f"{event.kind}: this fleet has no launcher; do it by hand")
        return event

    def _present(self) -> Present:
        timeline, team = self._loop.timeline, self._loop.team
        living = frozenset(np.flatnonzero(team.awake).tolist())
        room = self._scenario.rows - team.known - timeline.joiners
        return Present(
            timeline.formation, timeline.frame, timeline.parted, team.known, living, room
        )

    def _deed(self, event: EventTable, request: Request) -> Deed:
        """Find whom an event means; whoever is not there cannot be meant."""
        self._check_mission(event, request)
        action = self._loop.timeline.sudden(event)
        if action is None:
            raise RequestError(f"{event.kind}: nothing to do")
        deed = self._loop.deed(action)
        if isinstance(deed, Stop | Hold) and not deed.agents:
            raise RequestError(f"{deed.kind}: nobody there whom {list(deed.selectors)} means")
        if isinstance(deed, Start) and not deed.incarnations:
            raise RequestError(f"{deed.kind}: {deed.refused or 'nobody to come back'}")
        if isinstance(deed, Order):
            return deed._replace(to=request.to, version=request.version)
        return deed

    def _check_mission(self, event: EventTable, request: Request) -> None:
        if event.kind not in MISSIONS and (request.to, request.version) != (None, None):
            raise RequestError(f"{event.kind}: is no mission, which alone goes to an agent")
        team, newest = self._loop.team, self._loop.orders.newest(self._loop.newest)
        if request.to is not None and not 0 <= request.to < team.known:
            raise RequestError(f"to: no agent {request.to}; 0 to {team.known - 1}")
        if request.to is not None and not team.awake[request.to]:
            raise RequestError(f"to: agent {request.to} takes no part at present")
        if request.version is not None and not newest < request.version < MAX_VERSION:
            raise RequestError(f"version: {request.version}; above {newest}, which flies already")

    def _told(self, events: list[Event]) -> Answer:
        timeline = self._loop.timeline
        return Answer(
            round(self._loop.world.time_s, 6),
            [{k: v for k, v in event.items() if k not in UNSPOKEN} for event in events],
            msgspec.to_builtins(timeline.conditions),
            in_force(self._loop.events),
        )


def _request(asked: bytes) -> Request:
    if len(asked) > MAX_REQUEST_B:
        raise RequestError(f"{len(asked)} B; a request has {MAX_REQUEST_B} B at most")
    try:
        return msgspec.json.decode(asked, type=Request)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise RequestError(f"a request that cannot be read: {error}") from error


def _unsaid(keys: dict[str, Any]) -> str | None:
    """Return where a request says nothing, or None; that is what JSON makes of NaN."""
    waiting: list[tuple[str, Any]] = list(keys.items())
    for path, value in waiting:
        if value is None:
            return path
        if isinstance(value, dict):
            waiting += [(f"{path}.{key}", inner) for key, inner in value.items()]
        elif isinstance(value, list):
            waiting += [(f"{path}[{at}]", inner) for at, inner in enumerate(value)]
    return None


class Reception:
    """Where requests come in over Zenoh, and are answered between slots."""

    def __init__(self, bus: Bus, control: Control) -> None:
        self._control = control
        self._questions: Waiting[zenoh.Query] = bus.questions("control")

    def attend(self, do: Do) -> None:
        """Answer what has come, a few a slot."""
        for query in drained(self._questions, REQUESTS_A_SLOT):
            with query:
                asked = query.payload.to_bytes() if query.payload is not None else b""
                try:
                    answer = self._control.answer(asked, do)
                except RequestError as refusal:
                    query.reply_err(str(refusal))
                else:
                    query.reply(query.key_expr, msgspec.json.encode(answer))
