"""The recorder of a run: ticks, figures and events in, a rerun file out.

Ticks are collected and sent once per second of simulated time, one block for each entity. That
costs a tenth of sending them one by one, and loses at most that second when the process is killed.
Figures and drawings at a lower rate, which only viewers need, are sent every DETAIL_BLOCKS seconds.
"""

import json
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from agent.messages import ROLES, VERTEX, Believed, Observation, Report
from agent.qstructure.formation import Formation, FormationSpec
from worldsim.judge.event_text import WARNINGS, sentence
from worldsim.judge.run_events import (
    ControllerLogged,
    FormationGiven,
    FrameGiven,
    MissionRunEvent,
    QueueChanged,
    RoleChanged,
    RunEvent,
    as_row,
)
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures
from worldsim.recording import layout
from worldsim.recording.agent_colours import AgentColours
from worldsim.recording.belief_columns import BeliefColumns
from worldsim.recording.blueprint import blueprint_of
from worldsim.recording.columns import ColumnBlock, Entity, merged
from worldsim.recording.components import LOG_LEVELS, LOG_TEXTS, text_column
from worldsim.recording.controller_columns import ControllerColumns
from worldsim.recording.fault_columns import FaultColumns
from worldsim.recording.formation_entities import FormationEntities
from worldsim.recording.guidance_columns import GuidanceColumns
from worldsim.recording.hierarchy_columns import HierarchyColumns, ShownRoles
from worldsim.recording.obstacle_shapes import ObstacleEntities
from worldsim.recording.panels import (
    FORMING,
    QUESTIONS,
    UNJUDGED,
    agent_colours,
    panel,
    queue_colours,
    verdict,
)
from worldsim.recording.sensing_columns import SensingColumns
from worldsim.recording.situation import Situations
from worldsim.recording.state_columns import StateColumns
from worldsim.recording.static_entities import (
    half_sizes,
    max_queues,
    metric_limits,
    static_entities,
)
from worldsim.recording.team_view import TeamView
from worldsim.recording.tick_columns import TickColumns
from worldsim.recording.tolerant_sink import TolerantSink
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import path_of
from worldsim.truth.obstacles import Obstacles

APPLICATION = "qswarm"
BLOCK_S = 1.0
DETAIL_BLOCKS = 4
"""Whatever it holds, a block of an entity costs as much as a hundred numbers, or more."""
FLUSH_TIMEOUT_S = 5.0
EVENT_TIME_SLACK_S = 1e-6
"""Event times are rounded to the microsecond."""


def print_to_stderr(text: str) -> None:
    """Print what is wrong with a recording to stderr."""
    # Stderr may be a file on the same full disk: then nothing can be printed, and the run goes on.
    with suppress(OSError):
        print(f"recording: {text}", file=sys.stderr, flush=True)


class RunRecorder:
    """Records one run into a new file ``path``; ``run_id`` is its name in the viewer.

    A failure of the recording does not fail the run: the first one goes to ``report``, as one line,
    and nothing is recorded after it. The process must not fork after the recorder is made.

    mode: "processes", "lockstep" or "virtual".
    """

    records_ticks = True

    def __init__(
        self,
        path: Path,
        scenario: Scenario,
        run_id: str,
        *,
        mode: str,
        report: Callable[[str], None] = print_to_stderr,
    ) -> None:
        self._report = report
        self._working, self._opened = True, False
        self._sink: TolerantSink | None = None
        self._scenario = scenario
        tick_hz = scenario.fleet.tick_hz
        formation = self._formation_of(scenario.formation)
        forms = scenario.control.controller == FORMING
        self._colours = AgentColours(scenario.rows, formation, forms)
        radius_m = np.array([vehicle.radius_m for vehicle in scenario.vehicles])
        limits = metric_limits(scenario)
        self._tick_columns = TickColumns(self._colours, tick_hz, limits, radius_m)
        self._hierarchy_columns = HierarchyColumns(tick_hz, scenario.rows, max_queues(scenario))
        self._shown_roles = ShownRoles()
        self._situations = Situations(scenario.rows, scenario.netem)
        self._state_columns = StateColumns(tick_hz, scenario.rows, scenario.formation.name)
        self._fault_columns = FaultColumns(radius_m, half_sizes(scenario))
        self._obstacles = ObstacleEntities(Obstacles(scenario.obstacle))
        self._guidance = GuidanceColumns(scenario) if forms else None
        self._sensing = SensingColumns(scenario)
        self._beliefs = BeliefColumns(scenario.rows)
        self._controllers = ControllerColumns(scenario.rows, self._colours)
        self._team_view = TeamView(1.0 / tick_hz)
        self._ticks_per_block = max(1, round(tick_hz * BLOCK_S))
        self._blocks_sent = 0
        self._shown_signals: tuple[str, ...] = ()
        self._seen: list[tuple[Tick, Figures]] = []
        """The ticks whose detail is yet to be sent."""
        self._ticks: list[Tick] = []
        self._figures: list[Figures] = []
        self._events: list[RunEvent] = []
        self._queue_names = [queue.name for queue in scenario.formation.queue]
        self._spec = scenario.formation
        self._legend: str | None = None
        self._attempt(self._open, path, formation, run_id, mode)

    def tick(self, tick: Tick, figures: Figures) -> None:
        """Record one tick."""
        self._ticks.append(self._shown_roles.of(tick))
        self._figures.append(figures)
        if len(self._ticks) >= self._ticks_per_block:
            self._attempt(self._send_block)

    def observe(self, observations: Sequence[tuple[int, Observation]]) -> None:
        """Record what some agents observe."""
        if self._working:
            self._sensing.observe(observations)

    def believe(self, agent: int, slot: int, believed: Believed) -> None:
        """Record where an agent takes its neighbours to be at a slot."""
        if self._working:
            self._beliefs.keep(agent, slot, believed)

    def report(self, agent: int, slot: int, report: Report) -> None:
        """Record what an agent's controller tells at a slot."""
        if self._working:
            self._controllers.keep(agent, slot, report)

    def event(self, event: RunEvent) -> None:
        """Record one event."""
        self._events.append(event)

    def fill_disk(self, full: bool) -> None:
        """Let the file's disk be full, or no longer; what has been recorded is written before."""
        if self._opened and self._sink is not None:
            self._attempt(self._send_block)
            self._sink.fill(full)

    @property
    def failed_writes(self) -> int:
        """Number of writes that failed so far; of the last ones once the recorder is closed."""
        return self._sink.failed_writes if self._sink is not None else 0

    def close(self, found: Sequence[str] = ()) -> None:
        """Record what is left and the verdict, and finish the file.

        found: what the run showed of each expectation; none where it was not judged to its end.
        """
        self._attempt(self._send_block)
        self._attempt(self._send_detail)
        if found:
            self._attempt(self._log_verdict, verdict(found))
        # Also after a failure: what was recorded before it is then a complete file.
        self._working = self._opened
        self._attempt(self._finish)
        self._working = self._opened = False

    def _attempt(self, operation: Callable[..., None], *arguments: Any) -> None:
        """Carry out an operation of the recording, and keep its failure from the run."""
        if self._working:
            try:
                operation(*arguments)
            except Exception as error:
                self._working = False
                self._report(f"it ends here, the run continues: {error}")
        self._ticks, self._figures, self._events = [], [], []

    def _open(self, path: Path, formation: Formation, run_id: str, mode: str) -> None:
        rr.set_strict_mode(True)
        self._sink = sink = TolerantSink(path, self._report)
        frame = path_of(self._scenario.frame)
        self._formation = FormationEntities(formation, frame)
        # No recording id is given: a viewer takes recordings with the same id for one.
        self._stream = rr.RecordingStream(
            APPLICATION, batcher_config=rr.ChunkBatcherConfig(flush_tick=1.0)
        )
        blueprint = blueprint_of(self._scenario)
        self._stream.set_sinks(rr.FileSink(sink.path), default_blueprint=blueprint)
        sink.release()
        self._opened = True
        rr.set_log_time_enabled(False, recording=self._stream)
        rr.set_log_tick_enabled(False, recording=self._stream)
        self._send_properties(run_id, mode)
        for entity in (*static_entities(self._scenario), *self._obstacles.static()):
            self._stream.log(entity.path, entity.archetype, static=True)
        self._log_verdict(UNJUDGED)
        self._flush()

    def _log_verdict(self, text: str) -> None:
        self._stream.log(layout.VERDICT, _document(text), static=True)

    def _send_properties(self, run_id: str, mode: str) -> None:
        scenario = self._scenario
        properties = rr.AnyValues(
            scenario=scenario.name, seed=scenario.seed, mode=mode, agents=scenario.fleet.agents
        )
        self._stream.send_recording_name(run_id)
        self._stream.send_property("run", properties)

    def _send_block(self) -> None:
        for each in self._events:
            self._situations.handle_event(each)
        for event in self._missions_given():
            self._colours.begin_phase(self._formation_of(event.tables), event.mission)
            self._state_columns.begin_phase(event.formation)
        if self._ticks:
            self._send(self._ticks, self._blocks())
            self._seen.extend(zip(self._ticks, self._figures, strict=True))
        self._show_signals()
        self._log_formation()
        if self._events:
            self._send_events()
        self._blocks_sent += 1
        if self._blocks_sent % DETAIL_BLOCKS == 0:
            self._send_detail()
        self._flush()

    def _show_signals(self) -> None:
        """Give each signal a plot of its own, once its name is known."""
        known = tuple(self._controllers.known)
        if known != self._shown_signals:
            self._shown_signals = known
            self._stream.send_blueprint(blueprint_of(self._scenario, known))

    def _send(self, ticks: Sequence[Tick], blocks: Iterator[ColumnBlock]) -> None:
        times = _BlockTimes(ticks)
        # All blocks are made before any is sent, so that a failure leaves no partial second.
        for block in merged(blocks):
            at = times.columns(block.rows)
            rr.send_columns(block.entity, at, block.columns, recording=self._stream)

    def _send_detail(self) -> None:
        if self._seen:
            ticks = [tick for tick, _ in self._seen]
            self._send(ticks, self._detail(ticks, [figures for _, figures in self._seen]))
            self._seen = []

    def _detail(self, ticks: Sequence[Tick], figures: Sequence[Figures]) -> Iterator[ColumnBlock]:
        yield from self._tick_columns.detail(ticks, figures)
        yield from self._hierarchy_columns.figures(ticks, figures)
        yield from self._state_columns.connectivity(ticks)
        if self._guidance is not None:
            yield from self._guidance.blocks(ticks)
        yield from self._sensing.blocks(ticks)
        yield from self._beliefs.blocks(ticks)
        yield from self._controllers.datagrams(ticks)

    def _blocks(self) -> Iterator[ColumnBlock]:
        situations = [self._situations.at(tick) for tick in self._ticks]
        yield from self._tick_columns.blocks(self._ticks, self._figures, situations)
        yield from self._hierarchy_columns.blocks(self._ticks, situations)
        yield from self._state_columns.blocks(self._ticks, self._figures, situations)
        yield from self._fault_columns.blocks(self._ticks, situations)
        yield from self._obstacles.blocks(self._ticks)
        yield from self._team_view.blocks(self._ticks)
        yield from self._controllers.signals(self._ticks)

    def _log_formation(self) -> None:
        """Log the formation's changes and the frame's motion, in the order of time."""
        given = deque(self._missions_given())
        for tick in self._ticks[:1]:
            self._log_at(tick.time_s, tick.index, self._new_panels())
        for tick in self._ticks:
            while given and given[0].t_s <= tick.time_s + EVENT_TIME_SLACK_S:
                self._log_new_phase(given.popleft())
            self._log_at(tick.time_s, tick.index, self._formation.see(tick))
        for event in given:
            self._log_new_phase(event)

    def _missions_given(self) -> list[MissionRunEvent]:
        """Return the missions given in the present block."""
        return [e for e in self._events if isinstance(e, FormationGiven | FrameGiven)]

    def _log_new_phase(self, event: MissionRunEvent) -> None:
        """Log the formation and frame of a new mission, at the time of its event."""
        formation = self._formation_of(event.tables)
        changed = self._formation.begin_phase(formation, event.path, event.mission, event.t_s)
        self._log_at(event.t_s, self._tick_at(event.t_s), changed)
        self._spec = event.tables
        self._log_at(event.t_s, self._tick_at(event.t_s), self._new_panels())

    def _new_panels(self) -> Iterator[Entity]:
        """Yield the panels of words, where the meaning of the colours has changed."""
        names = [queue.name for queue in self._spec.queue]
        forms = self._colours.forms
        colours = queue_colours(self._spec.name, names) if forms else agent_colours()
        if colours != self._legend:
            self._legend = colours
            for question in QUESTIONS:
                text = panel(question, self._scenario, colours)
                yield Entity(layout.panel_entity(question), _document(text))

    def _log_at(self, time_s: float, tick: int, entities: Iterator[Entity]) -> None:
        for at, entity in enumerate(entities):
            if at == 0:
                self._stream.set_time(layout.SIM_TIME, duration=time_s)
                self._stream.set_time(layout.TICK, sequence=tick)
            self._stream.log(entity.path, entity.archetype)

    def _send_events(self) -> None:
        times_s = [event.t_s for event in self._events]
        texts = [self._text(event) for event in self._events]
        levels = [_level(event) for event in self._events]
        columns = [
            LOG_TEXTS.rows(texts),
            LOG_LEVELS.rows(levels),
            text_column(layout.EVENT, [json.dumps(as_row(event)) for event in self._events]),
        ]
        at = _time_columns(times_s, [self._tick_at(time_s) for time_s in times_s])
        rr.send_columns(layout.EVENTS, at, columns, recording=self._stream)

    def _text(self, event: RunEvent) -> str:
        """Return an event as its time and a sentence, with the queues' names at its time."""
        if isinstance(event, FormationGiven | FrameGiven):
            self._queue_names = [queue.name for queue in event.tables.queue]
        return f"{event.t_s:.2f} s  {sentence(event, self._queue_names)}"

    def _tick_at(self, time_s: float) -> int:
        return int(time_s * self._scenario.fleet.tick_hz + 1e-6)

    def _formation_of(self, spec: FormationSpec) -> Formation:
        return Formation(spec, self._scenario.control.spacing_m)

    def _flush(self) -> None:
        self._stream.flush(timeout_sec=FLUSH_TIMEOUT_S)

    def _finish(self) -> None:
        self._stream.disconnect()
        if self._sink is not None:
            self._sink.wait()


def _level(event: RunEvent) -> str:
    """Return the level at which an event is listed.

    A change of queue comes with the slot in it, and roles have a timeline of their own: both are
    hidden until asked for, but for an agent that begins to lead.
    """
    if isinstance(event, WARNINGS):
        return "WARN"
    if isinstance(event, RoleChanged):
        return "INFO" if event.role == ROLES[VERTEX] else "DEBUG"
    return "DEBUG" if isinstance(event, QueueChanged | ControllerLogged) else "INFO"


def _document(text: str) -> rr.TextDocument:
    return rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)


class _BlockTimes:
    """The times of a block's ticks as rerun's columns; blocks with the same rows share them."""

    def __init__(self, ticks: Sequence[Tick]) -> None:
        self._ticks = ticks
        self._made: dict[tuple[int, ...], list[rr.TimeColumn]] = {(): []}

    def columns(self, rows: Sequence[int]) -> list[rr.TimeColumn]:
        """Return the times of some rows; no columns for no rows, which rerun takes as static."""
        key = tuple(rows)
        if key not in self._made:
            ticks = [self._ticks[row] for row in rows]
            self._made[key] = _time_columns([t.time_s for t in ticks], [t.index for t in ticks])
        return self._made[key]


def _time_columns(times_s: list[float], ticks: list[int]) -> list[rr.TimeColumn]:
    since_start = np.rint(np.array(times_s) * 1e9).astype("timedelta64[ns]")
    return [
        rr.TimeColumn(layout.SIM_TIME, duration=since_start),
        rr.TimeColumn(layout.TICK, sequence=np.array(ticks, dtype=np.int64)),
    ]
