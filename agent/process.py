"""One agent as a process: its core between its vehicle and its radio, paced by observations.

The process reads no clock: what time it is comes with each observation.
"""

import sys
import time
from collections.abc import Callable

import msgspec

from agent.codec import RejectedError, decode_observation, encode
from agent.controller import ControllerError
from agent.core import Agent
from agent.messages import Observation
from agent.setup import AgentSetup
from netem.wire.frame import (
    BATCH_RING,
    Outgoing,
    Transmission,
    WireError,
    pack,
    unpack_batch,
)
from netem.wire.keys import Keys
from netem.wire.post import Post, RefusedError
from netem.wire.session import SessionError, open_client
from netem.wire.stop import Stop

WAIT_S = 0.2
SILENCE_S = 30.0
SETUP_WITHIN_S = 30.0
ASK_EVERY_S = 0.1
MAX_SETUP_B = 256 * 1024


class GoneError(RuntimeError):
    """The world does not answer, or has said nothing for so long that it must be gone."""


class Cockpit:
    """An agent's core at the controls: one observation in, one command and one tx out."""

    def __init__(self, post: Post, setup: AgentSetup) -> None:
        self._core = Agent(setup)
        self._incarnation = setup.incarnation
        self._batches = post.ring("rx", setup.id, BATCH_RING)
        self._command = post.putter("command", setup.id)
        self._radio = post.putter("tx", setup.id)
        self.rejected = 0

    def see(self, data: bytes) -> None:
        """Step on an observation; one that cannot be read is counted."""
        try:
            observation = decode_observation(data)
        except RejectedError:
            self.rejected += 1
            return
        self._hear(observation)
        outbox = self._core.step(observation)
        self._command(encode(outbox.command))
        frames = tuple(Outgoing(channel, payload) for channel, payload in outbox.frames)
        self._radio(pack(Transmission(observation.slot, self._incarnation, frames)))

    def _hear(self, observation: Observation) -> None:
        for data in self._batches.drain(BATCH_RING):
            try:
                batch = unpack_batch(data)
            except WireError:
                self.rejected += 1
                continue
            for frame in batch.frames:
                self._core.receive(frame.source, frame.channel, frame.payload, observation.time_s)


def run(agent: int, run_name: str, connect: str) -> int:
    """Fly one agent, and say in one line what stood in its way; return the exit status."""
    try:
        keys = Keys(run_name)
    except ValueError as error:
        return _said(agent, error, 2)
    try:
        return fly(agent, keys, connect)
    except GoneError as error:
        return _said(agent, error, 1)
    except (SessionError, RefusedError, ControllerError) as error:
        return _said(agent, error, 2)


def _said(agent: int, error: Exception, status: int) -> int:
    print(f"agent-{agent}: {error}", file=sys.stderr)
    return status


def fly(agent: int, keys: Keys, connect: str) -> int:
    """Fly one agent of a run until the run is over; return 0.

    Raises SessionError without a router, RefusedError when the world has no such agent,
    ControllerError when its controller cannot be had, GoneError when the world is not there.
    """
    with open_client(connect) as session:
        stop = Stop()
        post = Post(session, keys)
        setup = _setup(post, agent, keys.run, stop)
        if setup is not None:
            _fly(post, setup, keys.run, stop)
    return 0


def _setup(post: Post, agent: int, run: str, stop: Stop) -> AgentSetup | None:
    """Ask the world for this agent's setup until it answers; None when asked to stop."""
    deadline = time.monotonic() + SETUP_WITHIN_S
    say_once = _once(f"agent-{agent} waits for the world of run {run!r}")
    while not stop.asked:
        answer = post.ask("setup", agent, b"", timeout_s=2.0)
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
    except msgspec.DecodeError as error:
        raise GoneError(f"the world sent a setup that cannot be read: {error}") from error


def _fly(post: Post, setup: AgentSetup, run: str, stop: Stop) -> None:
    observations, over = post.ring("observation", setup.id), post.ring("over")
    cockpit = Cockpit(post, setup)
    post.show_life(f"agent-{setup.id}")
    print(f"agent-{setup.id} flies in run {run!r}", flush=True)
    # Silence is counted in waits, not on a clock: a process that was stopped for a minute has
    # not listened for a minute.
    silent_s = 0.0
    while not stop.asked:
        data = observations.wait(WAIT_S)
        if data is not None:
            silent_s = 0.0
            cockpit.see(data)
            continue
        if over.drain(1):
            break
        silent_s += WAIT_S
        if silent_s > SILENCE_S:
            raise GoneError(f"the world of run {run!r} has been silent for {SILENCE_S:g} s")
    print(f"agent-{setup.id} is done, {cockpit.rejected} messages could not be read", flush=True)


def _once(text: str) -> Callable[[], None]:
    pending = [text]

    def say() -> None:
        while pending:
            print(pending.pop(), flush=True)

    return say
