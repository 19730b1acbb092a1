"""Checks of a timeline: each event must be valid for the fleet that it meets.

The events are checked in order of their times, each against the fleet that the events before it
leave (``foreseen_fleet``).
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, assert_never

from agent.codec import encode_formation
from agent.messages import MAX_ORDER_B
from agent.qstructure.formation import Formation, FormationError, FormationSpec
from agent.qstructure.mission_check import MissionError, check_mission
from netem.faults import RadioFault
from netem.link_parameters import Conditions
from worldsim.scenario.agent_fault_checks import agent_fault_problem
from worldsim.scenario.clock_checks import ForeseenClocks
from worldsim.scenario.events import ACTIONS, UNDOABLE, EventTable
from worldsim.scenario.faults import (
    AgentFault,
    DiskFull,
    EndFault,
    FaultOfWorld,
    Join,
    Kill,
    Leave,
    MissionChange,
    Pause,
    ProcessFault,
    Restart,
    Resume,
    SabotageFault,
    SensorFault,
    StopWorld,
)
from worldsim.scenario.foreseen_fleet import FleetNow, ForeseenFleet
from worldsim.scenario.problem import Problem
from worldsim.scenario.radio_checks import radio_problems
from worldsim.scenario.rules import tilt_problem
from worldsim.scenario.selectors import (
    AGENTS,
    RETURNING,
    STOPPABLE,
    AllAgents,
    OneAgent,
    OtherProcess,
    QueueAgents,
    RandomAgents,
    Selector,
    SelectorError,
    Selectors,
    VertexAgent,
    parsed,
)
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.start_checks import start_problem
from worldsim.scenario.tables import MAX_AGENTS, Scenario
from worldsim.scenario.target_frame import (
    FrameChange,
    FrameTable,
    changed_frame,
    frame_problem,
    path_of,
)
from worldsim.scenario.timeline import Step, occurrences, steps
from worldsim.scenario.toml import ScenarioError

ONLY_TRUE = {"heal": "a partition stays", "disk_full": "the disk has room"}
"""Keys that are given or not, and what holds where they are not."""
MAX_REPETITIONS = 1000
"""An event happens at most so often."""
MAX_SLOTS_CHECKED = 50_000
"""Most slots of all formations, each filled by all agents, that a timeline may ask to check."""


class FormationSource(NamedTuple):
    """Where the keys of a formation are, for error messages."""

    file: Path
    prefix: str
    """The text before each key."""


def check_timeline(scenario: Scenario, file: Path, sources: dict[int, FormationSource]) -> None:
    """Raise ScenarioError for the first event that is not valid.

    sources: of formations that have files of their own, by the index of their event.
    """
    for index, event in enumerate(scenario.event):
        problem = _one_action(event) or _in_time(scenario, event)
        problem = problem or _named(scenario, index) or _end_problem(scenario, event)
        if problem is not None:
            raise _error(file, index, problem)
    if scenario.rows > MAX_AGENTS:
        raise ScenarioError(file, "event", f"{scenario.rows} agents in all; at most {MAX_AGENTS}")
    layouts = sum(event.formation is not None or event.joiners > 0 for event in scenario.event)
    if layouts * scenario.rows > MAX_SLOTS_CHECKED:
        detail = (
            f"{layouts} events change what {scenario.rows} agents form;"
            f" at most {MAX_SLOTS_CHECKED // scenario.rows} for so many"
        )
        raise ScenarioError(file, "event", detail)
    _check_count(scenario, file)
    checks = EventChecks(scenario, ForeseenFleet(scenario))
    index_of = {number: each.origin for number, each in occurrences(scenario).items()}
    clocks = ForeseenClocks(scenario.rows, scenario.duration_s)
    for step in steps(scenario):
        try:
            problem = next(checks.problems(step), None) or clocks.problem(step)
        except FormationError as error:
            index = index_of[step.number]
            default = FormationSource(file, f"event[{index}].formation.")
            source = sources.get(index, default)
            raise ScenarioError(source.file, source.prefix + error.key, error.detail) from error
        if problem is not None:
            raise _error(file, index_of[step.number], problem)
        checks.fleet.apply(step)


def _check_count(scenario: Scenario, file: Path) -> None:
    """Raise ScenarioError where events happen too often."""
    for index, event in enumerate(scenario.event):
        problem = _count_problem(scenario, event)
        if problem is not None:
            raise _error(file, index, problem)


def _count_problem(scenario: Scenario, event: EventTable) -> Problem | None:
    if event.every_s is None or scenario.duration_s / event.every_s <= MAX_REPETITIONS:
        return None
    return Problem("every_s", f"{event.every_s:g}; at most {MAX_REPETITIONS} times in a run")


def problem_now(scenario: Scenario, event: EventTable, now: FleetNow) -> Problem | None:
    """Return what makes an event invalid that happens now, or None."""
    problem = _one_action(event) or _count_problem(scenario, event)
    if problem is not None:
        return problem
    if event.joiners > now.room:
        return Problem("join", f"{event.joiners}; fleet.spare leaves room for {now.room}")
    checks = EventChecks(scenario, ForeseenFleet(scenario, now))
    try:
        return next(checks.problems(Step(event.at_s, 0, event, ends=False)), None)
    except FormationError as error:
        return Problem(f"formation.{error.key}", error.detail)


def _error(file: Path, index: int, problem: Problem) -> ScenarioError:
    key = f"event[{index}].{problem.key}" if problem.key else f"event[{index}]"
    return ScenarioError(file, key, problem.detail)


def _one_action(event: EventTable) -> Problem | None:
    if not event.keys:
        return Problem("", f"no action; one of {', '.join(ACTIONS)}")
    first, *others = event.keys
    if others:
        return Problem(others[0], f"not beside {first}; an event has one action")
    for key, without in ONLY_TRUE.items():
        if getattr(event, key) is False:
            return Problem(key, f"only true is allowed; {without} without an event")
    if event.netem == Conditions():
        return Problem("netem", "no key to set")
    return _times_problem(event, first)


def _times_problem(event: EventTable, action: str) -> Problem | None:
    """Return what is wrong with when an event ends, and happens again."""
    own = (("for_s", event.for_s), ("every_s", event.every_s), ("name", event.name))
    for key, value in own:
        if value is not None and action not in UNDOABLE:
            detail = f"{action} is not undone; {key} goes with {', '.join(UNDOABLE)}"
            return Problem(key, detail)
    if event.every_s is not None and event.every_s <= (event.for_s or 0.0):
        return Problem("every_s", f"{event.every_s:g}; must be longer than for_s = {event.for_s:g}")
    return None


def _in_time(scenario: Scenario, event: EventTable) -> Problem | None:
    if event.at_s < scenario.duration_s:
        return None
    return Problem("at_s", f"{event.at_s:g}; below duration_s = {scenario.duration_s:g} is allowed")


def _named(scenario: Scenario, index: int) -> Problem | None:
    """Return what is wrong with an event's name: another event has it."""
    event = scenario.event[index]
    if event.name is None:
        return None
    for other, each in enumerate(scenario.event):
        if other != index and each.keys and each.called(other) == event.name:
            return Problem("name", f"{event.name!r} is the name of event[{other}] too")
    return None


def _end_problem(scenario: Scenario, event: EventTable) -> Problem | None:
    """Return why an event cannot end the fault that it names."""
    if event.end is None:
        return None
    faults = {each.called(n): each for n, each in enumerate(scenario.event) if each.is_fault}
    fault = faults.get(event.end)
    if fault is None:
        return Problem("end", f"no fault {event.end!r}; there are {', '.join(faults) or 'none'}")
    if event.at_s <= fault.at_s:
        return Problem("end", f"{event.end!r} begins at {fault.at_s:g} s, not before that time")
    once = fault.every_s is None
    if once and fault.for_s is not None and event.at_s >= fault.at_s + fault.for_s:
        return Problem("end", f"{event.end!r} is over at {fault.at_s + fault.for_s:g} s")
    first = next(each for each in scenario.event if each.end == event.end)
    if first is not event:
        return Problem("end", f"{event.end!r} is ended by the event at {first.at_s:g} s already")
    return None


class EventChecks:
    """Checks steps against the fleet that they meet."""

    def __init__(self, scenario: Scenario, fleet: ForeseenFleet) -> None:
        self.fleet = fleet
        self._scenario = scenario

    def problems(self, step: Step) -> Iterator[Problem]:
        """Return what makes a step invalid. The iterator raises FormationError."""
        return iter(()) if step.ends else self._begin_problems(step.event)

    def _begin_problems(self, event: EventTable) -> Iterator[Problem]:
        action = event.action
        if isinstance(action, RadioFault):
            return self._radio(event)
        if isinstance(action, AgentFault):
            return self._agent_fault(event.kind, action, event.at_s)
        if isinstance(action, SabotageFault):
            return self._sabotage(event, action)
        return self._other_problems(event, action)

    def _other_problems(
        self,
        event: EventTable,
        action: ProcessFault | FaultOfWorld | SensorFault | MissionChange | EndFault,
    ) -> Iterator[Problem]:
        match action:
            case Kill() | Leave() | Pause() | Restart() | Resume() | SensorFault():
                return self._selection(event.kind, action)
            case Join():
                return self._join(action)
            case FrameChange():
                return self._frame_change(action, event.at_s)
            case FormationSpec():
                return self._formation(action)
            case StopWorld() | DiskFull() | EndFault():
                return _world_problems(event)
        assert_never(action)

    def _selection(
        self,
        kind: str,
        action: Kill | Leave | Pause | Restart | Resume | SensorFault,
    ) -> Iterator[Problem]:
        match action:
            case Kill() | Leave() | Pause():
                allowed = AGENTS if isinstance(action, Leave) else STOPPABLE
                return self._selectors(kind, action.selectors, allowed)
            case Restart() | Resume():
                return self._selectors(kind, action.selectors, RETURNING)
            case SensorFault():
                return self._selectors(f"{kind}.agents", action.agents)
        assert_never(action)

    def _sabotage(self, event: EventTable, fault: SabotageFault) -> Iterator[Problem]:
        yield from self._selectors("sabotage.agents", fault.agents)
        if fault.kind != "replay":
            return
        for_s, delay_s = event.for_s, fault.delay_s
        if for_s is not None and delay_s >= for_s:
            detail = f"{delay_s:g}; below for_s = {for_s:g}, or no frame is sent again before it"
            yield Problem("sabotage.delay_s", detail)
        left_s = self._scenario.duration_s - event.at_s
        if delay_s >= left_s:
            detail = f"{delay_s:g}; the run ends {left_s:g} s later: no frame would be sent again"
            yield Problem("sabotage.delay_s", detail)

    def _agent_fault(self, kind: str, fault: AgentFault, at_s: float) -> Iterator[Problem]:
        yield from self._selectors(f"{kind}.agents", fault.agents)
        broken = agent_fault_problem(fault, at_s, self._scenario.fleet.tick_hz)
        if broken is not None:
            yield broken.within(kind)

    def _radio(self, event: EventTable) -> Iterator[Problem]:
        if event.heal and not self.fleet.partitioned:
            yield Problem("heal", "no partition to heal at that time")
        yield from radio_problems(event, self._scenario.rows)

    def _selectors(
        self, key: str, selectors: Selectors, allowed: str = AGENTS
    ) -> Iterator[Problem]:
        """Check selectors; allowed: which are, in words."""
        for index, selector in enumerate(selectors):
            detail = self._selector(selector, allowed)
            if detail is not None:
                yield Problem(f"{key}[{index}]", detail)

    def _selector(self, selector: Selector, allowed: str) -> str | None:
        """Return what makes a selector invalid, or None."""
        hold_places = allowed != RETURNING
        try:
            kind = parsed(selector)
        except SelectorError:
            return _not_allowed(selector, allowed)
        match kind:
            case OneAgent(agent):
                known = 0 <= agent < self.fleet.id_count
                last = self.fleet.id_count - 1
                return None if known else f"no agent {agent}; 0 to {last} by then"
            case VertexAgent(name) if hold_places:
                return self._name("vertex", name, list(self.fleet.spec.vertices))
            case QueueAgents(name) if hold_places:
                return self._name("queue", name, [queue.name for queue in self.fleet.spec.queue])
            case VertexAgent() | QueueAgents():
                return _not_allowed(selector, allowed)
            case RandomAgents() | AllAgents() | OtherProcess():
                return _unplaced_problem(kind, self.fleet.id_count)
        assert_never(kind)

    def _name(self, kind: str, name: str, names: list[str]) -> str | None:
        if name in names:
            return None
        return f"no {kind} {name!r} in {self.fleet.spec.name!r}; there are {', '.join(names)}"

    def _join(self, join: Join) -> Iterator[Problem]:
        least_m = self._scenario.control.separation_m
        match join.start:
            case None:
                if isinstance(self._scenario.fleet.start, ListStart):
                    detail = "is missing; fleet.start lists no positions for more agents"
                    yield Problem("join.start", detail)
            case ListStart():
                yield from _listed(join.start, join.count)
            case BoxStart(spacing_m=spacing_m):
                if spacing_m < least_m:
                    detail = f"{spacing_m:g}; at least control.separation_m = {least_m:g}"
                    yield Problem("join.start.spacing_m", detail)
                outside = start_problem(join.start)
                if outside is not None:
                    yield outside.within("join.start")
            case _:
                assert_never(join.start)
        formation = self.fleet.formation
        try:
            formation.check(self.fleet.team + join.count, self._scenario.min_slot_distance_m)
        except FormationError as error:
            yield Problem("join", f"{formation.name!r} has no room for them: {error.detail}")

    def _frame_change(self, change: FrameChange, at_s: float) -> Iterator[Problem]:
        if not change.given:
            yield Problem("frame", "empty; yaw_deg, waypoints_m or both")
        for key in ("speed_mps", "start_s", "pauses_s"):
            if key in change.given and change.waypoints_m is None:
                yield Problem(f"frame.{key}", "needs waypoints_m: a new path, from there on")
        if change.start_s is not None and change.start_s < at_s:
            detail = f"{change.start_s:g}; the event's at_s = {at_s:g} or later"
            yield Problem("frame.start_s", detail)
        changed = changed_frame(self.fleet.frame, change, at_s)
        broken = frame_problem(changed)
        if broken is not None:
            yield Problem(f"frame.{broken.key}", broken.detail)
        yield from self._mission(self.fleet.formation, changed)
        size_b = len(encode_formation(self.fleet.spec))
        if size_b > MAX_ORDER_B:
            detail = f"the formation has {size_b} B; a mission holds at most {MAX_ORDER_B} B"
            yield Problem("frame", detail)

    def _formation(self, spec: FormationSpec) -> Iterator[Problem]:
        team, vertices = self.fleet.team, len(spec.vertices)
        if team < vertices:
            yield Problem("formation", f"{team} agents by then, for {vertices} vertices")
            return
        formation = self.fleet.made(spec)
        formation.check(team, self._scenario.min_slot_distance_m)
        yield from self._mission(formation, self.fleet.frame)
        size_b = len(encode_formation(spec))
        if size_b > MAX_ORDER_B:
            yield Problem("formation", f"{size_b} B; a mission holds at most {MAX_ORDER_B} B")
        tilted = tilt_problem(self._scenario, formation, team)
        if tilted is not None:
            yield Problem("formation", f"{tilted.key}: {tilted.detail}")

    def _mission(self, formation: Formation, frame: FrameTable) -> Iterator[Problem]:
        """Check a formation together with the path of its frame."""
        try:
            check_mission(
                formation,
                path_of(frame),
                self._scenario.rows,
                self._scenario.control.allocation,
            )
        except MissionError as error:
            yield Problem(error.key, error.detail)


def _unplaced_problem(kind: RandomAgents | AllAgents | OtherProcess, agents: int) -> str | None:
    """Return what is wrong with a selector that names no agent or place.

    It draws more agents than there are by then, or names a process of none among those of agents.
    """
    match kind:
        case RandomAgents(number) if number > agents:
            return f"{number} agents of the {agents} by then"
        case OtherProcess(name):
            return f"{name!r} is no agent; allowed alone, as kill or pause = [{name!r}]"
    return None


def _world_problems(event: EventTable) -> Iterator[Problem]:
    """Yield what makes a stop of the world invalid; nothing for other events."""
    if event.process != "world":
        return
    if event.kill is None:
        if event.for_s is None:
            yield Problem("pause", "'world' needs for_s: it cannot end its own pause")
        return
    for key, value in (("for_s", event.for_s), ("every_s", event.every_s)):
        if value is not None:
            yield Problem(key, "not with kill = ['world']: it ends the run")


def _not_allowed(selector: Selector, allowed: str) -> str:
    return f"got the text {selector!r}; allowed: {allowed}"


def _listed(start: ListStart, joiners: int) -> Iterator[Problem]:
    given = (("positions_m", start.positions_m), ("yaws_deg", start.yaws_deg))
    for name, values in given:
        if values is not None and len(values) != joiners:
            yield Problem(f"join.start.{name}", f"{len(values)} for {joiners} joining agents")
