"""The free-running shell of an agent: it never waits for other processes.

It steps on each observation with the frames that have arrived by then, and counts messages that
cannot be decoded.
"""

from collections import deque

from agent.codec import decode_observation
from agent.config import AgentSetup
from agent.messages import Observation
from agent.rejection import RejectedError
from agent.stepping import AgentStepper, StepNotes
from netem.wire.bus import Bus
from netem.wire.frame import BATCH_RING, Delivery, WireError, pack, unpack_delivery
from netem.wire.latency import LatencyHistogram


class FreeRunningAgent:
    """An agent on wall-clock pace; about once a second it reports how late frames were used."""

    def __init__(self, bus: Bus, setup: AgentSetup, notes: StepNotes | None = None) -> None:
        self.inputs = bus.subscriber("observation", setup.id)
        """Each makes the agent step: the newest observation."""
        command, radio = bus.publisher("command", setup.id), bus.publisher("tx", setup.id)
        self._stepper = AgentStepper(setup, command, radio, notes)
        self._batches = bus.subscriber("rx", setup.id, BATCH_RING)
        self._early: deque[Delivery] = deque(maxlen=BATCH_RING)
        self._incarnation = setup.incarnation
        self._report_every_slots = round(setup.slots_per_tick * setup.tick_hz)
        self._tally = LatencyHistogram(1.0 / (setup.slots_per_tick * setup.tick_hz))
        self._put_report = bus.publisher("arrivals", setup.id)
        self._next_report_slot = self._report_every_slots + setup.id % self._report_every_slots

    def observe(self, data: bytes) -> None:
        """Step on an encoded observation; count it if it cannot be decoded."""
        try:
            observation = decode_observation(data)
        except RejectedError:
            self._stepper.core.rejected["observation"] += 1
            return
        self._receive(observation)
        self._stepper.step(observation)
        if observation.slot >= self._next_report_slot:
            self._next_report_slot = observation.slot + self._report_every_slots
            self.report()

    def report(self) -> None:
        """Report to the world how late frames were used so far."""
        self._put_report(pack(self._tally.report(self._incarnation)))

    def _receive(self, observation: Observation) -> None:
        """Take the batches up to the observation's slot; later ones wait for their observation.

        After a pause of this process, newer batches lie beside an older observation.
        """
        for data in self._batches.drain(BATCH_RING):
            try:
                self._early.append(unpack_delivery(data))
            except WireError:
                self._stepper.core.rejected["batch"] += 1
        while self._early and self._early[0].slot <= observation.slot:
            batch = self._early.popleft()
            self._tally.add(batch.frames, batch.early_us, observation.slot - batch.slot)
            self._stepper.receive(batch, observation.time_s)
