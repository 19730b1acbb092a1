"""The free-running shell of an agent: it waits for nobody.

It takes what it has heard by the time of an observation, and counts what cannot be read.
"""

from collections import deque

from agent.codec import RejectedError, decode_observation
from agent.config import AgentSetup
from agent.messages import Observation
from agent.stepping import Controls
from netem.wire.bus import Bus
from netem.wire.frame import BATCH_RING, Delivery, WireError, pack, unpack_delivery
from netem.wire.latency import LatencyHistogram


class FreeRunningAgent:
    """Free-running: nobody is waited for, and how late each frame comes is counted."""

    def __init__(self, bus: Bus, setup: AgentSetup) -> None:
        command, radio = bus.publisher("command", setup.id), bus.publisher("tx", setup.id)
        self._controls = Controls(setup, command, radio)
        self._batches = bus.subscriber("rx", setup.id, BATCH_RING)
        self._early: deque[Delivery] = deque(maxlen=BATCH_RING)
        self._incarnation = setup.incarnation
        self._slots_a_report = round(setup.slots_per_tick * setup.tick_hz)
        self._tally = LatencyHistogram(1.0 / (setup.slots_per_tick * setup.tick_hz))
        self._tell = bus.publisher("arrivals", setup.id)
        self._report_at = self._slots_a_report + setup.id % self._slots_a_report

    def see(self, data: bytes) -> None:
        """Step on an observation; one that cannot be read is counted."""
        try:
            observation = decode_observation(data)
        except RejectedError:
            self._controls.core.rejected["observation"] += 1
            return
        self._hear(observation)
        self._controls.step(observation)
        if observation.slot >= self._report_at:
            self._report_at = observation.slot + self._slots_a_report
            self.report()

    def report(self) -> None:
        """Tell the world how late the frames came so far."""
        self._tell(pack(self._tally.report(self._incarnation)))

    def _hear(self, observation: Observation) -> None:
        """Take what has come by an observation; what is of a later slot waits for it.

        Who was kept from stepping finds newer batches beside an older observation.
        """
        for data in self._batches.drain(BATCH_RING):
            try:
                self._early.append(unpack_delivery(data))
            except WireError:
                self._controls.core.rejected["batch"] += 1
        while self._early and self._early[0].slot <= observation.slot:
            batch = self._early.popleft()
            self._tally.add(batch.frames, batch.early_us, observation.slot - batch.slot)
            self._controls.hear(batch, observation.time_s)
