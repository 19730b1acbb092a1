"""A recording read back: the very ticks that were judged, from the file alone.

A recording that was cut off (its process was killed) is read as far as it goes: to the last tick
of which every row is there.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray
from pyarrow.lib import FixedSizeListArray
from rerun.chunk import Chunk, RrdReader
from rerun.error_utils import RerunWarning

from worldsim.judge.run_events import RunEvent, event_of
from worldsim.judge.tick import Packets, Tick
from worldsim.recording import layout
from worldsim.recording.rrd_file import readable
from worldsim.scenario.file import parse
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario

Column = dict[int, NDArray[Any]]
"""One component of one entity: a flat row for each tick that has one."""


class RecordingError(Exception):
    """A recording that is not there, or from which no run can be read; the text says why."""


@dataclass(frozen=True, slots=True)
class Readback:
    """What a recording holds: the scenario as it was resolved, ticks and events in order."""

    scenario: Scenario
    ticks: list[Tick]
    events: list[RunEvent]


def read_run(path: Path) -> Readback:
    """Return the run that a recording holds, or raise RecordingError."""
    if not path.is_file():
        raise RecordingError(f"{path}: no such recording")
    columns = _Columns(_chunks(path))
    scenario = _scenario(columns, path)
    return Readback(scenario, _ticks(columns, scenario), columns.events)


class _Columns:
    """The columns of a recording, by entity and component."""

    def __init__(self, chunks: Iterable[Chunk]) -> None:
        self._columns: dict[tuple[str, str], Column] = {}
        self.events: list[RunEvent] = []
        self.scenario_text: str | None = None
        for chunk in chunks:
            self._take(chunk)

    def of(self, entity: str, component: str) -> Column:
        """Return one column; empty when the recording does not have it."""
        return self._columns.get((entity, component), {})

    def counters(self) -> dict[str, Column]:
        """Return the medium's counters, by cause."""
        under = f"{layout.PACKETS}/"
        return {
            entity.removeprefix(under): column
            for (entity, _), column in self._columns.items()
            if entity.startswith(under)
        }

    def _take(self, chunk: Chunk) -> None:
        batch = chunk.to_record_batch()
        if chunk.entity_path == layout.SCENARIO:
            self.scenario_text = batch.column("TextDocument:text")[0].as_py()[0]
        elif chunk.is_static:
            return
        elif chunk.entity_path == layout.EVENTS:
            told = batch.column(layout.EVENT).to_pylist()
            self.events.extend(event_of(json.loads(row[0])) for row in told)
        else:
            self._take_rows(chunk.entity_path, batch)

    def _take_rows(self, entity: str, batch: Any) -> None:
        if layout.TICK not in batch.schema.names:
            return
        ticks = batch.column(layout.TICK).to_pylist()
        for component in batch.schema.names:
            if component in _READ:
                column = self._columns.setdefault((entity, component), {})
                column.update(zip(ticks, _rows(batch.column(component)), strict=True))


_POSITIONS = "Points3D:positions"
_SCALARS = "Scalars:scalars"
_READ = {
    _POSITIONS,
    _SCALARS,
    layout.PLACE,
    layout.ALIVE,
    layout.ATTITUDE,
    layout.HEARS,
    layout.MISSION,
}


def _rows(lists: Any) -> list[NDArray[Any]]:
    """Return a column of lists of numbers, or of vectors, as one flat array for each row."""
    offsets, values, width = lists.offsets.to_numpy(), lists.values, 1
    if isinstance(values, FixedSizeListArray):
        values, width = values.values, values.type.list_size
    flat = values.to_numpy(zero_copy_only=False)
    return [flat[start * width : end * width] for start, end in pairwise(offsets.tolist())]


def _chunks(path: Path) -> list[Chunk]:
    try:
        with readable(path) as file, catch_warnings():
            # A file that was cut off has no footer; that is said to be an old format.
            simplefilter("ignore", RerunWarning)
            return list(RrdReader(file).stream())
    except (RuntimeError, ValueError, OSError) as error:
        raise RecordingError(f"{path}: cannot be read: {error}") from error


def _scenario(columns: _Columns, path: Path) -> Scenario:
    text = columns.scenario_text
    if text is None:
        raise RecordingError(f"{path}: holds no scenario: not a recording of a run")
    return parse(text.removeprefix("```toml\n").removesuffix("```\n"), path)


def _ticks(columns: _Columns, scenario: Scenario) -> list[Tick]:
    """Return the ticks of which every row is there."""
    agents = scenario.rows
    always = [columns.of(*name) for name in _EVERY_TICK]
    position, target, force, turn, place, alive, attitude = always
    whole = sorted(set(position).intersection(*always))
    heard = _latest(columns.of(layout.HEARD, layout.HEARS), whole, _no_bits(agents))
    flown = _latest(columns.of(layout.MISSIONS, layout.MISSION), whole, np.zeros(agents))
    packets = _packets(columns.counters(), whole)
    return [
        Tick(
            index=index,
            time_s=index * SLOTS_PER_TICK / scenario.slot_hz,
            position=position[index].reshape(-1, 3),
            attitude=attitude[index].reshape(-1, 3),
            target=target[index].reshape(-1, 3),
            place=place[index].reshape(-1, 2),
            force=force[index].astype(np.float32),
            turn_deg=turn[index].astype(np.float32),
            alive=alive[index].astype(np.bool_),
            links=_links(heard[row], agents),
            mission=flown[row].astype(np.int64),
            packets=packets[row],
        )
        for row, index in enumerate(whole)
    ]


_EVERY_TICK = (
    (layout.AGENTS, _POSITIONS),
    (layout.TARGETS, _POSITIONS),
    (layout.FORCE, _SCALARS),
    (layout.TURN_DEG, _SCALARS),
    (layout.STATE, layout.PLACE),
    (layout.STATE, layout.ALIVE),
    (layout.STATE, layout.ATTITUDE),
)


def _latest(column: Column, ticks: Sequence[int], first: NDArray[Any]) -> list[NDArray[Any]]:
    """Return for each tick the row that held then; ``first`` before there was any."""
    changes = sorted(column)
    before = np.searchsorted(np.array(changes, dtype=np.int64), ticks, side="right")
    return [column[changes[count - 1]] if count else first for count in before.tolist()]


def _packets(counters: dict[str, Column], ticks: Sequence[int]) -> list[Packets]:
    """Return the newest counters at each tick; none before the first were told."""
    none = np.zeros(0)
    told = {cause: _latest(column, ticks, none) for cause, column in sorted(counters.items())}
    return [
        {cause: int(values[row][0]) for cause, values in told.items() if len(values[row])}
        for row in range(len(ticks))
    ]


def _links(bits: NDArray[np.uint8], agents: int) -> NDArray[np.int32]:
    """Return (hearer, heard) of the matrix that the recorder packed into bits."""
    hears = np.unpackbits(bits, count=agents * agents).reshape(agents, agents)
    return np.argwhere(hears).astype(np.int32)


def _no_bits(agents: int) -> NDArray[np.uint8]:
    return np.zeros((agents * agents + 7) // 8, dtype=np.uint8)
