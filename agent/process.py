"""One agent as a process: it connects the core to the vehicle and the radio.

Observations pace the process and carry the time; the core reads no clock.
"""

import sys
import time
from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import NamedTuple

import msgspec

from agent.config import AgentSetup
from agent.controller import ControllerError, FailedProgramError
from agent.free_running import FreeRunningAgent
from agent.input_log import InputLog
from agent.lockstep import LockstepAgent
from agent.step_page import StepGuard
from agent.stepping import StepNotes
from netem.wire.access import AccessError, login_of
from netem.wire.barrier import LockstepError
from netem.wire.bus import Bus, RefusedError
from netem.wire.keys import Keys, agent_name
from netem.wire.session import OPEN_TIMEOUT_S, SessionError, open_client
from netem.wire.shutdown import RunEnd, StopRequest

WAIT_S = 0.2
SILENCE_S = 30.0
A_DAY_S = 24 * 3600.0
SETUP_WITHIN_S = 30.0
ASK_EVERY_S = 0.1
LISTEN_EVERY_S = 0.005
MAX_SETUP_B = 256 * 1024


class Patience(NamedTuple):
    """How long an agent waits for others that are silent."""

    open_within_s: float = OPEN_TIMEOUT_S
    silence_s: float = SILENCE_S


BY_HAND = Patience()


class Kept(NamedTuple):
    """Where an agent's process notes what it does, beside its messages."""

    row: "memoryview[int] | None" = None  # of a StepPage, for its steps
    inputs: Path | None = None  # folder for a log of all that it is given; None: it keeps none


NOTHING_KEPT = Kept()


LAUNCHED = Patience(open_within_s=A_DAY_S, silence_s=inf)
"""Of an agent that a launcher ends: it waits while netem is down."""


class WorldGoneError(RuntimeError):
    """The world does not answer, or has been silent for too long."""


def run(
    agent: int,
    run_name: str,
    connect: str,
    patience: Patience = BY_HAND,
    users: Path | None = None,
    kept: Kept = NOTHING_KEPT,
) -> int:
    """Fly one agent; print an error in one line to stderr. Returns the exit status.

    kept: where the agent notes what it does.
    """
    try:
        keys = Keys(run_name)
    except ValueError as error:
        return _failed(agent, error, 2)
    try:
        return fly(agent, keys, connect, patience, users, kept)
    except (WorldGoneError, LockstepError, FailedProgramError) as error:
        return _failed(agent, error, 1)
    except (AccessError, SessionError, RefusedError, ControllerError) as error:
        return _failed(agent, error, 2)


def _failed(agent: int, error: Exception, status: int) -> int:
    print(f"agent-{agent}: {error}", file=sys.stderr)
    return status


def fly(
    agent: int,
    keys: Keys,
    connect: str,
    patience: Patience = BY_HAND,
    users: Path | None = None,
    kept: Kept = NOTHING_KEPT,
) -> int:
    """Fly one agent of a run until the run is over; return 0.

    users: the file of passwords, if the router wants one. kept: where the agent notes what it does.
    Raises SessionError without a router, AccessError without a password, RefusedError if the world
    has no such agent, ControllerError if its controller cannot be loaded, WorldGoneError if the
    world is not there, LockstepError for a message out of turn.
    """
    login = login_of(users, agent_name(agent)) if users is not None else None
    with open_client(connect, patience.open_within_s, login=login) as session:
        stop = StopRequest()
        bus = Bus(session, keys)
        setup = _setup(bus, agent, keys.run, stop)
        if setup is not None:
            notes = StepNotes(StepGuard(kept.row, 1.0 / setup.tick_hz), _inputs(kept, setup))
            ending = RunEnd(bus.subscriber("over"), stop)
            _run_shell(bus, setup, notes, ending, patience.silence_s)
            if notes.inputs is not None:
                notes.inputs.close()
    return 0


def _inputs(kept: Kept, setup: AgentSetup) -> InputLog | None:
    return InputLog(kept.inputs, setup) if kept.inputs is not None else None


def _setup(bus: Bus, agent: int, run: str, stop: StopRequest) -> AgentSetup | None:
    """Ask the world for this agent's setup until it answers; None when asked to stop."""
    deadline = time.monotonic() + SETUP_WITHIN_S
    print_waiting = _printed_once(f"agent-{agent} waits for the world of run {run!r}")
    while not stop.requested:
        answer = bus.query("setup", agent, b"", timeout_s=2.0)
        if answer is not None:
            return checked_setup(answer)
        if time.monotonic() > deadline:
            raise WorldGoneError(
                f"the world of run {run!r} did not answer within {SETUP_WITHIN_S:g} s"
            )
        print_waiting()
        time.sleep(ASK_EVERY_S)
    return None


def checked_setup(answer: bytes) -> AgentSetup:
    """Decode the world's answer to an agent that asked for its setup. Raises WorldGoneError."""
    if len(answer) > MAX_SETUP_B:
        raise WorldGoneError(
            f"the world sent a setup of {len(answer)} B; {MAX_SETUP_B} B are allowed"
        )
    try:
        return msgspec.json.decode(answer, type=AgentSetup)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise WorldGoneError(f"the world sent a setup that cannot be decoded: {error}") from error


def _run_shell(
    bus: Bus, setup: AgentSetup, notes: StepNotes, ending: RunEnd, silence_s: float
) -> None:
    shell = (
        LockstepAgent(bus, setup, notes) if setup.lockstep else FreeRunningAgent(bus, setup, notes)
    )
    _wait_for_listener(bus, ending)
    bus.declare_alive(f"agent-{setup.id}")
    print(f"agent-{setup.id} flies in run {bus.run!r}", flush=True)
    _step_until_over(shell, bus.run, ending, silence_s)
    shell.report()
    print(f"agent-{setup.id} is done", flush=True)


def _wait_for_listener(bus: Bus, ending: RunEnd) -> None:
    """In lockstep, wait until another process listens to this agent's messages."""
    deadline = time.monotonic() + SETUP_WITHIN_S
    while not bus.matched and not ending():
        if time.monotonic() > deadline:
            raise WorldGoneError(f"no process listened within {SETUP_WITHIN_S:g} s")
        time.sleep(LISTEN_EVERY_S)


def _step_until_over(
    shell: FreeRunningAgent | LockstepAgent, run: str, ending: RunEnd, most_silence_s: float
) -> None:
    """Step on each of the shell's inputs until the run is over.

    Silence is counted in waits, not on a clock: a process that was stopped for a minute has not
    listened for a minute.
    """
    silent_s = 0.0
    while not ending():
        data = shell.inputs.wait(WAIT_S)
        if data is not None:
            silent_s = 0.0
            shell.observe(data)
            continue
        silent_s += WAIT_S
        if silent_s > most_silence_s:
            raise WorldGoneError(f"the world of run {run!r} was silent for {most_silence_s:g} s")


def _printed_once(text: str) -> Callable[[], None]:
    """Return a function that prints the text at its first call only."""
    pending = [text]

    def print_pending() -> None:
        while pending:
            print(pending.pop(), flush=True)

    return print_pending
