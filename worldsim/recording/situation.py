"""What is in force at a tick, as the picture shows it: stopped agents, faults, sides, jams, radio.

It is told by the run's events alone. Ticks between two events share one situation.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from netem.conditions import NetworkConditions
from netem.faults import Jam, Partition
from netem.link_parameters import Conditions
from netem.wire.channels import LOCAL
from worldsim.judge.radio_events import RadioRunEvent, order_of
from worldsim.judge.run_events import (
    AgentFaultRunEvent,
    ClockChanged,
    Joined,
    Killed,
    Left,
    LossEvent,
    Paused,
    PoseChanged,
    Restarted,
    Resumed,
    ReturnEvent,
    RunEvent,
    SensorChanged,
    SlowChanged,
    Starved,
)
from worldsim.judge.tick import Tick

EVENT_TIME_SLACK_S = 1e-6
"""Event times are rounded to the microsecond."""
WORKS = "works again"
"""The mode of a sensor whose fault has ended."""
DEAD = "dead"
FAULT_WORDS = {
    ClockChanged: "wrong clock",
    PoseChanged: "wrong pose",
    SlowChanged: "slow",
    Starved: "starved",
}
"""What a label says of an agent with a fault."""


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """What is in force; row i = agent i."""

    paused: NDArray[np.bool_]
    """(N,)"""
    dead: NDArray[np.bool_]
    """(N,), agents whose process has ended while their vehicle hovers."""
    side: NDArray[np.int16]
    """(N,), the side of the newest partition in force, from 0; -1 without one."""
    jams: tuple[Jam, ...]
    notes: tuple[str, ...]
    """What an agent's label says beside its role, "" for nothing."""
    radio: "RadioRules"

    @property
    def parted(self) -> bool:
        """Whether a partition is in force."""
        return bool((self.side >= 0).any())


class RadioRules:
    """Which directed links the conditions and faults in force allow."""

    def __init__(self, network: NetworkConditions, agents: int) -> None:
        models, rows = network.models, range(agents)
        self._reach_m = np.full((agents, agents), models.of_channel(LOCAL).reach_m)
        for source in rows:
            if models.common(LOCAL, source) is None:
                self._reach_m[source] = [models.of_link(LOCAL, source, b).reach_m for b in rows]
        low_m, high_m = float(self._reach_m.min()), float(self._reach_m.max())
        self._common_m = low_m if low_m == high_m else None
        """The range of all links; None where they differ."""
        self._network = network
        changed = any(isinstance(each.fault, Conditions) for each in network.in_force.values())
        faults = {"changed": changed, "flap": network.flapping, "outage": bool(network.outages)}
        self._faults = tuple(word for word, in_force in faults.items() if in_force)
        self._obstructed, self._down = network.obstructed, bool(network.outages)
        self._cut = np.zeros((agents, agents), dtype=np.bool_)
        if network.partitioned:
            cut = [[network.partitions(a, b) for b in rows] for a in rows]
            self._cut = np.array(cut, dtype=np.bool_)

    @property
    def faults(self) -> tuple[str, ...]:
        """What else is wrong with the radio, in words."""
        return self._faults

    def in_range(
        self,
        distance: NDArray[np.float64],
        source: NDArray[np.intp],
        hearer: NDArray[np.intp],
    ) -> NDArray[np.bool_]:
        """Return which links (K,) are within their range; distance (K,) [m], not so for NaN."""
        reach_m = self._common_m
        within: NDArray[np.bool_] = distance <= (
            self._reach_m[source, hearer] if reach_m is None else reach_m
        )
        return within

    @property
    def cuts(self) -> bool:
        """Whether a fault in force may cut any link."""
        steady = self._down or self._network.partitioned
        return bool(steady or self._obstructed or self._network.flapping)

    def cut(self, tick: Tick) -> NDArray[np.bool_]:
        """Return which links a partition, a jam, a flap or an outage cuts at a tick (N, N)."""
        cut = self._cut.copy()
        if self._down:
            cut[:] = True
        if self._obstructed:
            positions = tick.position.tolist()
            jammed = np.array([self._network.jammed((x, y, z)) for x, y, z in positions])
            cut |= jammed[:, None] | jammed
        if self._network.flapping:
            for a, b in np.ndindex(*cut.shape):
                cut[a, b] |= bool(self._network.cutters(a, b, tick.time_s))
        return cut


class Situations:
    """Follows a run's events. base: the radio's conditions at the start."""

    def __init__(self, agents: int, base: Conditions) -> None:
        self._agents = agents
        self._paused = np.zeros(agents, dtype=np.bool_)
        self._dead = np.zeros(agents, dtype=np.bool_)
        self._faults: dict[tuple[object, int | None], str] = {}
        """What agents' labels say of faults in force, by the fault and the agent."""
        self._base = base
        self._network = NetworkConditions(base)
        self._radio = RadioRules(self._network, agents)
        self._pending: deque[RunEvent] = deque()
        self._now: Situation | None = None

    def handle_event(self, event: RunEvent) -> None:
        """Take an event; it is in force from the first tick at or after its time."""
        self._pending.append(event)

    def at(self, tick: Tick) -> Situation:
        """Return what is in force at a tick; ticks come in order."""
        while self._pending and self._pending[0].t_s <= tick.time_s + EVENT_TIME_SLACK_S:
            self._apply(self._pending.popleft())
        if self._now is None:
            self._now = self._situation()
        return self._now

    def _apply(self, event: RunEvent) -> None:
        match event:
            case Killed() | Left() | Paused() | Restarted() | Joined() | Resumed():
                self._note_process(event)
            case ClockChanged() | PoseChanged() | SlowChanged() | Starved() | SensorChanged():
                self._note_fault(event)
            case _ if isinstance(event, RadioRunEvent):
                self._network.apply(order_of(event))
                self._radio = RadioRules(self._network, self._agents)
            case _:
                return
        self._now = None

    def _note_process(self, event: LossEvent | ReturnEvent) -> None:
        agent = event.agent
        if agent is None or not 0 <= agent < self._agents:
            return
        self._paused[agent] = isinstance(event, Paused)
        self._dead[agent] = isinstance(event, Killed)

    def _note_fault(self, event: AgentFaultRunEvent | SensorChanged) -> None:
        key: tuple[object, int | None]
        if isinstance(event, SensorChanged):
            key, ends = (event.sensor, event.agent), event.mode == WORKS
            words = f"sensor {event.mode}"
        else:
            key, ends = (event.number, event.agent), event.ends
            words = FAULT_WORDS[type(event)]
        if ends:
            self._faults.pop(key, None)
        else:
            self._faults[key] = words

    def _situation(self) -> Situation:
        faults = [each.fault for each in self._network.in_force.values()]
        side = np.full(self._agents, -1, dtype=np.int16)
        for partition in (fault for fault in faults if isinstance(fault, Partition)):
            side = self._sides(partition)
        return Situation(
            paused=self._paused.copy(),
            dead=self._dead.copy(),
            side=side,
            jams=tuple(fault for fault in faults if isinstance(fault, Jam)),
            notes=tuple(self._note(agent, int(at)) for agent, at in enumerate(side)),
            radio=self._radio,
        )

    def _sides(self, partition: Partition) -> NDArray[np.int16]:
        """Return the side of each agent; agents that no group names are on one more."""
        side = np.full(self._agents, len(partition.groups), dtype=np.int16)
        for at, group in enumerate(partition.groups):
            side[[agent for agent in group if agent < self._agents]] = at
        return side

    def _note(self, agent: int, side: int) -> str:
        process = DEAD if self._dead[agent] else "paused" if self._paused[agent] else None
        faults = [words for (_, at), words in self._faults.items() if at == agent]
        at_side = f"side {chr(ord('A') + side)}" if 0 <= side < 26 else None
        return ", ".join(dict.fromkeys(each for each in (process, *faults, at_side) if each))
