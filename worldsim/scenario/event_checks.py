"""What must hold between the events of a timeline: each meets the fleet that those before it left.

A walk through the events in order of their times. Who will be there can be foretold but for
selectors that are resolved when they happen: of these, the number counts.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from agent.codec import encode_formation
from agent.messages import MAX_ORDER_B
from agent.qstructure.formation import Formation, FormationError, FormationSpec
from netem.link_keys import Conditions
from worldsim.scenario.events import ACTIONS, UNDONE, EventTable
from worldsim.scenario.faults import Join
from worldsim.scenario.problem import Problem
from worldsim.scenario.radio_checks import radio_findings
from worldsim.scenario.rules import tilt_problem
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.tables import MAX_AGENTS, Scenario
from worldsim.scenario.target_frame import FrameTable, changed_frame, frame_problem
from worldsim.scenario.timeline import Step, steps
from worldsim.scenario.toml import ScenarioError

COME_BACK = frozenset({"restart", "resume"})
"""Who comes back holds no place by which to be found."""
UNKNOWN_NUMBER = -1
"""Of a partition in force whose event is not known."""
_SELECTOR = re.compile(r"all|random:[1-9]\d{0,3}|(vertex|queue):(.+)", re.DOTALL)


class Whose(NamedTuple):
    """Whose keys a formation's are: the file, and what its keys begin with."""

    file: Path
    prefix: str


def check_course(scenario: Scenario, file: Path, whose: dict[int, Whose]) -> None:
    """Raise ScenarioError for the first event that cannot be; ``whose``: of formations in files."""
    for index, event in enumerate(scenario.event):
        broken = _one_action(event) or _in_time(scenario, event)
        if broken is not None:
            raise _error(file, index, broken)
    if scenario.rows > MAX_AGENTS:
        raise ScenarioError(file, "event", f"{scenario.rows} agents in all; at most {MAX_AGENTS}")
    course = _Course(scenario)
    for step in steps(scenario):
        try:
            broken = next(course.findings(step), None)
        except FormationError as error:
            own = whose.get(step.number, Whose(file, f"event[{step.number}].formation."))
            raise ScenarioError(own.file, own.prefix + error.key, error.detail) from error
        if broken is not None:
            raise _error(file, step.number, broken)
        course.take(step)


class Present(NamedTuple):
    """The fleet that an event meets which nobody foresaw.

    known: how many ids are given; living: who steps; room: for how many more there are rows.
    """

    formation: FormationSpec
    frame: FrameTable
    partitioned: bool
    known: int
    living: frozenset[int]
    room: int


def broken_now(scenario: Scenario, event: EventTable, present: Present) -> Problem | None:
    """Return what is wrong with an event that happens now, or None."""
    broken = _one_action(event)
    if broken is not None:
        return broken
    if event.joiners > present.room:
        return Problem("join", f"{event.joiners}; fleet.spare leaves room for {present.room}")
    course = _Course(scenario, present)
    try:
        return next(course.findings(Step(event.at_s, 0, event, ends=False)), None)
    except FormationError as error:
        return Problem(f"formation.{error.key}", error.detail)


def _error(file: Path, index: int, broken: Problem) -> ScenarioError:
    key = f"event[{index}].{broken.key}" if broken.key else f"event[{index}]"
    return ScenarioError(file, key, broken.detail)


def _one_action(event: EventTable) -> Problem | None:
    if not event.keys:
        return Problem("", f"no action; one of {', '.join(ACTIONS)}")
    first, *others = event.keys
    if others:
        return Problem(others[0], f"not beside {first}; one action an event")
    if event.heal is False:
        return Problem("heal", "true; a partition that holds needs no event")
    if event.netem == Conditions():
        return Problem("netem", "no key to set")
    if event.for_s is not None and first not in UNDONE:
        return Problem("for_s", f"{first} is not undone; for_s goes with {', '.join(UNDONE)}")
    return None


def _in_time(scenario: Scenario, event: EventTable) -> Problem | None:
    if event.at_s < scenario.duration_s:
        return None
    return Problem("at_s", f"{event.at_s:g}; before the end, duration_s = {scenario.duration_s:g}")


class _Course:
    """The fleet as it will be: who is there, in which formation, parted or not."""

    def __init__(self, scenario: Scenario, present: Present | None = None) -> None:
        agents = scenario.fleet.agents
        now = present or Present(
            scenario.formation, scenario.frame, False, agents, frozenset(range(agents)), 0
        )
        self._scenario = scenario
        self._spec = now.formation
        self._frame = now.frame
        self._formation = self._made(now.formation)
        self._known = now.known
        self._living = set(now.living)
        self._fewer = 0
        self._partitions = {UNKNOWN_NUMBER} if now.partitioned else set()

    def findings(self, step: Step) -> Iterator[Problem]:
        """Return what is wrong with a step. Raises FormationError."""
        event = step.event
        if step.ends:
            return
        yield from self._selectors(event)
        yield from self._radio(event)
        yield from self._join(event)
        yield from self._frame_change(event)
        if event.formation is not None:
            yield from self._new_formation(event.formation)

    def take(self, step: Step) -> None:
        """Let a sound step happen."""
        event = step.event
        if event.partition is not None:
            (self._partitions.discard if step.ends else self._partitions.add)(step.number)
        elif event.heal:
            self._partitions.clear()
        elif event.selectors:
            self._change_team(event, back=step.ends or event.kind in COME_BACK)
        elif event.frame is not None:
            self._frame = changed_frame(self._frame, event.frame, event.at_s)
        elif event.formation is not None:
            self._spec, self._formation = event.formation, self._made(event.formation)
        self._living.update(range(self._known, self._known + event.joiners))
        self._known += event.joiners

    @property
    def _team(self) -> int:
        return max(0, len(self._living) - self._fewer)

    def _change_team(self, event: EventTable, back: bool) -> None:
        for selector in event.selectors:
            if selector == "all":
                self._living, self._fewer = set(range(self._known)) if back else set(), 0
            elif isinstance(selector, int):
                (self._living.add if back else self._living.discard)(selector)
            else:
                some = self._some(selector)
                self._fewer = max(0, self._fewer + (-some if back else some))

    def _some(self, selector: str) -> int:
        """Return how many a selector means, in a formation as it should be."""
        word, _, name = selector.partition(":")
        if word == "random":
            return int(name)
        if word == "vertex":
            return 1
        index = [queue.name for queue in self._spec.queue].index(name)
        places = self._formation.layout(self._team).places
        return sum(index in self._formation.queues_of(place) for place in places)

    def _selectors(self, event: EventTable) -> Iterator[Problem]:
        sensor = event.sensor
        where = "sensor.agents" if sensor is not None else event.kind
        for index, selector in enumerate(sensor.agents if sensor is not None else event.selectors):
            detail = self._selector(selector, event.kind)
            if detail is not None:
                yield Problem(f"{where}[{index}]", detail)

    def _selector(self, selector: int | str, kind: str) -> str | None:
        """Say what is wrong with a selector."""
        if isinstance(selector, int):
            known = range(self._known)
            return None if selector in known else f"no agent {selector}; 0 to {known[-1]} by then"
        word, _, name = selector.partition(":")
        placeless = kind in COME_BACK
        if not _SELECTOR.fullmatch(selector) or (placeless and name and word != "random"):
            places = "" if placeless else " 'vertex:V1', 'queue:Q1',"
            return f"got the text {selector!r}; allowed: an id,{places} 'random:2' or 'all'"
        names = {"vertex": list(self._spec.vertices), "queue": [q.name for q in self._spec.queue]}
        if word in names and name not in names[word]:
            return f"no {word} {name!r} in {self._spec.name!r}; there are {', '.join(names[word])}"
        return None

    def _radio(self, event: EventTable) -> Iterator[Problem]:
        if event.heal and not self._partitions:
            yield Problem("heal", "no partition to heal at that time")
        yield from radio_findings(event, self._scenario.rows)

    def _join(self, event: EventTable) -> Iterator[Problem]:
        if not event.joiners:
            return
        start = event.join.start if isinstance(event.join, Join) else None
        least_m = self._scenario.control.separation_m
        if start is None and isinstance(self._scenario.fleet.start, ListStart):
            yield Problem("join.start", "is missing; fleet.start lists no places for more agents")
        if isinstance(start, ListStart):
            yield from _listed(start, event.joiners)
        if isinstance(start, BoxStart) and start.spacing_m < least_m:
            detail = f"{start.spacing_m:g}; at least control.separation_m = {least_m:g}"
            yield Problem("join.start.spacing_m", detail)
        try:
            self._formation.check(self._team + event.joiners, self._scenario.min_slot_distance_m)
        except FormationError as error:
            yield Problem("join", f"{self._formation.name!r} has no room for them: {error.detail}")

    def _frame_change(self, event: EventTable) -> Iterator[Problem]:
        change = event.frame
        if change is None:
            return
        if not change.given:
            yield Problem("frame", "empty; yaw_deg, waypoints_m or both")
        for key in ("speed_mps", "start_s", "pauses_s"):
            if key in change.given and change.waypoints_m is None:
                yield Problem(f"frame.{key}", "not without waypoints_m: a new path, from there on")
        if change.start_s is not None and change.start_s < event.at_s:
            detail = f"{change.start_s:g}; the event's at_s = {event.at_s:g} or later"
            yield Problem("frame.start_s", detail)
        broken = frame_problem(changed_frame(self._frame, change, event.at_s))
        if broken is not None:
            yield Problem(f"frame.{broken[0]}", broken[1])
        size_b = len(encode_formation(self._spec))
        if size_b > MAX_ORDER_B:
            yield Problem("frame", f"the formation has {size_b} B; a mission at most {MAX_ORDER_B}")

    def _new_formation(self, spec: FormationSpec) -> Iterator[Problem]:
        team, vertices = self._team, len(spec.vertices)
        if team < vertices:
            yield Problem("formation", f"{team} agents by then, for {vertices} vertices")
            return
        formation = self._made(spec)
        formation.check(team, self._scenario.min_slot_distance_m)
        size_b = len(encode_formation(spec))
        if size_b > MAX_ORDER_B:
            yield Problem("formation", f"{size_b} B as a mission; at most {MAX_ORDER_B} B")
        tilted = tilt_problem(self._scenario, formation, team)
        if tilted is not None:
            yield Problem("formation", f"{tilted.key}: {tilted.detail}")

    def _made(self, spec: FormationSpec) -> Formation:
        return Formation(spec, self._scenario.control.spacing_m)


def _listed(start: ListStart, joiners: int) -> Iterator[Problem]:
    given = (("positions_m", start.positions_m), ("yaws_deg", start.yaws_deg))
    for name, values in given:
        if values is not None and len(values) != joiners:
            yield Problem(f"join.start.{name}", f"{len(values)} for {joiners} that join")
