"""One step of an agent: frames and an observation in, a command and a transmission out."""

import sys
import time
from typing import NamedTuple

from agent.codec import encode
from agent.config import AgentSetup
from agent.core import Agent
from agent.input_log import InputLog
from agent.late_frames import LateFrames
from agent.messages import Observation
from agent.step_page import StepGuard
from netem.wire.bus import Put
from netem.wire.frame import Batch, Outgoing, Transmission, pack


class StepNotes(NamedTuple):
    """Where an agent's process notes its steps, beside its messages."""

    guard: StepGuard
    inputs: InputLog | None = None  # gets all that the agent is given


class AgentStepper:
    """Runs an agent's core, publishes what it says, and prints its controller's log."""

    def __init__(
        self, setup: AgentSetup, command: Put, radio: Put, notes: StepNotes | None = None
    ) -> None:
        if notes is None:
            notes = StepNotes(StepGuard(None, 1.0 / setup.tick_hz))
        self._guard, self._inputs = notes
        self._guard.enter()
        self.core = Agent(setup)
        self._late = LateFrames() if setup.lockstep else None
        """In lockstep a step takes no time: what it says leaves later instead."""
        self._guard.leave()
        self._incarnation = setup.incarnation
        self._put_command = command
        self._put_transmission = radio

    def receive(self, batch: Batch, now_s: float) -> None:
        """Hand the frames of a batch to the core. now_s: Observation time [s]."""
        if self._inputs is not None:
            self._inputs.hear(batch.frames)
        for frame in batch.frames:
            self.core.receive(frame.source, frame.channel, frame.payload, now_s)

    def step(self, observation: Observation) -> None:
        """Step on an observation; publish one command and one transmission.

        A step that is to take long does so.
        """
        if self._inputs is not None:
            self._inputs.step(observation)
        self._guard.enter()
        outbox = self.core.step(observation)
        self._guard.leave()
        report = outbox.command.telemetry.report
        for line in report.log if report is not None else ():
            print(f"{observation.time_s:.2f} s: {line}", file=sys.stderr)
        said, slot = outbox.frames, observation.slot
        if self._late is not None:
            said = self._late.sent(said, observation.late_slots > 0)
        elif observation.takes_s > 0.0:
            time.sleep(observation.takes_s)
            slot += observation.late_slots  # a radio sends what it gets, however old
        frames = tuple([Outgoing(channel, payload) for channel, payload in said])
        transmission = pack(Transmission(slot, self._incarnation, frames))
        command = encode(outbox.command)
        # One directly after the other: the two then often leave in one packet.
        self._put_command(command)
        self._put_transmission(transmission)
        if self._inputs is not None:
            self._inputs.answer(command)
