"""A finished run, opened for analysis: its scenario, its verdict, and its tables.

    import worldsim.results
    run = worldsim.results.open("runs/wedge-9-20260102T030405Z")
    run.metrics["separation_m"].min()
    run.poses.pandas()

Everything but ``summary`` comes from the recording, so a recording alone is enough.
"""

import json
import os
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from worldsim.judge.run_events import RunEvent
from worldsim.judge.tick import Tick
from worldsim.recording.comparison import Difference
from worldsim.recording.isolated_reader import read_run_apart
from worldsim.recording.layout import RECORDING_FILE, SUMMARY_FILE
from worldsim.recording.readback import Readback, RecordingError
from worldsim.recording.rejudged import Rejudged, rejudge
from worldsim.recording.verify import Verification, compared, verification_of
from worldsim.results import run_tables
from worldsim.results.run_tables import LAYOUTS, RunRows
from worldsim.results.summary import SCHEMA
from worldsim.results.table import Table
from worldsim.scenario.tables import Scenario


class Run:
    """A recorded run; ``worldsim.results.open`` makes it.

    A table is made when it is first used. Their columns are documented in docs/results.md.
    """

    def __init__(self, path: Path, readback: Readback, summary: dict[str, Any] | None) -> None:
        self.path = path
        """As it was given: the run's folder, or its recording."""
        self.summary = summary
        """The content of summary.json; None where there is none that can be read."""
        self._readback = readback
        self._rows = RunRows(readback.scenario, readback.ticks, readback.events)

    def __repr__(self) -> str:
        ended_s = self.ticks[-1].time_s if self.ticks else 0.0
        return (
            f"<run {self.path}: {self.scenario.name}, {self.scenario.rows} agents, {ended_s:g} s>"
        )

    @property
    def scenario(self) -> Scenario:
        """The scenario as it was flown, every default filled in."""
        return self._readback.scenario

    @property
    def mode(self) -> str | None:
        """The clock: "processes", "lockstep" or "virtual"; None in an older recording."""
        return self._readback.mode

    @property
    def ended_s(self) -> float:
        """Time of the last recorded tick [s; simulated time]."""
        return self.ticks[-1].time_s if self.ticks else 0.0

    @property
    def ticks(self) -> Sequence[Tick]:
        """The recorded ticks, in order."""
        return self._readback.ticks

    @property
    def run_events(self) -> Sequence[RunEvent]:
        """The recorded events as the judge takes them."""
        return self._readback.events

    @property
    def agents(self) -> Table:
        """A row for each agent."""
        return self._table("agents")

    @property
    def poses(self) -> Table:
        """Position, attitude and whether it runs, of each agent at each tick [world frame]."""
        return self._table("poses")

    @property
    def targets(self) -> Table:
        """Target-on-queue of each agent at each tick [world frame]."""
        return self._table("targets")

    @property
    def places(self) -> Table:
        """Queue, rank, mission and role of each agent at each tick."""
        return self._table("places")

    @property
    def links(self) -> Table:
        """When which agent heard which."""
        return self._table("links")

    @property
    def events(self) -> Table:
        """The run's events, each also as a sentence."""
        return self._table("events")

    @property
    def metrics(self) -> Table:
        """What the judge measured of each agent at each tick."""
        return self._table("metrics")

    @property
    def signals(self) -> Table:
        """What the controllers state of themselves, of each agent at each tick."""
        return self._table("signals")

    @property
    def packets(self) -> Table:
        """The radio's counters at each tick."""
        return self._table("packets")

    @property
    def tables(self) -> dict[str, Table]:
        """All tables by name."""
        return {name: self._table(name) for name in LAYOUTS}

    @cached_property
    def rejudged(self) -> Rejudged:
        """The judge and its measurements, computed again from the recording."""
        return rejudge(self._readback)

    @cached_property
    def verification(self) -> Verification:
        """The verdict of the recording, compared with summary.json."""
        verdict = verification_of(self.path, self._readback, self.rejudged.judge)
        return compared(verdict, _folder(self.path) / SUMMARY_FILE)

    @property
    def figures(self) -> dict[str, Any]:
        """What the recording shows, under the keys of summary.json."""
        return self.verification.figures

    @property
    def differences(self) -> tuple[Difference, ...]:
        """Where summary.json and the recording give different figures."""
        return self.verification.differences

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What is missing of the run, in sentences; empty for a whole run."""
        found, scenario, ended_s = [], self.scenario, self.ended_s
        if not self._readback.finished:
            found.append("The recording is cut off: its end was never written.")
        if ended_s < scenario.duration_s - 1.0 / scenario.fleet.tick_hz - run_tables.TIME_SLACK_S:
            found.append(f"It ends at {ended_s:.4g} s of {scenario.duration_s:g} s.")
        if not self._readback.exact:
            found.append("Positions are in single precision: an older version recorded them.")
        if self.summary is None:
            found.append(f"There is no {SUMMARY_FILE}, or none that can be read.")
        return tuple(found)

    def _table(self, name: str) -> Table:
        return self._made[name] if name in self._made else self._make(name)

    @cached_property
    def _made(self) -> dict[str, Table]:
        return {}

    def _make(self, name: str) -> Table:
        if name == "metrics":
            table = run_tables.metrics(self._rows, self.rejudged.figures)
        else:
            table = getattr(run_tables, name)(self._rows)
        return self._made.setdefault(name, table)


def open(path: str | os.PathLike[str]) -> Run:
    """Open a run's folder, or its recording.

    A recording that was cut off gives what can be read; ``Run.notes`` says what is missing. Raises
    worldsim.recording.readback.RecordingError for what is no run, or none of this version.
    """
    given = Path(path)
    recording = _recording(given)
    summary = _summary(_folder(given) / SUMMARY_FILE)
    return Run(given, read_run_apart(recording), summary)


def _folder(path: Path) -> Path:
    return path if path.is_dir() else path.parent


def _recording(given: Path) -> Path:
    if not given.exists():
        raise RecordingError(f"{given}: no such run")
    recording = given / RECORDING_FILE if given.is_dir() else given
    if recording.is_file():
        return recording
    if any(given.glob(f"*/{RECORDING_FILE}")):
        raise RecordingError(f"{given}: a folder of many runs; name one of them")
    if (given / "scenario.toml").is_file():
        why = "made with --no-recording, or its recording was removed"
        raise RecordingError(f"{given}: no recording in it: {why}")
    raise RecordingError(f"{given}: not a run: no {RECORDING_FILE} in it")


def _summary(file: Path) -> dict[str, Any] | None:
    """Return the content of a summary.json. Raises RecordingError where it is of another schema."""
    try:
        content = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(content, dict):
        return None
    if content.get("schema") != SCHEMA:
        known = f"this version of qswarm reads schema {SCHEMA}"
        raise RecordingError(f"{file}: schema {content.get('schema')}; {known}")
    return content
