"""What a flight shows, stage by stage, seen as a recorder sees it: ticks and events.

A stage begins at the start, with a mission, when the team or a partition changes, and when the
target's frame comes to rest. It converges when the running agents hold exactly the places of the
layout for their number, each within 0.12 m of its own, for 2 s.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any, assert_never

import numpy as np

from agent.messages import Believed, FramePath, Observation, Place
from agent.qstructure.formation import formation_of
from agent.qstructure.frame_path import ends_s
from tests.structure_figures.bound import arrival_bound_s
from worldsim.judge.hovering_vehicles import HoveringVehicles
from worldsim.judge.phase import ConvergenceTimer, Phase
from worldsim.judge.radio_events import Healed, Partitioned, RadioRunEvent
from worldsim.judge.run_events import (
    ControllerLogged,
    FormationGiven,
    FrameGiven,
    Joined,
    Killed,
    LateStart,
    Left,
    MissionRunEvent,
    Paused,
    QueueChanged,
    Restarted,
    Resumed,
    RoleChanged,
    RunEvent,
    SensorChanged,
    SlotChanged,
)
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import path_of

QUIET_S = 60.0
"""For so long after its convergence a team is to keep its places [s]."""
PARTED = "parted"
"""The stage of a partition: no component is the whole team, so only changes are measured."""


@dataclass
class Stage:
    """A part of a flight, from one change to the next."""

    name: str
    from_s: float
    bound_s: float | None = None
    timer: ConvergenceTimer = field(default_factory=ConvergenceTimer)
    moves: list[tuple[float, int]] = field(default_factory=list)
    """When an agent changed its place after its first claim [s; simulated time], and which."""
    out_of_place_s: list[float] = field(default_factory=list)
    """The ticks at which the team was not in its places [s; simulated time]."""

    def figures(self, until_s: float, agents: int, tick_s: float) -> dict[str, Any]:
        """Return what a stage that ended ``until_s`` [s; simulated time] showed."""
        at_s = self.timer.converged_s
        quiet_until_s = until_s if at_s is None else min(until_s, at_s + QUIET_S)
        before = Counter(agent for time_s, agent in self.moves if at_s is None or time_s <= at_s)
        after = 0.0 if at_s is None else at_s
        away = [each for each in self.out_of_place_s if after < each <= quiet_until_s]
        late = [time_s for time_s, _ in self.moves if after < time_s <= quiet_until_s]
        return {
            "stage": self.name,
            "forms": self.name != PARTED,
            "from_s": self.from_s,
            "converge_s": None if at_s is None else round(at_s - self.from_s, 6),
            "bound_s": self.bound_s,
            "changes_mean": before.total() / agents,
            "changes_most": max(before.values(), default=0),
            "changes_after": 0 if at_s is None else len(late),
            "quiet_s": 0.0 if at_s is None else round(quiet_until_s - at_s, 6),
            "away_s": 0.0 if at_s is None else round(len(away) * tick_s, 6),
        }


class Watcher:
    """Watches a flight; ``done`` once its last stage has been quiet for QUIET_S."""

    records_ticks = True

    def __init__(self, scenario: Scenario) -> None:
        self._spacing_m = scenario.control.spacing_m
        self._tick_s = 1.0 / scenario.fleet.tick_hz
        self._speeds = np.array([each.max_speed_mps for each in scenario.vehicles])
        self._hovering = HoveringVehicles(self._spacing_m)
        self._places: dict[int, tuple[int, int]] = {}
        """The place that each agent claimed last."""
        self._awaited = set(range(scenario.fleet.agents))
        """The agents that run, or are booting."""
        self._planned_s = max(
            (each.at_s + (each.for_s or 0.0) for each in scenario.event), default=0.0
        )
        self._stages: list[tuple[Stage, int]] = []
        """Each stage, and the size of its team."""
        self._time_s = 0.0
        self.done = False
        formation = formation_of(scenario.formation, self._spacing_m)
        path = path_of(scenario.frame)
        self._phase, self._frame_rests_s = Phase(formation, 0.0, path), ends_s(path)
        self._open("form", 0.0)

    def observe(self, observations: Sequence[tuple[int, Observation]]) -> None:
        """What agents observe is not looked at."""

    def believe(self, agent: int, slot: int, believed: Believed) -> None:
        """What agents believe is not looked at."""

    def event(self, event: RunEvent) -> None:
        """Take an event, before the tick of its time."""
        if isinstance(event, RadioRunEvent):
            if isinstance(event, Healed | Partitioned):
                self._open(PARTED if isinstance(event, Partitioned) else "heal", event.t_s)
            return
        match event:
            case FormationGiven() | FrameGiven():
                self._begin_phase(event)
            case Killed() | Left() | Paused():
                self._change_team(event.kind, event.t_s, event.agent, runs=False)
            case Restarted() | Joined() | Resumed():
                self._change_team(event.kind, event.t_s, event.agent, runs=True)
            case SlotChanged():
                self._note_move(event)
            case (
                SensorChanged() | QueueChanged() | RoleChanged() | LateStart() | ControllerLogged()
            ):
                pass
            case _:
                assert_never(event)

    def tick(self, tick: Tick, figures: Figures) -> None:
        """Take a tick, in order."""
        self._time_s = tick.time_s
        self._hovering.see(tick)
        if -inf < self._frame_rests_s <= tick.time_s:
            self._open("frame at rest", self._frame_rests_s)
            self._frame_rests_s = -inf
        stage, _ = self._stages[-1]
        if stage.name == PARTED:
            return
        complete = bool(tick.alive[list(self._awaited)].all())
        if stage.bound_s is None and complete:
            stage.bound_s = self._bound_s(tick, stage.from_s)
        in_place = figures.converged and complete and self._holds_layout(tick)
        stage.timer.see(tick.time_s, in_place)
        if not in_place:
            stage.out_of_place_s.append(tick.time_s)
        self.done = self._is_done(stage)

    def stages(self) -> list[dict[str, Any]]:
        """Return the figures of each stage."""
        ends = [stage.from_s for stage, _ in self._stages[1:]] + [self._time_s]
        return [
            stage.figures(until_s, agents, self._tick_s)
            for (stage, agents), until_s in zip(self._stages, ends, strict=True)
        ]

    def _is_done(self, stage: Stage) -> bool:
        changes = self._time_s <= self._planned_s or self._frame_rests_s > -inf
        at_s = stage.timer.converged_s
        return not changes and at_s is not None and self._time_s >= at_s + QUIET_S

    def _open(self, name: str, from_s: float) -> None:
        """Open a stage; changes of one time are one stage."""
        if self._stages and self._stages[-1][0].from_s == from_s:
            self._stages.pop()
        self._stages.append((Stage(name, from_s), len(self._awaited)))

    def _begin_phase(self, event: MissionRunEvent) -> None:
        formation = formation_of(event.tables, self._spacing_m)
        self._phase = Phase(formation, event.t_s, event.path, event.mission)
        self._frame_rests_s = _after(event.path, event.t_s)
        self._open(event.kind, event.t_s)

    def _change_team(self, kind: str, t_s: float, agent: int | None, *, runs: bool) -> None:
        if agent is None:
            return
        if runs:
            self._awaited.add(agent)
        else:
            self._awaited.discard(agent)
            self._places.pop(agent, None)
        self._open(kind, t_s)

    def _note_move(self, event: SlotChanged) -> None:
        if event.place is None or event.agent is None:
            return
        last = self._places.get(event.agent)
        self._places[event.agent] = event.place
        if last not in (None, event.place):
            self._stages[-1][0].moves.append((event.t_s, event.agent))

    def _holds_layout(self, tick: Tick) -> bool:
        claims = {Place(*claim) for claim in self._phase.claims(tick) if claim[0] >= 0}
        team = np.flatnonzero(tick.alive).tolist()
        return claims == set(self._hovering.layout(tick, self._phase, team).places)

    def _bound_s(self, tick: Tick, from_s: float) -> float | None:
        """Return the bound of a stage, from its start; None for a frame that moves."""
        frame = self._phase.frame(tick.time_s)
        if frame.moves:
            return None
        team = np.flatnonzero(tick.alive).tolist()
        layout = self._hovering.layout(tick, self._phase, team)
        if layout.unplaced:
            return None
        slots = np.array([frame.to_world(slot.point) for slot in layout.slots.values()])
        bound_s = arrival_bound_s(tick.position[team], slots, self._speeds[team])
        return tick.time_s - from_s + bound_s


def _after(path: FramePath, time_s: float) -> float:
    """Return when a frame comes to rest [s]; -inf where it has by ``time_s``."""
    rests_s = ends_s(path)
    return rests_s if rests_s > time_s else -inf
