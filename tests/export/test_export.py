"""Exported files, read back by the tools they are for: the tables of the run."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pandas
import polars
import pytest
from mcap.reader import make_reader
from pyarrow import parquet

import worldsim.results
from tests.recording.flights import record, straight_flight, wedge
from worldsim.commands.app import command
from worldsim.export.export import ExportError, export
from worldsim.export.mcap_file import table_schema
from worldsim.judge.run_events import Killed, RoleChanged
from worldsim.recording.recorder import RunRecorder
from worldsim.results.run import Run
from worldsim.results.run_tables import LAYOUTS
from worldsim.scenario.obstacle_tables import Box, Cylinder, Sphere
from worldsim.scenario.tables import Scenario

OBSTACLES = (
    Sphere(centre_m=(9.0, 0.0, 0.0), radius_m=0.5),
    Box(centre_m=(9.0, 9.0, 0.0), size_m=(1.0, 2.0, 3.0), yaw_deg=-90.0),
    Cylinder(
        waypoints_m=((-9.0, 0.0, 0.0), (-9.0, 5.0, 0.0)), speed_mps=1.0, radius_m=1.0, height_m=4.0
    ),
)

GAPS = {
    name: {column.name: [""] for column in layout.columns if column.kind == "number"}
    for name, layout in LAYOUTS.items()
}
"""The columns in which an empty field of a CSV file is a number that was not measured."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A recorded second of five agents among obstacles, with events; a0's vehicle leaves."""
    file = tmp_path_factory.mktemp("flown") / "run.rrd"
    five = wedge(5, duration_s=1.0)
    scenario = Scenario(
        fleet=five.fleet, formation=five.formation, duration_s=1.0, obstacle=OBSTACLES
    )
    recorder, ticks = RunRecorder(file, scenario, "flown", mode="virtual"), []
    for tick in straight_flight(scenario):
        ticks.append(tick)
        tick.signals = {"gap": np.array([0.1, np.nan, -3.0, 1e9, tick.time_s])}
        if tick.index > 10:
            tick.position[0] = tick.target[0] = np.nan
    recorder.event(RoleChanged(t_s=0.05, agent=1, role="member"))
    recorder.event(Killed(t_s=0.5, agent=2, planned=True))
    record(recorder, scenario, ticks)
    return worldsim.results.open(file)


@pytest.fixture(scope="module")
def folder(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out") / "export"
    files = export(run, ["parquet", "csv", "mcap"], out)
    assert sorted(out.iterdir()) == files
    assert len(files) == 2 * len(LAYOUTS) + 2
    return out


@pytest.fixture(scope="module")
def messages(folder: Path) -> dict[str, list[tuple[int, Any, Any]]]:
    """The messages of each topic: time [ns], schema, content."""
    found: dict[str, list[tuple[int, Any, Any]]] = {}
    with (folder / "run.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            row = (message.log_time, json.loads(schema.data), json.loads(message.data))
            found.setdefault(channel.topic, []).append(row)
    return found


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_table_comes_back_from_parquet_and_csv(run: Run, folder: Path, name: str) -> None:
    table = run.tables[name]
    assert table.rows
    frames = (
        pandas.read_parquet(folder / f"{name}.parquet"),
        polars.read_parquet(folder / f"{name}.parquet"),
        pandas.read_csv(folder / f"{name}.csv", keep_default_na=False, na_values=GAPS[name]),
        polars.read_csv(folder / f"{name}.csv", infer_schema_length=None),
    )
    for frame in frames:
        assert list(frame.columns) == list(table)
        for column, values in table.items():
            np.testing.assert_array_equal(np.asarray(frame[column]), values)
    field = parquet.read_schema(folder / f"{name}.parquet").field(0)
    assert field.metadata[b"description"] == LAYOUTS[name].columns[0].says.encode()


def test_csv_says_what_each_column_holds(folder: Path) -> None:
    described = pandas.read_csv(folder / "columns.csv", keep_default_na=False)
    rows = [(name, *column) for name, layout in LAYOUTS.items() for column in layout.columns]
    assert [tuple(row) for row in described.itertuples(index=False)] == rows


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_table_comes_back_from_mcap(
    run: Run, messages: dict[str, list[tuple[int, Any, Any]]], name: str
) -> None:
    table, found = run.tables[name], messages[f"/{name}"]
    rows = [row for _, _, content in found for row in _rows(content)]
    assert len(rows) == table.rows
    for column in LAYOUTS[name].columns:
        values = [row[column.name] for row in rows]
        if column.kind == "number":
            values = [np.nan if value is None else value for value in values]
        np.testing.assert_array_equal(values, table[column.name])
    assert found[0][1] == json.loads(json.dumps(table_schema(table)))


def _rows(content: dict[str, Any]) -> Iterator[dict[str, Any]]:
    keys = {name: content[name] for name in ("t_s", "tick") if name in content}
    for row in content.get("rows", [content]):
        yield keys | row


def test_every_message_is_of_its_schema_and_in_order(
    messages: dict[str, list[tuple[int, Any, Any]]],
) -> None:
    assert set(messages) == {"/scene", "/log", *(f"/{name}" for name in LAYOUTS)}
    for found in messages.values():
        times_ns = [time_ns for time_ns, _, _ in found]
        assert times_ns == sorted(times_ns)
        for _, schema, content in found:
            jsonschema.validate(content, schema)


def test_a_scene_shows_vehicles_links_and_obstacles_where_they_are(
    run: Run, messages: dict[str, list[tuple[int, Any, Any]]]
) -> None:
    time_ns, _, scene = messages["/scene"][-1]
    tick = run.ticks[-1]
    assert time_ns == round(tick.time_s * 1e9)
    parts = {each["id"]: each for each in scene["entities"]}
    cubes = parts["vehicles"]["cubes"]
    shown = [[cube["pose"]["position"][axis] for axis in "xyz"] for cube in cubes]
    assert shown == tick.position[1:].tolist()  # a0 has left
    for cube, (yaw, _, _) in zip(cubes, tick.attitude[1:].tolist(), strict=True):
        turn = cube["pose"]["orientation"]
        assert 2.0 * np.arctan2(turn["z"], turn["w"]) == pytest.approx(yaw)
    assert [text["text"] for text in parts["names"]["texts"]] == ["a1", "a2", "a3", "a4"]
    (lines,) = parts["links"]["lines"]
    assert len(lines["points"]) == 2 * 6  # four agents, each pair once
    solids = parts["obstacles"]
    assert solids["spheres"][0]["size"] == {"x": 1.0, "y": 1.0, "z": 1.0}
    (box,), (cylinder,) = solids["cubes"], solids["cylinders"]
    turn = box["pose"]["orientation"]
    assert 2.0 * np.arctan2(turn["z"], turn["w"]) == pytest.approx(-np.pi / 2)
    assert cylinder["pose"]["position"]["y"] == pytest.approx(tick.time_s)


def test_the_log_has_the_events_in_words(
    messages: dict[str, list[tuple[int, Any, Any]]],
) -> None:
    told = [(content["message"], content["level"]) for _, _, content in messages["/log"]]
    assert told == [("a1 becomes a member", 2), ("a2 is killed; its vehicle hovers (scheduled)", 3)]


def test_nothing_is_overwritten_and_no_draft_is_left(run: Run, tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("mine")
    with pytest.raises(ExportError, match=r"poses\.csv: exists; nothing is overwritten"):
        export(run, ["csv"], tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["poses.csv"]
    assert (tmp_path / "poses.csv").read_text() == "mine"


def test_the_command_writes_into_the_runs_folder(
    run: Run, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    recording = tmp_path / "run.rrd"
    recording.write_bytes(run.path.read_bytes())
    assert command(["export", str(tmp_path)]) == 0
    printed = capsys.readouterr()
    assert printed.out.splitlines()[0] == str(tmp_path / "export" / "agents.parquet")
    assert "There is no summary.json" in printed.err
    assert command(["export", str(tmp_path / "none")]) == 2
    assert capsys.readouterr().err == f"{tmp_path / 'none'}: no such run\n"
