"""The ticks that are read back are those that were judged."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np
import pytest
import rerun as rr
from hypothesis import given, settings
from hypothesis import strategies as st
from rerun.chunk import Chunk, RrdReader

from netem.link_parameters import Conditions
from tests.recording.flights import record, straight_flight, verdict_parts, wedge
from worldsim.judge.radio_events import ConditionsChanged
from worldsim.judge.run_events import Killed, SlotChanged
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Judge
from worldsim.recording import layout
from worldsim.recording.components import number_column
from worldsim.recording.readback import read_run
from worldsim.recording.recorder import RunRecorder
from worldsim.recording.verify import verify
from worldsim.results.verdict_text import verified
from worldsim.scenario.tables import Fleet

AGENTS = 5
SPOOFED = 40_000


@st.composite
def wild_ticks(draw: st.DrawFn) -> list[Tick]:
    """Ticks with anything in them: missing vehicles, places and targets, false neighbours."""
    generator = np.random.default_rng(draw(st.integers(0, 2**32)))
    count = draw(st.integers(1, 50))
    return [_wild_tick(generator, index) for index in range(count)]


def _wild_tick(generator: np.random.Generator, index: int) -> Tick:
    def row(*shape: int) -> np.ndarray:
        return generator.normal(0.0, 2.0, (AGENTS, *shape)).astype(np.float32)

    def exact_row(*shape: int) -> np.ndarray:
        return generator.normal(1e6, 2.0, (AGENTS, *shape))

    def absent() -> np.ndarray:
        return generator.random(AGENTS) < 0.2

    position, target, force, turn = exact_row(3), row(3), np.abs(row()), exact_row()
    for some in (position, target, force, turn):
        some[absent()] = np.nan
    links = generator.integers(0, AGENTS, (generator.integers(0, 8), 2))
    return Tick(
        index=index,
        time_s=index / 20.0,
        position=position,
        attitude=row(3),
        target=target,
        place=generator.integers(-1, 4, (AGENTS, 2)).astype(np.int16),
        force=force,
        turn_deg=turn,
        alive=generator.random(AGENTS) < 0.8,
        links=np.vstack([links, [[0, SPOOFED]]]).astype(np.int32),
        mission=generator.integers(0, 2**40, AGENTS),
        packets={"sent": int(generator.integers(0, 2**40))},
    )


@settings(max_examples=12, deadline=None)
@given(ticks=wild_ticks())
def test_a_recording_holds_the_numbers_that_were_judged(ticks: list[Tick]) -> None:
    scenario = wedge(AGENTS)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.rrd"
        judged = record(RunRecorder(path, scenario, "wild", mode="virtual"), scenario, ticks)
        readback = read_run(path)
    again = Judge(readback.scenario)
    for before, after in zip(ticks, readback.ticks, strict=True):
        _assert_equal(before, after)
        again.see(after)
    assert verdict_parts(again) == verdict_parts(judged)


def _assert_equal(before: Tick, after: Tick) -> None:
    assert (after.index, after.time_s) == (before.index, before.time_s)
    for rows in ("position", "attitude", "target", "place", "force", "turn_deg", "alive"):
        kept, given_ = getattr(after, rows), getattr(before, rows)
        assert kept.dtype == given_.dtype
        np.testing.assert_array_equal(kept, given_)
    real = before.links[before.links[:, 1] < AGENTS]
    np.testing.assert_array_equal(after.links, np.unique(real, axis=0).reshape(-1, 2))
    assert after.packets == before.packets


def test_an_older_recording_is_read(tmp_path: Path) -> None:
    scenario, new, old = wedge(4, duration_s=1.0), tmp_path / "new.rrd", tmp_path / "old.rrd"
    flown = list(straight_flight(scenario))
    record(RunRecorder(new, scenario, "new", mode="virtual"), scenario, flown)
    stream = rr.RecordingStream("qswarm")
    stream.set_sinks(rr.FileSink(old))
    for chunk in RrdReader(new).stream():
        rr.send_chunks(_as_formerly(chunk), recording=stream)
    stream.disconnect()
    for before, after in zip(flown, read_run(old).ticks, strict=True):
        _assert_equal(before, after)


def _as_formerly(chunk: Chunk) -> list[Chunk]:
    """Return a chunk as it was: missions and links had entities of their own."""
    if chunk.is_static or chunk.entity_path != layout.AGENT_STATE:
        return [chunk]
    batch, found = chunk.to_record_batch(), []
    ticks = np.array(batch.column(layout.TICK).to_pylist())
    for part, entity in (
        (layout.HEARS, layout.LINK_STATE),
        (layout.MISSION, layout.MISSION_STATE),
    ):
        if part in batch.schema.names:
            rows = batch.column(part)
            there = np.flatnonzero(rows.is_valid().to_numpy(zero_copy_only=False))
            column = number_column(part, np.stack([rows[row].values.to_numpy() for row in there]))
            times = [rr.TimeColumn(layout.TICK, sequence=ticks[there])]
            found.append(Chunk.from_columns(entity, times, [column]))
            batch = batch.drop_columns([part])
    return [*Chunk.from_record_batch(batch), *found]


def test_scenario_and_events_are_read_back(tmp_path: Path) -> None:
    scenario = wedge(9, duration_s=1.0)
    recorder = RunRecorder(tmp_path / "run.rrd", scenario, "events", mode="virtual")
    events = [
        SlotChanged(t_s=0.0125, agent=3, place=(1, 2), before=None),
        Killed(t_s=0.5, agent=4, planned=False, signal=9),
        ConditionsChanged(
            t_s=0.75,
            agent=None,
            planned=True,
            number=0,
            loss_percent=5.0,
            conditions=Conditions(loss_percent=5.0, range_m=6.0),
        ),
    ]
    for event in events:
        recorder.event(event)
    record(recorder, scenario, list(straight_flight(scenario)))
    readback = read_run(tmp_path / "run.rrd")
    assert readback.events == events
    assert readback.scenario == scenario


def test_times_are_exact_where_a_tick_is_no_whole_number_of_nanoseconds(tmp_path: Path) -> None:
    scenario = wedge(4, duration_s=1.0)
    ticks = [replace(tick, time_s=tick.index / 30) for tick in straight_flight(scenario)]
    thirty = msgspec.structs.replace(scenario, fleet=Fleet(agents=4, tick_hz=30.0))
    record(RunRecorder(tmp_path / "run.rrd", thirty, "thirty", mode="virtual"), thirty, ticks)
    assert [tick.time_s for tick in read_run(tmp_path / "run.rrd").ticks] == [
        tick.time_s for tick in ticks
    ]


def test_an_older_recording_is_judged_by_what_was_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Older recordings have positions in single precision only, and say so."""
    scenario = wedge(4)
    with monkeypatch.context() as older:
        older.setattr(layout, "POSITION", "unknown")
        recorder = RunRecorder(tmp_path / "run.rrd", scenario, "older", mode="virtual")
        record(recorder, scenario, list(straight_flight(scenario)))
    readback = read_run(tmp_path / "run.rrd")
    assert not readback.exact
    for before, after in zip(straight_flight(scenario), readback.ticks, strict=True):
        np.testing.assert_array_equal(after.position, before.position.astype(np.float32))
    shown = verified(verify(tmp_path))
    assert "positions in single precision: recorded by an older version" in shown
