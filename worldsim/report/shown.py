"""What the figures of a run show, as arrays: rows of ticks, columns of agents."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.guidance.cone import cone_of
from worldsim.judge.event_text import WARNINGS
from worldsim.judge.phase import Phase
from worldsim.judge.run_events import Joined, Left, LossEvent, Restarted, ReturnEvent
from worldsim.recording.layout import agent_name
from worldsim.report.style import FAULT_BAR, JOIN_BAR
from worldsim.results.run import Run
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.vehicle import Floats

SLACK_S = 1e-6
"""Times of events are rounded to the microsecond."""
SHORTEST_S = 0.25
"""A fault of less time is drawn as long as this [s]."""


JOIN = "join"
ABSENT, STARTING, DOWN, RUNNING = range(4)
"""What an agent is: without a vehicle in the world, or its process boots, is stopped, or runs."""


class Fault(NamedTuple):
    """A fault and when it was in force; or a join, until its agents run."""

    kind: str
    from_s: float
    to_s: float

    @property
    def colour(self) -> str:
        """The colour of its bar."""
        return JOIN_BAR if self.kind == JOIN else FAULT_BAR


class Shown:
    """A run as its figures need it."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.scenario = run.scenario
        self.judge = run.rejudged.judge
        self.agents = run.scenario.rows
        self.names = [agent_name(agent) for agent in range(self.agents)]
        self.obstacles = Obstacles(run.scenario.obstacle)
        self.times_s = np.array([tick.time_s for tick in run.ticks])
        """(T,) [s]"""
        self.position = self._rows([tick.position for tick in run.ticks], 3)
        """(T, N, 3) [m; world frame]"""
        self.force = self._rows([tick.force for tick in run.ticks])
        """(T, N)"""
        self.turn_deg = self._rows([tick.turn_deg for tick in run.ticks])
        """(T, N) [deg]"""
        figures = run.rejudged.figures
        self.separation = self._rows([each.separation for each in figures])
        """(T, N) [m]"""
        self.slot_error = self._rows([each.slot_error for each in figures])
        """(T, N) [m]"""
        near = [each.obstacle_distance for each in figures if each.obstacle_distance is not None]
        self.obstacle_distance = self._rows(near) if near else None
        """(T, N) [m]; None without obstacles"""
        cones = np.degrees([cone_of(vehicle) for vehicle in run.scenario.vehicles])
        self.turn_left_deg, self.turn_right_deg = cones.T
        """(N,): the limits of each vehicle [deg]"""
        self.faults = list(self._faults())
        changes = Joined | Left | Restarted
        self._changes = [each for each in run.run_events if isinstance(each, changes)]
        self.states = self._states()
        """(T, N): ABSENT, STARTING, DOWN or RUNNING"""
        self.changes = sorted([*self.faults, *self._joins()], key=lambda each: each.from_s)
        """Faults and joins, in the order in which they began."""

    @property
    def until_s(self) -> float:
        """Time of the last tick [s]."""
        return self.run.ended_s

    @property
    def phases(self) -> list[Phase]:
        """The formations asked for, in order."""
        return self.judge.phases

    @property
    def forms(self) -> bool:
        """Whether any agent claimed a place; a controller may form nothing."""
        return any((tick.place >= 0).any() for tick in self.run.ticks)

    def phase_at(self, time_s: float) -> Phase:
        """Return the formation that is asked for at a time [s]."""
        begun = [phase for phase in self.phases if phase.from_s <= time_s + 1e-9]
        return begun[-1] if begun else self.phases[0]

    def tick_at(self, time_s: float) -> int:
        """Return the index of the tick nearest to a time [s]."""
        return int(np.argmin(np.abs(self.times_s - time_s)))

    def members_at(self, time_s: float) -> NDArray[np.bool_]:
        """Return who belongs to the fleet at a time [s] (N,): who began with it or joined.

        An agent that left does not, until it is restarted. Rows that are spare never do.
        """
        member = np.arange(self.agents) < self.scenario.fleet.agents
        for event in self._changes:
            if event.agent is not None and event.t_s <= time_s + SLACK_S:
                member[event.agent] = not isinstance(event, Left)
        return member

    def _states(self) -> NDArray[np.int8]:
        """Return what each agent is at each tick: a process that nothing stopped is starting."""
        ticks = self.run.ticks
        down = np.zeros((len(ticks), self.agents), dtype=np.bool_)
        for event in self.run.run_events:
            if isinstance(event, LossEvent | ReturnEvent) and event.agent is not None:
                first = int(np.searchsorted(self.times_s, event.t_s - SLACK_S))
                down[first:, event.agent] = isinstance(event, LossEvent)
        alive = np.array([tick.alive for tick in ticks], dtype=np.bool_).reshape(down.shape)
        present = ~np.isnan(self.position).any(axis=2)
        chosen = (alive, ~present, down)
        states: NDArray[np.int8] = np.select(chosen, (RUNNING, ABSENT, DOWN), STARTING)
        return states.astype(np.int8)

    def _joins(self) -> Iterator[Fault]:
        """Yield the joins, those of one time as one, each until the last of its agents runs."""
        joined: dict[float, list[int]] = defaultdict(list)
        for event in self._changes:
            if isinstance(event, Joined) and event.agent is not None:
                joined[event.t_s].append(event.agent)
        for from_s, agents in joined.items():
            after = np.flatnonzero(self.times_s >= from_s - SLACK_S)
            runs = (self.states[after][:, agents] == RUNNING).all(axis=1)
            to_s = float(self.times_s[after[np.argmax(runs)]]) if runs.any() else self.until_s
            yield Fault(JOIN, from_s, max(to_s, from_s + SHORTEST_S))

    def _rows(self, each: Sequence[NDArray[Any]], width: int = 0) -> Floats:
        shape = (len(each), self.agents, *([width] if width else []))
        rows = np.array(each, dtype=np.float64) if each else np.zeros(shape)
        return rows.reshape(shape)

    def _faults(self) -> Iterator[Fault]:
        """Yield the faults with their spans; in an older recording, only when they struck."""
        known = self.run.figures.get("faults")
        if known is not None:
            for row in known.values():
                to_s, least_s = row.get("to_s"), row["from_s"] + SHORTEST_S
                yield Fault(row["kind"], row["from_s"], max(to_s or self.run.ended_s, least_s))
            return
        for event in self.run.run_events:
            if isinstance(event, WARNINGS):
                yield Fault(event.kind, event.t_s, event.t_s + SHORTEST_S)
