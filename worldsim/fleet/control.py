"""What an operator asks of a flying fleet: an event that happens now, or a report.

Each request is checked against the fleet as it is. A refused request changes nothing; one that is
carried out is reported in events like the timeline's own, as ``by`` the operator.
"""

from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import zenoh

from netem.faults import RadioEvent
from netem.link_keys import Conditions
from netem.wire.bus import Bus, Handler, drain
from worldsim.engine.operations import (
    EndProcesses,
    GiveMission,
    Operation,
    PauseProcesses,
    ResumeProcesses,
    StartProcesses,
)
from worldsim.engine.step import SlotLoop
from worldsim.judge.run_events import By, RunEvent
from worldsim.scenario.decoding import decode
from worldsim.scenario.event_checks import Present, broken_now
from worldsim.scenario.events import ON_PROCESSES, EventTable
from worldsim.scenario.tables import Scenario
from worldsim.scenario.timeline import Step
from worldsim.scenario.toml import ScenarioError

MAX_REQUEST_B = 64 * 1024
MAX_VERSION = 2**31
REQUESTS_A_SLOT = 4
MISSIONS = ("formation", "frame")
CarryOut = Callable[[Operation, By], None]


class Request(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """What an operator asks for: an event that happens now, or only a report."""

    event: dict[str, Any] | None = None
    """The event's keys without ``at_s``; None: only report."""
    to: int | None = None
    """The agent that a mission is given to; None: the lowest id."""
    version: int | None = None
    """The mission's own; None: the next."""


class ActiveFault(msgspec.Struct, frozen=True):
    """A radio fault in force."""

    number: int
    since_s: float
    """[s; simulated time]"""
    fault: RadioEvent


class Answer(msgspec.Struct, frozen=True):
    """What a request led to, and the radio since then."""

    t_s: float
    """[s; simulated time]"""
    events: tuple[RunEvent, ...]
    conditions: Conditions
    """The link conditions in force."""
    faults: tuple[ActiveFault, ...]
    """The radio faults in force, in the order of their beginning."""


class RequestError(ValueError):
    """A request that is refused; the text is the reason, in one line."""


class Control:
    """Carries out requests on a slot loop. launcher: whether processes can be started and ended."""

    def __init__(self, scenario: Scenario, loop: SlotLoop, launcher: bool) -> None:
        self._scenario = scenario
        self._loop = loop
        self._timeline = loop.effects.timeline
        self._launcher = launcher

    def answer(self, asked: bytes, carry_out: CarryOut) -> Answer:
        """Carry out a request, or raise RequestError."""
        request = _request(asked)
        before = len(self._loop.events)
        if request.event is not None:
            step = self._timeline.begin_now(self._event(request.event))
            carry_out(self._operation(step, request), "operator")
            self._timeline.end_later(step)
        return self._answer(self._loop.events[before:])

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
        if event.kind in ON_PROCESSES and not self._launcher:
            raise RequestError(f"{event.kind}: this fleet has no launcher; do it by hand")
        return event

    def _present(self) -> Present:
        effects, members = self._loop.effects, self._loop.members
        return Present(
            formation=effects.missions.formation,
            frame=effects.missions.frame,
            partitioned=effects.network.partitioned,
            known=members.id_count,
            living=frozenset(np.flatnonzero(members.running).tolist()),
            room=self._scenario.rows - members.id_count - self._timeline.joiners,
        )

    def _operation(self, step: Step, request: Request) -> Operation:
        """Return what a step means now. Raises RequestError where it means no agent."""
        self._check_mission(step.event, request)
        operation, kind = self._loop.effects.operation(step), step.event.kind
        match operation:
            case None:
                raise RequestError(f"{kind}: nothing to do")
            case EndProcesses() | PauseProcesses() | ResumeProcesses() if not operation.agents:
                selectors = list(operation.selectors)
                raise RequestError(f"{kind}: no agent that {selectors} selects can do that now")
            case StartProcesses() if not operation.incarnations:
                raise RequestError(f"{kind}: {operation.refused or 'no agent to restart'}")
            case GiveMission():
                return operation._replace(to=request.to, version=request.version)
        return operation

    def _check_mission(self, event: EventTable, request: Request) -> None:
        """Raise RequestError where a mission's addressee or version cannot be."""
        if event.kind not in MISSIONS:
            if (request.to, request.version) != (None, None):
                raise RequestError(f"{event.kind}: only a mission goes to an agent")
            return
        members, newest = self._loop.members, self._loop.effects.missions.newest
        if request.to is not None and not 0 <= request.to < members.id_count:
            raise RequestError(f"to: no agent {request.to}; 0 to {members.id_count - 1}")
        if request.to is not None and not members.running[request.to]:
            state = members.state(request.to).value
            raise RequestError(f"to: agent {request.to} is not running ({state})")
        if request.version is not None and not newest < request.version < MAX_VERSION:
            raise RequestError(f"version: {request.version}; above {newest}, which flies already")

    def _answer(self, events: list[RunEvent]) -> Answer:
        network = self._loop.network
        faults = tuple(
            ActiveFault(number, since_s, RadioEvent.of(fault))
            for number, (since_s, fault) in network.in_force.items()
        )
        t_s = round(self._loop.world.time_s, 6)
        return Answer(t_s, tuple(events), network.conditions, faults)


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
        self._questions: Handler[zenoh.Query] = bus.queryable("control")

    def attend(self, carry_out: CarryOut) -> None:
        """Answer what has come, a few a slot."""
        for query in drain(self._questions, REQUESTS_A_SLOT):
            with query:
                asked = query.payload.to_bytes() if query.payload is not None else b""
                try:
                    answer = self._control.answer(asked, carry_out)
                except RequestError as refusal:
                    query.reply_err(str(refusal))
                else:
                    query.reply(query.key_expr, msgspec.json.encode(answer))
