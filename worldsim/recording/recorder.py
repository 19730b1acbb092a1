"""The recording of a run: rows of truth in, a rerun file out. Only this file writes with rerun.

Ticks are gathered and sent once a second of simulated time, each entity in one piece: that costs
a tenth of sending them one by one, and loses at most that second when the process is killed.
"""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import rerun as rr

from agent.messages import FramePath
from agent.qstructure.formation import Formation, FormationSpec
from agent.qstructure.frame_path import Track
from worldsim.judge.run_events import RunEvent, as_row
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures
from worldsim.recording import layout
from worldsim.recording.blueprint import blueprint_of, stage_of
from worldsim.recording.columns import ColumnBlock
from worldsim.recording.hierarchy_columns import StandingSheets
from worldsim.recording.obstacle_shapes import Shapes
from worldsim.recording.static_entities import Scenery, limits, queues_of
from worldsim.recording.tick_columns import TickColumns
from worldsim.recording.tolerant_sink import TolerantSink
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import path_of
from worldsim.truth.obstacles import Obstacles

Event = dict[str, Any]
FLUSH_S = 5.0
UNSPOKEN = frozenset({"t_s", "kind", "agent", "tables", "conditions", "path"})
_ENCODER = json.JSONEncoder(default=str)
WARNINGS = frozenset({"kill", "leave", "pause", "partition", "jam", "late"})


def complain(text: str) -> None:
    """Say what is wrong with a recording, where a person sees it."""
    # Where stderr is a file on the same full disk nobody can be told; the flight goes on.
    with suppress(OSError):
        print(f"recording: {text}", file=sys.stderr, flush=True)


class RunRecorder:
    """Records one run into a new file ``path``; ``run_id`` is its name in the viewer.

    It never fails the run: its first trouble goes to ``say``, and from then on it keeps nothing.
    The process must not fork after this. mode: "processes", "lockstep" or "virtual".
    """

    shows = True

    def __init__(
        self,
        path: Path,
        scenario: Scenario,
        run_id: str,
        *,
        mode: str,
        say: Callable[[str], None] = complain,
    ) -> None:
        self._say = say
        self._working, self._opened = True, False
        self._scenario = scenario
        self._formation = Formation(scenario.formation, scenario.control.spacing_m)
        shared = np.array(self._formation.common, dtype=np.int16).reshape(-1, 2)
        self._sheets = TickColumns(shared, scenario.fleet.tick_hz, limits(scenario))
        self._standings = StandingSheets(scenario.fleet.tick_hz, scenario.rows, queues_of(scenario))
        self._shapes = Shapes(Obstacles(scenario.obstacle))
        self._team = scenario.fleet.agents
        self._every = max(1, round(scenario.fleet.tick_hz))
        self._ticks: list[Tick] = []
        self._figures: list[Figures] = []
        self._events: list[Event] = []
        self._guarded(self._open, path, run_id, mode)

    def tick(self, tick: Tick, figures: Figures) -> None:
        """Keep one tick."""
        self._ticks.append(tick)
        self._figures.append(figures)
        if len(self._ticks) >= self._every:
            self._guarded(self._flush)

    def event(self, event: RunEvent) -> None:
        """Keep one event: ``t_s``, ``kind``, ``agent`` and what else belongs to the kind."""
        self._events.append(as_row(event))

    def close(self) -> None:
        """Keep what is left, and end the file."""
        self._guarded(self._flush)
        # What was kept before a failure is ended like any other file: somebody will read it.
        self._working = self._opened
        self._guarded(self._end)
        self._working = self._opened = False

    def _guarded(self, action: Callable[..., None], *details: Any) -> None:
        """Do something for the recording; whatever it meets must not reach the run."""
        if self._working:
            try:
                action(*details)
            except Exception as error:
                self._working = False
                self._say(f"it ends here, the run goes on: {error}")
        self._ticks, self._figures, self._events = [], [], []

    def _open(self, path: Path, run_id: str, mode: str) -> None:
        rr.set_strict_mode(True)
        self._spool = TolerantSink(path, self._say)
        self._track = Track(path_of(self._scenario.frame))
        scenery = Scenery(
            self._scenario,
            self._formation,
            self._scenario.fleet.agents,
            self._track.at(0.0),
        )
        self._scenery = scenery
        # Without an id of our own: a viewer takes two recordings of one id for one.
        self._stream = rr.RecordingStream(
            "qswarm",
            batcher_config=rr.ChunkBatcherConfig(flush_tick=1.0),
        )
        self._stream.set_sinks(
            rr.FileSink(self._spool.path),
            default_blueprint=blueprint_of(
                stage_of(self._scenario, scenery.slots), bool(self._scenario.obstacle)
            ),
        )
        self._spool.opened()
        self._opened = True
        rr.set_log_time_enabled(False, recording=self._stream)
        rr.set_log_tick_enabled(False, recording=self._stream)
        self._stream.send_recording_name(run_id)
        self._stream.send_property(
            "run",
            rr.AnyValues(
                scenario=self._scenario.name,
                seed=self._scenario.seed,
                mode=mode,
                agents=self._scenario.fleet.agents,
            ),
        )
        self._lay_out(scenery)

    def _lay_out(self, scenery: Scenery) -> None:
        for entity, parts in (*scenery.lasting(), *self._shapes.lasting()):
            self._stream.log(entity, *parts, static=True)
        self._stream.set_time(layout.SIM_TIME, duration=0.0)
        self._stream.set_time(layout.TICK, sequence=0)
        for entity, part in scenery.formation():
            self._stream.log(entity, part)
        self._stream.flush(timeout_sec=FLUSH_S)

    def _flush(self) -> None:
        if self._ticks:
            self._team = int(np.count_nonzero(self._ticks[-1].alive))
            times = _Times(self._ticks)
            # All are made before any is sent: rows that do not fit leave no half a second behind.
            for sheet in tuple(self._sheets_of(self._ticks, self._figures)):
                at = times.of(sheet.rows)
                rr.send_columns(sheet.entity, at, sheet.columns, recording=self._stream)
        if not self._track.rests:
            self._move_slots()
        if self._events:
            self._send_events()
        for event in self._events:
            if "tables" in event:
                self._show_phase(event)
        self._stream.flush(timeout_sec=FLUSH_S)

    def _sheets_of(self, ticks: list[Tick], figures: list[Figures]) -> Iterator[ColumnBlock]:
        yield from self._sheets.of(ticks, figures)
        yield from self._standings.of(ticks, figures)
        yield from self._shapes.sheets(ticks)

    def _move_slots(self) -> None:
        """Show where the slots of a frame under way are, tick by tick."""
        for tick in self._ticks:
            self._stream.set_time(layout.SIM_TIME, duration=tick.time_s)
            self._stream.set_time(layout.TICK, sequence=tick.index)
            self._stream.log(layout.SLOTS, self._scenery.slots_in(self._track.at(tick.time_s)))

    def _show_phase(self, event: Event) -> None:
        """Draw the formation that a mission asks for, from its time on."""
        spec = msgspec.convert(event["tables"], FormationSpec)
        formation = Formation(spec, self._scenario.control.spacing_m)
        self._track = Track(msgspec.convert(event["path"], FramePath))
        here = self._track.at(event["t_s"])
        self._scenery = scenery = Scenery(self._scenario, formation, self._team, here)
        self._stream.set_time(layout.SIM_TIME, duration=event["t_s"])
        self._stream.set_time(layout.TICK, sequence=self._tick_at(event["t_s"]))
        for entity, part in scenery.formation():
            self._stream.log(entity, part)

    def _send_events(self) -> None:
        times = [float(event["t_s"]) for event in self._events]
        ticks = [self._tick_at(t) for t in times]
        told = [_ENCODER.encode(event) for event in self._events]
        columns = [
            *rr.TextLog.columns(
                text=[sentence(event) for event in self._events],
                level=["WARN" if event["kind"] in WARNINGS else "INFO" for event in self._events],
            ),
            *rr.AnyValues.columns(event=told),
        ]
        rr.send_columns(layout.EVENTS, _indexes(times, ticks), columns, recording=self._stream)

    def _tick_at(self, time_s: float) -> int:
        return int(time_s * self._scenario.fleet.tick_hz + 1e-6)

    def _end(self) -> None:
        self._stream.disconnect()
        self._spool.wait()


def sentence(event: Event) -> str:
    """Return an event as a person reads it: its kind, the agent, and the rest as it stands."""
    agent = "" if event.get("agent") is None else f" a{event['agent']}"
    kind = event["kind"]
    rest = {key: value for key, value in event.items() if key not in UNSPOKEN}
    words = (f"{value}" if key == kind else f"{key} {value}" for key, value in rest.items())
    details = ", ".join(words)
    return f"{kind}{agent}" + (f": {details}" if details else "")


class _Times:
    """The times of a block of ticks as rerun's columns: sheets of the same ticks share them."""

    def __init__(self, ticks: Sequence[Tick]) -> None:
        self._ticks = ticks
        self._made: dict[tuple[int, ...], list[rr.TimeColumn]] = {(): []}

    def of(self, rows: Sequence[int]) -> list[rr.TimeColumn]:
        """Return when rows of the block are; nothing for what holds at any time."""
        key = tuple(rows)
        if key not in self._made:
            ticks = [self._ticks[row] for row in rows]
            self._made[key] = _indexes([t.time_s for t in ticks], [t.index for t in ticks])
        return self._made[key]


def _indexes(times_s: list[float], ticks: list[int]) -> list[rr.TimeColumn]:
    since_start = np.rint(np.array(times_s) * 1e9).astype("timedelta64[ns]")
    return [
        rr.TimeColumn(layout.SIM_TIME, duration=since_start),
        rr.TimeColumn(layout.TICK, sequence=ticks),
    ]
