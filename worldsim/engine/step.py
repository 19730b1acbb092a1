"""The slot loop, the same under every clock: who takes part, in which order, and what is seen.

Before a slot a clock does what is ``due`` and says so by ``take``. It calls ``open`` at the start
of a slot, brings the observations to the agents and their commands back to ``obey``, and calls
``close``. Nothing here knows how messages travel.
"""

from collections.abc import Callable, Iterable, Iterator
from math import nan
from typing import Any, Protocol

import msgspec
import numpy as np

from agent.messages import Command, Observation, Vector
from worldsim.engine.counters import RadioUse, RejectionCounters
from worldsim.engine.membership import Begin, Deed, Fail, Hold, Start, Stop, Team, deed_of
from worldsim.engine.missions import Orders
from worldsim.engine.telemetry import NO_TELEMETRY, tick_of, told_by
from worldsim.engine.trace import Trace
from worldsim.judge.tick import Packets, Tick
from worldsim.judge.verdict import Figures, Judge
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario
from worldsim.scenario.timeline import (
    BARRIERS,
    Action,
    Change,
    Flapping,
    Heal,
    Jamming,
    Order,
    Partition,
    Timeline,
)
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.proximity_sensor import ProximitySensor
from worldsim.truth.scanning_sensors import Scans
from worldsim.truth.start_positions import starts_of
from worldsim.truth.world import Clock, World

Event = dict[str, Any]


class Recorder(Protocol):
    """Keeps what a run showed. It must never fail the run: it reports its own troubles."""

    @property
    def shows(self) -> bool:
        """Whether it keeps ticks; links and standings, which are only shown, are gathered then."""

    def tick(self, tick: Tick, figures: Figures) -> None:
        """Keep one tick."""

    def event(self, event: Event) -> None:
        """Keep one event: ``t_s``, ``kind``, ``agent`` and what else belongs to the kind."""


class Opened(msgspec.Struct, frozen=True, gc=False):
    """A slot as it begins: the truth for the medium, an observation for each agent that steps.

    positions: where the radios are [m; world frame], None for an agent that takes no part.
    """

    slot: int
    time_s: float
    positions: tuple[Vector | None, ...]
    observations: list[tuple[int, Observation]]


def world_of(scenario: Scenario, command_ticks: int) -> World:
    """Return a scenario's world at its start. Raises StartError where there is no room."""
    obstacles = Obstacles(scenario.obstacle)
    position, yaw = starts_of(scenario, obstacles)
    later = scenario.rows - scenario.fleet.agents
    return World(
        clock=Clock(scenario.fleet.tick_hz, SLOTS_PER_TICK),
        limits=scenario.vehicles,
        position=np.concatenate((position, np.full((later, 3), nan))),
        yaw=np.concatenate((yaw, np.full(later, nan))),
        sensor=ProximitySensor(scenario.seed, scenario.sensor.proximity.noise_m, obstacles),
        scans=Scans(
            scenario.vehicles, scenario.sensor, scenario.seed, scenario.fleet.tick_hz, obstacles
        ),
        command_ticks=command_ticks,
    )


class SlotLoop:
    """Steps a world slot by slot, and shows every tick to the judge and the recorder.

    ``packets`` is asked once a tick for the medium's counters.
    """

    def __init__(
        self,
        scenario: Scenario,
        world: World,
        recorder: Recorder | None = None,
        packets: Callable[[], Packets] = dict,
    ) -> None:
        self.world = world
        self.judge = Judge(scenario)
        self.trace = Trace()
        self.events: list[Event] = []
        self.figures: Figures | None = None
        self.team = Team(scenario)
        self.timeline = Timeline(scenario)
        self.orders = Orders()
        self.radio_use = RadioUse(scenario.rows, scenario.fleet.tick_hz)
        self._planned: dict[str, Any] = {}
        self._formation = scenario.formation
        self._recorder = recorder
        self._shows = recorder is not None and recorder.shows
        self._packets = packets
        self._places: list[tuple[int, int] | None] = [None] * scenario.rows
        self._headings = world.fleet.yaw.tolist()
        self._told = [NO_TELEMETRY] * scenario.rows
        self.rejections = RejectionCounters()

    def due(self) -> Iterable[Deed]:
        """Return what is to happen before the present slot: do each, and ``take`` it, in turn."""
        time_s = self.world.time_s
        if min(self.timeline.next_s, self.team.next_boot_s) > time_s + 1e-9:
            return ()
        return self._due(time_s)

    def _due(self, time_s: float) -> Iterator[Deed]:
        for action in self.timeline.due(time_s):
            yield self.deed(action)
        if self.team.next_boot_s <= time_s + 1e-9:
            yield self.team.booted(time_s)

    def deed(self, action: Action) -> Deed:
        """Find out whom an action means now; return what a clock has to do."""
        return deed_of(action, self.team, self.world, self._places, self._formation)

    def take(self, deed: Deed, **signed: str) -> None:
        """Let a deed count that was done: participants and world change, and it is told.

        signed: what its events say besides, of whose doing it was.
        """
        self._planned = {"planned": True, **signed}
        match deed:
            case Stop():
                self._stop(deed)
            case Hold():
                self.team.take(deed, self.world.time_s)
                self._tell(deed)
            case Fail():
                self._fail(deed)
            case Start():
                self._start(deed)
            case Begin():
                self.team.take(deed, self.world.time_s)
            case Change():
                self._change(deed)
            case Partition() | Heal() | Jamming() | Flapping():
                told = msgspec.to_builtins(deed._asdict())
                self.event(BARRIERS[type(deed)], None, **told, **self._planned)
            case Order():
                self._order(deed)

    @property
    def newest(self) -> int:
        """The highest key of a mission that an agent was heard to fly."""
        return max(told.mission for told in self._told)

    def open(self) -> Opened:
        """Begin the present slot; at a tick, judge and record it first."""
        world = self.world
        self.trace.poses(world.slot, world.fleet)
        if world.slot % world.clock.slots_per_tick == 0:
            self._show()
        slots, awake = world.clock.slots_per_tick, self.team.awake.tolist()
        group = [agent for agent in range(world.slot % slots, len(awake), slots) if awake[agent]]
        observations = list(zip(group, world.observe(group), strict=True)) if group else []
        for agent, observation in observations:
            self._headings[agent] = observation.yaw
        if self.orders.pending is not None:
            observations = [self._ordered(*each) for each in observations]
        return Opened(world.slot, world.time_s, self._radios(), observations)

    def obey(self, agent: int, command: Command, encoded: bytes) -> None:
        """Take one agent's command; under a barrier, in order of ids."""
        if self.world.obey(agent, command):
            self.trace.command(agent, encoded)
            told = command.telemetry
            self._told[agent] = told_by(told, self._headings[agent])
            self.radio_use.note(agent, len(told.heard))
            self.orders.heard(told.mission)
            self._watch_place(agent, told.place)
            if told.rejected:
                self.rejections.note(agent, command)

    def close(self, digest: bytes) -> None:
        """End the slot with the medium's digest: the vehicles fly through it."""
        self.trace.verdicts(digest)
        self.world.advance()

    def finish(self) -> None:
        """Show the last tick, at the end of the run."""
        if self.world.slot % self.world.clock.slots_per_tick == 0:
            self._show()

    def lost(self, agent: int, **details: Any) -> None:
        """Strike out an agent whose process is gone; its vehicle stops and hovers."""
        self.team.strike_out(agent)
        self.event("kill", agent, **details)

    def event(self, kind: str, agent: int | None, **details: Any) -> None:
        """Note an event now."""
        event = {"t_s": round(self.world.time_s, 6), "kind": kind, "agent": agent, **details}
        self.events.append(event)
        self.judge.note(event)
        if self._recorder is not None:
            self._recorder.event(event)

    def _stop(self, stop: Stop) -> None:
        self.team.take(stop, self.world.time_s)
        if stop.kind == "leave":
            for agent in stop.agents:
                self.world.leave(agent)
        self._tell(stop)

    def _tell(self, deed: Stop | Hold) -> None:
        for agent in deed.agents:
            self.event(deed.kind, agent, **self._planned)
        if not deed.agents:
            self.event(deed.kind, None, **self._planned, nobody=deed.selectors)

    def _fail(self, deed: Fail) -> None:
        told = {"sensor": deed.sensor or "all", "mode": deed.mode or "works again"}
        for agent in deed.agents:
            self.world.failures.set(agent, deed.sensor, deed.mode)
            self.event("sensor", agent, **told, **self._planned)

    def _start(self, start: Start) -> None:
        self.team.take(start, self.world.time_s)
        for agent, (position, yaw) in start.stands.items():
            self.world.enter(agent, position, yaw)
        for agent, incarnation in start.incarnations.items():
            self._told[agent], self._places[agent] = NO_TELEMETRY, None
            self.event(start.kind, agent, incarnation=incarnation, **self._planned)
        if not start.incarnations:
            refused = start.refused or "nobody to come back"
            self.event(start.kind, None, **self._planned, refused=refused)

    def _change(self, deed: Change) -> None:
        change = msgspec.to_builtins(deed.change)
        given = {"undone": change} if deed.undone else change
        conditions = msgspec.to_builtins(deed.conditions)
        self.event("netem", None, **given, **self._planned, conditions=conditions)

    def _order(self, order: Order) -> None:
        key = self.orders.issue(order, self.newest)
        self._formation = order.formation
        self.event(
            order.kind,
            self._addressee,
            formation=order.formation.name,
            mission=key,
            path=msgspec.to_builtins(order.path),
            **self._planned,
            tables=msgspec.to_builtins(order.formation),
        )

    @property
    def _addressee(self) -> int | None:
        """Whom a mission is given to: the one it was for, and if that one is gone the lowest id."""
        to = self.orders.to
        return to if to is not None and self.team.awake[to] else self.team.first

    def _ordered(self, agent: int, observation: Observation) -> tuple[int, Observation]:
        """Add the pending mission where its addressee looks."""
        mission = self.orders.pending
        if mission is None or agent != self._addressee:
            return agent, observation
        return agent, msgspec.structs.replace(observation, orders=(mission,))

    def _radios(self) -> tuple[Vector | None, ...]:
        positions = self.world.positions()
        if self.team.whole:
            return positions
        alive = self.team.alive.tolist()
        return tuple(where if here else None for where, here in zip(positions, alive, strict=True))

    def _watch_place(self, agent: int, now: tuple[int, int] | None) -> None:
        before = self._places[agent]
        if now == before:
            return
        self._places[agent] = now
        self.event("slot", agent, place=now, before=before)
        if before is None or now is None or before[0] != now[0]:
            self.event("queue", agent, queue=now[0] if now else None)
        if (before is not None and before[1] == 0) != (now is not None and now[1] == 0):
            self.event("role", agent, role="vertex" if now and now[1] == 0 else "member")

    def _show(self) -> None:
        awake = self.team.awake
        self.radio_use.tick(awake)
        tick = tick_of(self.world, self._told, awake, self._shows, self._packets())
        self.figures = self.judge.see(tick)
        if self._recorder is not None and self._shows:
            self._recorder.tick(tick, self.figures)
