"""A recording read back: the ticks that were judged, from the file alone.

A truncated recording (its process was killed) is read up to the last tick of which every row is
there.

Rerun's bindings are all that reading needs. To import the whole of rerun takes half a second more,
in each process that reads, and in each command that may begin one.
"""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import msgspec
import numpy as np
from numpy.typing import NDArray
from pyarrow.lib import FixedSizeListArray, bool_
from rerun_bindings import ChunkInternal, RrdReaderInternal

from worldsim.judge.run_events import RunEvent, event_of
from worldsim.judge.tick import Packets, Tick
from worldsim.recording import layout
from worldsim.recording.rrd_file import is_finished, is_recording, readable
from worldsim.scenario.file import parse
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario
from worldsim.scenario.toml import ScenarioError

Column = dict[int, NDArray[Any]]
"""One component of one entity: a flat row for each tick that has one."""

EVERY_TICK = (
    (layout.AGENT_STATE, layout.POSITION),
    (layout.TARGETS, layout.POSITIONS),
    (layout.FORCE, layout.SCALARS),
    (layout.TURN_DEG, layout.SCALARS),
    (layout.AGENT_STATE, layout.PLACE),
    (layout.AGENT_STATE, layout.ALIVE),
    (layout.AGENT_STATE, layout.ATTITUDE),
)
"""Columns with a row for every tick; ``_ticks`` takes them in this order."""
DRAWN_POSITION = (layout.AGENTS, layout.POSITIONS)
"""What the viewer draws, in single precision: all that an older recording has of positions."""
RERUN_NAMES = re.compile(r"^Failed to read RRD file at .*?\.rrd: ")
COMPONENTS = {component for _, component in EVERY_TICK} | {layout.HEARS, layout.MISSION}


class RecordingError(Exception):
    """A missing recording, or a file that is none; the text names it and says why."""


class DamagedError(RecordingError):
    """A recording that cannot be read, or not as a whole: it proves nothing."""


@dataclass(frozen=True, slots=True)
class Readback:
    """What a recording holds."""

    scenario: Scenario
    """Resolved, as it was flown."""
    ticks: list[Tick]
    """In order; without ``hierarchy``, which is not judged."""
    events: list[RunEvent]
    """As in events.jsonl, in order of recording."""
    mode: str | None
    """"processes", "lockstep" or "virtual"; None where the recording does not say it."""
    finished: bool
    """Whether its recorder wrote it to its end."""
    exact: bool
    """Whether positions are those that were judged. An older recording has them only as drawn."""


def check_recording(path: Path) -> None:
    """Raise RecordingError where there is no file, or one that does not begin as a recording."""
    if not path.is_file():
        raise RecordingError(f"{path}: no such recording")
    try:
        begins = is_recording(path)
    except OSError as error:
        raise DamagedError(f"{path}: cannot be read: {error.strerror}") from error
    if not begins:
        raise RecordingError(f"{path}: not a recording")


def read_run(path: Path) -> Readback:
    """Return the run that a recording holds. Raises RecordingError.

    A damaged file can end this process: rerun's reader aborts on some. See ``isolated_reader``.
    """
    check_recording(path)
    try:
        columns = _RecordedColumns(_chunks(path))
    except msgspec.ValidationError as error:
        raise DamagedError(f"{path}: holds an unknown event: {error}") from error
    scenario, exact = _scenario(columns, path), bool(columns.column(*EVERY_TICK[0]))
    try:
        ticks = _ticks(columns, scenario, EVERY_TICK[0] if exact else DRAWN_POSITION)
    except (ValueError, OverflowError) as error:
        raise DamagedError(f"{path}: damaged: {error}") from error
    return Readback(
        scenario=scenario,
        ticks=ticks,
        events=columns.events,
        mode=columns.mode,
        finished=is_finished(path),
        exact=exact,
    )


class _RecordedColumns:
    """The columns of a recording, by entity and component."""

    def __init__(self, chunks: Iterable[ChunkInternal]) -> None:
        self._columns: dict[tuple[str, str], Column] = {}
        self.events: list[RunEvent] = []
        self.scenario_text: str | None = None
        self.mode: str | None = None
        for chunk in chunks:
            self._read(chunk)

    def column(self, entity: str, component: str) -> Column:
        """Return one column; empty when the recording does not have it."""
        return self._columns.get((entity, component), {})

    def packet_counters(self) -> dict[str, Column]:
        """Return the columns of the medium's counters, by name."""
        named = {layout.packet_counter(entity): each for (entity, _), each in self._columns.items()}
        return {name: column for name, column in named.items() if name is not None}

    def signals(self) -> dict[str, Column]:
        """Return the columns of the controllers' signals, by name."""
        found = {layout.signal_name(entity): each for (entity, _), each in self._columns.items()}
        return {name: column for name, column in found.items() if name is not None}

    def _read(self, chunk: ChunkInternal) -> None:
        batch = chunk.to_record_batch()
        if chunk.entity_path == layout.SCENARIO:
            self.scenario_text = batch.column("TextDocument:text")[0].as_py()[0]
        elif chunk.entity_path == layout.RUN_PROPERTIES:
            self.mode = batch.column(layout.MODE)[0].as_py()[0]
        elif chunk.is_static:
            return
        elif chunk.entity_path == layout.EVENTS:
            encoded = batch.column(layout.EVENT).to_pylist()
            self.events.extend(event_of(json.loads(row[0])) for row in encoded)
        else:
            self._read_rows(chunk.entity_path, batch)

    def _read_rows(self, entity: str, batch: Any) -> None:
        if layout.TICK not in batch.schema.names:
            return
        ticks = batch.column(layout.TICK).to_pylist()
        for component in batch.schema.names:
            if component in COMPONENTS:
                column = self._columns.setdefault((entity, component), {})
                rows = batch.column(component)
                # A row that is null keeps the one before. (Array.is_valid() imports much more.)
                there = [each.is_valid for each in rows] if rows.null_count else [True] * len(rows)
                told = zip(ticks, _flat_rows(rows), there, strict=True)
                column.update({tick: row for tick, row, valid in told if valid})


def _flat_rows(lists: Any) -> list[NDArray[Any]]:
    """Return a column of lists of numbers, or of vectors, as one flat array for each row."""
    offsets, values, width = lists.offsets.to_pylist(), lists.values, 1
    if isinstance(values, FixedSizeListArray):
        values, width = values.values, values.type.list_size
    flat = _numbers(values)
    return [flat[start * width : end * width] for start, end in pairwise(offsets)]


def _numbers(values: Any) -> NDArray[Any]:
    """Return numbers as an array.

    What pyarrow has for it imports pandas, wherever that is installed: a third of a second.
    """
    if values.null_count:
        return values.to_numpy(zero_copy_only=False)  # type: ignore[no-any-return]
    if values.type == bool_():
        packed = np.frombuffer(values.buffers()[1] or b"", dtype=np.uint8)
        bits = np.unpackbits(packed, count=values.offset + len(values), bitorder="little")
        return bits[values.offset :].astype(np.bool_)
    return np.from_dlpack(values)


def _chunks(path: Path) -> list[ChunkInternal]:
    try:
        with readable(path) as file, catch_warnings():
            # Rerun warns of an old format where a truncated file has no footer.
            simplefilter("ignore")
            return list(RrdReaderInternal(str(file)).stream())
    except (RuntimeError, ValueError, OSError) as error:
        # Rerun names the file that it read, which may be a copy.
        why = RERUN_NAMES.sub("", str(error), count=1)
        raise DamagedError(f"{path}: cannot be read: {why}") from error


def _scenario(columns: _RecordedColumns, path: Path) -> Scenario:
    text = columns.scenario_text
    if text is None:
        raise DamagedError(f"{path}: holds no scenario: it is no run's, or not whole")
    try:
        return parse(text.removeprefix("```toml\n").removesuffix("```\n"), path)
    except ScenarioError as error:
        raise DamagedError(f"{error} (the scenario in the recording)") from error


def _ticks(columns: _RecordedColumns, scenario: Scenario, positions: tuple[str, str]) -> list[Tick]:
    """Return the ticks of which every row is there. Raises ValueError for rows of a wrong size."""
    agents = scenario.rows
    always = [columns.column(*name) for name in (positions, *EVERY_TICK[1:])]
    position, target, force, turn, place, alive, attitude = always
    complete = sorted(set(position).intersection(*always))
    hears = _latest(_state(columns, layout.LINK_STATE, layout.HEARS), complete, _no_links(agents))
    missions = _state(columns, layout.MISSION_STATE, layout.MISSION)
    mission = _latest(missions, complete, np.zeros(agents))
    packets = _packets(columns.packet_counters(), complete)
    signals = columns.signals()
    return [
        Tick(
            index=index,
            time_s=index * SLOTS_PER_TICK / scenario.slot_hz,
            position=position[index].astype(np.float64).reshape(agents, 3),
            attitude=attitude[index].reshape(agents, 3),
            target=target[index].reshape(agents, 3),
            place=place[index].reshape(agents, 2),
            force=force[index].astype(np.float32).reshape(agents),
            turn_deg=turn[index].astype(np.float64).reshape(agents),
            alive=alive[index].astype(np.bool_).reshape(agents),
            links=_links(hears[row], agents),
            mission=mission[row].astype(np.int64).reshape(agents),
            packets=packets[row],
            signals=_signals(signals, index, agents),
        )
        for row, index in enumerate(complete)
    ]


def _state(columns: _RecordedColumns, formerly: str, component: str) -> Column:
    """Return a component of the agents' state; formerly: its entity in older recordings."""
    return columns.column(layout.AGENT_STATE, component) or columns.column(formerly, component)


def _latest(column: Column, ticks: Sequence[int], first: NDArray[Any]) -> list[NDArray[Any]]:
    """Return for each tick the latest row at or before it; ``first`` where there is none."""
    changes = sorted(column)
    before = np.searchsorted(np.array(changes, dtype=np.int64), ticks, side="right")
    return [column[changes[count - 1]] if count else first for count in before.tolist()]


def _packets(counters: dict[str, Column], ticks: Sequence[int]) -> list[Packets]:
    """Return the latest counters at each tick; a counter is missing before its first row."""
    unknown = np.zeros(0)
    latest = {name: _latest(column, ticks, unknown) for name, column in sorted(counters.items())}
    return [
        {name: int(values[row][0]) for name, values in latest.items() if len(values[row])}
        for row in range(len(ticks))
    ]


def _signals(columns: Mapping[str, Column], tick: int, agents: int) -> dict[str, NDArray[Any]]:
    """Return the signals of a tick, each (N,)."""
    return {
        name: column[tick].astype(np.float64).reshape(agents)
        for name, column in columns.items()
        if tick in column
    }


def _links(bits: NDArray[np.uint8], agents: int) -> NDArray[np.int32]:
    """Return the pairs (hearer, heard) of the matrix that the recorder packed into bits."""
    hears = np.unpackbits(bits, count=agents * agents).reshape(agents, agents)
    return np.argwhere(hears).astype(np.int32)


def _no_links(agents: int) -> NDArray[np.uint8]:
    return np.packbits(np.zeros(agents * agents, dtype=np.bool_))
