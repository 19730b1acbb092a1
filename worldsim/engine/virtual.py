"""Virtual time: the whole fleet in one process, as fast as the host allows.

The agents, the medium and the world are those of the processes, driven by the same slot loop.
Messages are handed over as they are, since nobody can change them; in one slot of ``CHECKED_EVERY``
they go through the codec too, as between processes, and must come out equal. What an agent says by
radio is encoded, for its bytes count: known bytes are not decoded, see ``RadioCodec``.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Final, Protocol, assert_never

from agent.codec import (
    CHECKED_EVERY,
    RadioCodec,
    check_equal,
    decode_command,
    decode_observation,
    encode,
)
from agent.config import AgentSetup
from agent.core import Agent
from agent.late_frames import LateFrames
from agent.messages import Observation
from netem.compiled import tell_if_unfit
from netem.faults import FaultOrder
from netem.medium import Medium
from netem.messages import MediumCounters
from netem.wire.frame import (
    BATCH_RING,
    Batch,
    Frame,
    Outgoing,
    Transmission,
    pack,
    unpack_batch,
    unpack_transmission,
)
from worldsim.engine.operations import (
    AdmitAgents,
    DisturbAgents,
    EndProcesses,
    FillDisk,
    GiveMission,
    Operation,
    PauseProcesses,
    ResumeProcesses,
    SetSensorMode,
    StartProcesses,
    StopWorldProcess,
    ThrottleProcesses,
)
from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS
from worldsim.engine.step import OpenSlot, Recorder, SlotLoop, world_of
from worldsim.engine.trace import TraceLog
from worldsim.scenario.tables import Scenario

WORLD_KILLED: Final = "the world was killed"
HEARD_AGAIN: Final = 16
"""So many payloads are kept with what they hold for each agent: those of about a second."""


@dataclass(frozen=True, slots=True)
class Flight:
    """A finished run in virtual time."""

    loop: SlotLoop
    medium_counters: MediumCounters
    rejected: int
    """Messages that agents rejected."""
    wall_s: float
    """Wall time [s]."""
    cpu_s: float
    """CPU time of this process [s]."""
    ended_by: str | None = None
    """What in the scenario ended the run before its time."""


class StepWatch(Protocol):
    """Learns when an agent's code, its controller included, is entered and left."""

    def enter(self, agent: int, slot: int) -> None:
        """Note that an agent is made, or steps."""

    def leave(self) -> None:
        """Note that it has returned."""


class InputTap(Protocol):
    """Learns what one agent is given: all that it decides on."""

    agent: int

    def begin(self, setup: AgentSetup) -> None:
        """Note that a process of the agent starts."""

    def step(self, frames: Sequence[Frame], observation: Observation) -> None:
        """Note the frames that the agent hears before it steps, and the observation."""


class VirtualFleet:
    """A fleet, its radio and its world, stepped slot by slot."""

    def __init__(
        self,
        scenario: Scenario,
        recorder: Recorder | None = None,
        watch: StepWatch | None = None,
        tap: InputTap | None = None,
    ) -> None:
        tell_if_unfit()
        self._tap = tap
        self.ended_by: str | None = None
        """What in the scenario ends the run before its time; None: nothing so far."""
        self._watch = watch
        self._slot = 0
        self._scenario = scenario
        self._medium = Medium(scenario.medium_setup())
        self._codec = RadioCodec(HEARD_AGAIN * scenario.rows)
        self._late: dict[int, LateFrames] = {}
        self._agents = {agent: self._new_agent(agent, 0) for agent in range(scenario.fleet.agents)}
        self._inboxes = [deque[tuple[Frame, ...]](maxlen=BATCH_RING) for _ in range(scenario.rows)]
        self.loop = SlotLoop(
            scenario, world_of(scenario, VIRTUAL_COMMAND_TICKS), recorder, self._medium.packets
        )

    @property
    def rejected(self) -> int:
        """Messages that agents rejected."""
        return sum(self.loop.rejections.by_cause().values())

    @property
    def medium_counters(self) -> MediumCounters:
        """The medium's counters."""
        return self._medium.counters(self.loop.world.slot)

    def redraw(self, seed: int) -> None:
        """Draw from the present slot on from another seed: the radio, and the sensors' noise.

        Starts and the agents that a selector draws stay those of the scenario.
        """
        self._medium.redraw(seed)
        self.loop.world.redraw(seed)

    def slot(self) -> None:
        """Run one slot: operations before it, positions, steps, batches of the next, motion.

        Where an operation ends the run, the slot is not run.
        """
        for operation in self.loop.due():
            self.carry_out(operation)
            self.loop.apply(operation)
            if self.ended_by is not None:
                return
        open_slot = self.loop.open()
        self._slot = open_slot.slot
        self._medium.place(open_slot.positions)
        for agent, observation in open_slot.observations:
            self._step(agent, observation, open_slot)
        self._medium.sabotage(open_slot.time_s)
        self._deliver(open_slot.slot + 1)
        self.loop.close(self._medium.digest())

    def carry_out(self, operation: Operation) -> None:
        """Carry out an operation between slots."""
        match operation:
            case EndProcesses(agents=agents):
                for agent in agents:
                    # A booting agent has its core already.
                    del self._agents[agent]
                    self._inboxes[agent].clear()
            case StartProcesses(incarnations=incarnations):
                for agent, incarnation in incarnations.items():
                    self._agents[agent] = self._new_agent(agent, incarnation)
            case FaultOrder():
                self._medium.apply(operation)
            case StopWorldProcess(cause=cause):
                # In a pause simulated time stands still: nothing happens meanwhile.
                self.ended_by = WORLD_KILLED if cause == "kill" else None
            case PauseProcesses() | ResumeProcesses() | AdmitAgents() | ThrottleProcesses():
                pass  # the slot loop decides which agents step
            case SetSensorMode() | DisturbAgents() | GiveMission() | FillDisk():
                pass  # the slot loop applies what the world shows, and missions
            case _:
                assert_never(operation)

    def _new_agent(self, agent: int, incarnation: int) -> Agent:
        self._late[agent] = LateFrames()
        setup = self._scenario.agent_setup(agent, incarnation, VIRTUAL_COMMAND_TICKS)
        if self._tap is not None and self._tap.agent == agent:
            self._tap.begin(setup)
        if self._watch is None:
            return Agent(setup, self._codec)
        self._watch.enter(agent, self._slot)
        core = Agent(setup, self._codec)
        self._watch.leave()
        return core

    def _step(self, agent: int, observation: Observation, open_slot: OpenSlot) -> None:
        core, now_s = self._agents[agent], open_slot.time_s
        checks = open_slot.slot % CHECKED_EVERY == 0
        if checks:
            check_equal(observation, decode_observation(encode(observation)))
        inbox = self._inboxes[agent]
        if self._tap is not None and self._tap.agent == agent:
            self._tap.step([frame for batch in inbox for frame in batch], observation)
        heard_s = observation.time_s
        while inbox:
            for frame in inbox.popleft():
                core.receive(frame.source, frame.channel, frame.payload, heard_s)
        if self._watch is not None:
            self._watch.enter(agent, open_slot.slot)
        outbox = core.step(observation)
        if self._watch is not None:
            self._watch.leave()
        said = self._late[agent].sent(outbox.frames, observation.late_slots > 0)
        outgoing = tuple([Outgoing(channel, payload) for channel, payload in said])
        transmission = Transmission(open_slot.slot, outbox.command.incarnation, outgoing)
        if checks:
            check_equal(transmission, unpack_transmission(pack(transmission)))
        self._medium.transmit(agent, now_s, transmission)
        command = encode(outbox.command)
        if checks:
            check_equal(outbox.command, decode_command(command))
        self.loop.apply_command(agent, outbox.command, command)

    def _deliver(self, slot: int) -> None:
        """Put the batches of a slot into the inboxes of the agents that step in it."""
        if self._medium.down:
            return
        clock = self.loop.world.clock
        alive, time_s = self.loop.members.alive.tolist(), clock.time_s(slot)
        for agent in range(slot % clock.slots_per_tick, len(alive), clock.slots_per_tick):
            if alive[agent]:
                frames = self._medium.collect(agent, time_s)
                if slot % CHECKED_EVERY == 0:
                    batch = Batch(slot, frames)
                    check_equal(batch, unpack_batch(pack(batch)))
                self._inboxes[agent].append(frames)


class Probe(Protocol):
    """Looks into a fleet that flies."""

    def before_slot(self, fleet: VirtualFleet) -> None:
        """See the fleet before its next slot."""


def fly(
    scenario: Scenario,
    recorder: Recorder | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    watch: StepWatch | None = None,
    log: TraceLog | None = None,
    probe: Probe | None = None,
) -> Flight:
    """Fly a scenario in virtual time to its end, or until ``should_stop`` returns True.

    log: gets checksums of what goes into the trace. probe: sees the fleet before each slot, and may
    change what is drawn from there on.
    """
    fleet = VirtualFleet(scenario, recorder, watch)
    fleet.loop.trace.log = log
    wall, cpu = perf_counter(), process_time()
    while fleet.loop.world.slot < scenario.slots and not should_stop() and not fleet.ended_by:
        if probe is not None:
            probe.before_slot(fleet)
        fleet.slot()
    fleet.loop.finish()
    return Flight(
        loop=fleet.loop,
        medium_counters=fleet.medium_counters,
        rejected=fleet.rejected,
        wall_s=perf_counter() - wall,
        cpu_s=process_time() - cpu,
        ended_by=fleet.ended_by,
    )
