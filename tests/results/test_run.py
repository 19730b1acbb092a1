"""A run opened for analysis: its tables are what was recorded, and what it cannot read it says."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from shutil import copy, copytree
from typing import Any

import numpy as np
import pytest
import rerun as rr

import worldsim.results
from tests.cut_recordings import cut
from tests.recording.flights import record, straight_flight, wedge
from tests.small_scenario import SMALL
from worldsim.commands.app import command
from worldsim.judge.tick import Tick
from worldsim.recording.readback import RecordingError
from worldsim.recording.recorder import RunRecorder
from worldsim.results.run import Run
from worldsim.results.run_tables import LAYOUTS, RunRows, links, places
from worldsim.results.summary import FATES

BY_TICK_AND_AGENT = ("poses", "targets", "places", "metrics")


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, list[Tick]]:
    """A recorded flight without a summary, and its ticks."""
    file, scenario = tmp_path_factory.mktemp("flown") / "run.rrd", wedge(4, duration_s=2.0)
    recorder, ticks = RunRecorder(file, scenario, "flown", mode="virtual"), []
    for tick in straight_flight(scenario):
        # From the second second on, a0 hears nobody, and its vehicle is gone.
        ticks.append(tick if tick.time_s <= 1.0 else _without_a0(tick))
    record(recorder, scenario, ticks)
    return worldsim.results.open(file), ticks


def _without_a0(tick: Tick) -> Tick:
    position = tick.position.copy()
    position[0] = np.nan
    return replace(tick, position=position, links=tick.links[tick.links[:, 0] != 0])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run in virtual time."""
    base = tmp_path_factory.mktemp("run")
    (base / "small.toml").write_text(SMALL)
    assert command(["sim", str(base / "small.toml"), "--out", str(base / "out")]) == 0
    return base / "out"


@pytest.fixture(scope="module")
def whole(folder: Path) -> Run:
    return worldsim.results.open(folder)


@pytest.fixture
def own(folder: Path, tmp_path: Path) -> Path:
    """A copy of that folder, to damage."""
    return Path(copytree(folder, tmp_path / "out"))


def test_poses_targets_and_places_are_those_of_the_ticks(flown: tuple[Run, list[Tick]]) -> None:
    run, ticks = flown
    shape = (len(ticks), run.scenario.rows)
    for table, attribute, names in (
        (run.poses, "position", ("x_m", "y_m", "z_m")),
        (run.poses, "attitude", ("yaw_rad", "pitch_rad", "roll_rad")),
        (run.targets, "target", ("x_m", "y_m", "z_m")),
        (run.places, "place", ("queue", "rank")),
    ):
        for axis, name in enumerate(names):
            recorded = np.stack([getattr(tick, attribute)[:, axis] for tick in ticks])
            np.testing.assert_array_equal(table[name].reshape(shape), recorded)
    assert np.isnan(run.poses["x_m"].reshape(shape)[-1, 0])
    assert run.places["queue_name"].tolist()[1] == f"Q{run.places['queue'][1]}"


def test_links_are_the_spans_without_a_break(flown: tuple[Run, list[Tick]]) -> None:
    run, ticks = flown
    again = [set[tuple[int, int]]() for _ in ticks]
    for row in run.links.numpy():
        for index in range(row["from_tick"], row["to_tick"] + 1):
            again[index].add((int(row["hearer"]), int(row["heard"])))
    assert again == [set(map(tuple, tick.links.tolist())) for tick in ticks]
    ended = run.links["to_s"][run.links["hearer"] == 0]
    assert ended.tolist() == [1.0] * 3


def test_a_link_that_comes_back_is_a_row_of_its_own(flown: tuple[Run, list[Tick]]) -> None:
    run, ticks = flown
    table = links(RunRows(run.scenario, [ticks[0], ticks[-1], ticks[1]], []))
    assert np.count_nonzero(table["hearer"] == 0) == 6


def test_metrics_and_packets_are_what_was_judged(flown: tuple[Run, list[Tick]]) -> None:
    run, ticks = flown
    assert np.nanmin(run.metrics["separation_m"]) == run.figures["min_separation_m"]
    assert run.metrics["turn_deg"].tolist() == [
        turn for tick in ticks for turn in tick.turn_deg.tolist()
    ]
    assert run.packets["delivered"].tolist() == [tick.packets["delivered"] for tick in ticks]
    assert {*FATES, "sent", "addressed", "in_flight"} == set(run.packets) - {"t_s", "tick"}


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_table_is_the_same_in_every_form(flown: tuple[Run, list[Tick]], name: str) -> None:
    table = flown[0].tables[name]
    pandas, polars, structured = table.pandas(), table.polars(), table.numpy()
    assert structured.shape == (table.rows,)
    for column in LAYOUTS[name].columns:
        for form in (pandas[column.name], polars[column.name], structured[column.name]):
            np.testing.assert_array_equal(np.asarray(form), table[column.name])
        known = table.arrow().schema.field(column.name).metadata
        assert known[b"description"] == column.says.encode()
        assert known.get(b"unit", b"") == column.unit.encode()


def test_tables_by_tick_and_agent_stand_side_by_side(flown: tuple[Run, list[Tick]]) -> None:
    keys = [flown[0].tables[name].numpy()[["tick", "agent"]] for name in BY_TICK_AND_AGENT]
    assert all(np.array_equal(keys[0], each) for each in keys)


def test_without_pandas_its_name_is_in_the_error(
    flown: tuple[Run, list[Tick]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ModuleNotFoundError, match="pandas"):
        flown[0].poses.pandas()


def test_a_whole_run_has_no_notes_and_its_summarys_figures(folder: Path, whole: Run) -> None:
    run = whole
    assert (run.notes, run.differences) == ((), ())
    assert run.summary is not None
    assert run.figures["min_separation_m"] == run.summary["min_separation_m"]
    assert json.loads((folder / "summary.json").read_text()) == run.summary


def test_events_are_those_of_the_folder(folder: Path, whole: Run) -> None:
    events = whole.events
    lines = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
    assert lines
    again: list[dict[str, Any]] = [
        {
            "t_s": row["t_s"],
            "kind": row["kind"],
            "agent": None if row["agent"] < 0 else int(row["agent"]),
            **json.loads(row["details"]),
        }
        for row in events.numpy()
    ]
    assert again == lines
    assert "a0 takes slot 1 of queue Q1" in events["text"].tolist()


def test_a_role_holds_from_its_event_on(whole: Run) -> None:
    run = whole
    table, events = run.places, run.events.numpy()
    roles = events[(events["kind"] == "role") & (events["agent"] == 0)]
    last = json.loads(roles["details"][-1])["role"]
    mine = table.numpy()[table["agent"] == 0]
    assert mine["role"][-1] == last
    changed_s = mine["t_s"][mine["role"] == last].min()
    assert changed_s == pytest.approx(roles["t_s"][-1])
    no_events = RunRows(run.scenario, run.ticks[:1], [])
    assert places(no_events)["role"].tolist() == [""] * run.scenario.rows


def test_a_truncated_recording_gives_what_can_be_read(own: Path) -> None:
    file = own / "run.rrd"
    file.write_bytes(cut(file, 0.7))
    (own / "summary.json").unlink()
    run = worldsim.results.open(own)
    assert 0 < run.ended_s < run.scenario.duration_s
    assert run.poses.rows == len(run.ticks) * run.scenario.rows
    assert [note.split(":")[0] for note in run.notes] == [
        "The recording is cut off",
        f"It ends at {run.ended_s:.4g} s of 5 s.",
        "There is no summary.json, or none that can be read.",
    ]


def test_a_folder_without_a_recording_says_why(own: Path, tmp_path: Path) -> None:
    (own / "run.rrd").unlink()
    for path, says in (
        (tmp_path / "none", "no such run"),
        (own, "no recording in it: made with --no-recording, or its recording was removed"),
        (own / "logs", "not a run: no run.rrd in it"),
    ):
        with pytest.raises(RecordingError) as error:
            worldsim.results.open(path)
        assert str(error.value) == f"{path}: {says}"


def test_a_folder_of_many_runs_asks_for_one(own: Path) -> None:
    with pytest.raises(RecordingError, match="a folder of many runs; name one of them"):
        worldsim.results.open(own.parent)


def test_another_schema_is_named(own: Path) -> None:
    (own / "summary.json").write_text('{"schema": 2}')
    with pytest.raises(RecordingError, match=r"summary\.json: schema 2; .* reads schema 1$"):
        worldsim.results.open(own)


def test_a_foreign_recording_is_no_run(tmp_path: Path, own: Path) -> None:
    foreign = tmp_path / "foreign.rrd"
    with rr.RecordingStream("other") as stream:
        stream.save(foreign)
        stream.log("points", rr.Points3D([[0, 0, 0]]))
    with pytest.raises(RecordingError, match="holds no scenario"):
        worldsim.results.open(foreign)
    copy(own / "scenario.toml", tmp_path / "text.rrd")
    with pytest.raises(RecordingError, match="not a recording"):
        worldsim.results.open(tmp_path / "text.rrd")
