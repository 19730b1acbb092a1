"""One agent as a process: its core between its vehicle and its radio, paced by observations.

The process reads no clock: what time it is comes with each observation.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path

import msgspec

from agent.config import AgentSetup
from agent.controller import ControllerError
from agent.free_running import FreeRunningAgent
from agent.lockstep import LockstepAgent
from netem.wire.access import AccessError, login_of
from netem.wire.barrier import LockstepError, RunOverError
from netem.wire.bus import Bus, RefusedError, Subscriber
from netem.wire.keys import Keys, agent_name
from netem.wire.session import SessionError, open_client
from netem.wire.shutdown import RunEnd, StopRequest

WAIT_S = 0.2
SILENCE_S = 30.0
SETUP_WITHIN_S = 30.0
ASK_EVERY_S = 0.1
LISTEN_EVERY_S = 0.005
MAX_SETUP_B = 256 * 1024


class GoneError(RuntimeError):
    """The world does not answer, or has said nothing for so long that it must be gone."""


def run(
    agent: int, run_name: str, connect: str, patient: bool = False, users: Path | None = None
) -> int:
    """Fly one agent, and say in one line what stood in its way; return the exit status."""
    try:
        keys = Keys(run_name)
    except ValueError as error:
        return _said(agent, error, 2)
    try:
        return fly(agent, keys, connect, patient, users)
    except (GoneError, LockstepError) as error:
        return _said(agent, error, 1)
    except (AccessError, SessionError, RefusedError, ControllerError) as error:
        return _said(agent, error, 2)


def _said(agent: int, error: Exception, status: int) -> int:
    print(f"agent-{agent}: {error}", file=sys.stderr)
    return status


def fly(
    agent: int, keys: Keys, connect: str, patient: bool = False, users: Path | None = None
) -> int:
    """Fly one agent of a run until the run is over; return 0.

    patient: whether it may be silent for long and is still there. users: the file of passwords,
    where the router wants one. Raises SessionError without a router, AccessError without a
    password, RefusedError when the world has no such agent, ControllerError when its controller
    cannot be had, GoneError when the world is not there, LockstepError when somebody speaks out
    of turn.
    """
    login = login_of(users, agent_name(agent)) if users is not None else None
    with open_client(connect, long_lease=patient, login=login) as session:
        stop = StopRequest()
        bus = Bus(session, keys)
        setup = _setup(bus, agent, keys.run, stop)
        if setup is not None:
            _fly(bus, setup, keys.run, stop)
    return 0


def _setup(bus: Bus, agent: int, run: str, stop: StopRequest) -> AgentSetup | None:
    """Ask the world for this agent's setup until it answers; None when asked to stop."""
    deadline = time.monotonic() + SETUP_WITHIN_S
    say_once = _once(f"agent-{agent} waits for the world of run {run!r}")
    while not stop.requested:
        answer = bus.query("setup", agent, b"", timeout_s=2.0)
        if answer is not None:
            return _checked(answer)
        if time.monotonic() > deadline:
            raise GoneError(f"the world of run {run!r} has not come within {SETUP_WITHIN_S:g} s")
        say_once()
        time.sleep(ASK_EVERY_S)
    return None


def _checked(answer: bytes) -> AgentSetup:
    if len(answer) > MAX_SETUP_B:
        raise GoneError(f"the world sent a setup of {len(answer)} B; {MAX_SETUP_B} B are allowed")
    try:
        return msgspec.json.decode(answer, type=AgentSetup)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise GoneError(f"the world sent a setup that cannot be read: {error}") from error


def _fly(bus: Bus, setup: AgentSetup, run: str, stop: StopRequest) -> None:
    observations, ending = (
        bus.subscriber("observation", setup.id),
        RunEnd(bus.subscriber("over"), stop),
    )
    shell = LockstepAgent(bus, setup, ending) if setup.lockstep else FreeRunningAgent(bus, setup)
    _wait_for_ears(bus, ending)
    bus.declare_alive(f"agent-{setup.id}")
    print(f"agent-{setup.id} flies in run {run!r}", flush=True)
    try:
        _steer(shell, observations, run, ending)
        shell.report()
    except RunOverError:
        print(f"agent-{setup.id}: the run is over, within a slot", flush=True)
    print(f"agent-{setup.id} is done", flush=True)


def _wait_for_ears(bus: Bus, ending: RunEnd) -> None:
    """In lockstep, wait until somebody listens to what this agent says."""
    deadline = time.monotonic() + SETUP_WITHIN_S
    while not bus.matched and not ending():
        if time.monotonic() > deadline:
            raise GoneError(f"nobody listens within {SETUP_WITHIN_S:g} s")
        time.sleep(LISTEN_EVERY_S)


def _steer(
    shell: FreeRunningAgent | LockstepAgent, observations: Subscriber, run: str, ending: RunEnd
) -> None:
    """Step on each observation until the run is over.

    Silence is counted in waits, not on a clock: a process that was stopped for a minute has not
    listened for a minute.
    """
    silent_s = 0.0
    while not ending():
        data = observations.wait(WAIT_S)
        if data is not None:
            silent_s = 0.0
            shell.see(data)
            continue
        silent_s += WAIT_S
        if silent_s > SILENCE_S:
            raise GoneError(f"the world of run {run!r} has been silent for {SILENCE_S:g} s")


def _once(text: str) -> Callable[[], None]:
    pending = [text]

    def say() -> None:
        while pending:
            print(pending.pop(), flush=True)

    return say
