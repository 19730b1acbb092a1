"""sweep: every cell and seed once, its table, and what is refused before anything starts."""

import json
import signal
from pathlib import Path

import pytest
from pyarrow import csv, parquet

from tests.commands.conftest import Command
from tests.processes.harness import QSWARM, Started, eventually

VARIED = ("--vary", "netem.loss_percent=0,100")


def test_a_sweep_is_a_tidy_table_and_goes_on(small: Path, qswarm: Command) -> None:
    limit = ("--set", "expect.converge_within_s=2.0", "--duration", "4.5")
    first = qswarm("sweep", small, *VARIED, *limit, "--seeds", "0:1", "--out", "s")
    assert first.status == 1  # no agent of two can hear the other at 100 %
    assert "netem.loss_percent: breaks at a value between 0 (all pass) and 100" in first.out
    assert "repeat a failure: qswarm sim " in first.out
    lines = Path("s/flights.jsonl").read_text()
    again = qswarm("sweep", small, *VARIED, *limit, "--seeds", "0:2", "--out", "s")
    assert again.status == 1
    assert Path("s/flights.jsonl").read_text().startswith(lines)
    flights = parquet.read_table("s/flights.parquet")
    assert flights.num_rows == csv.read_csv("s/flights.csv").num_rows == 4
    rows = {(row["netem.loss_percent"], row["seed"]): row for row in flights.to_pylist()}
    assert {key: row["outcome"] for key, row in rows.items()} == {
        (0, 0): "pass", (0, 1): "pass", (100, 0): "fail", (100, 1): "fail",
    }  # fmt: skip
    # A flight of a sweep is that of `qswarm sim`.
    setting = ("--set", "netem.loss_percent=100", "--seed", "1")
    qswarm("sim", small, *limit, *setting, "--no-recording", "--out", "one")
    alone = json.loads(Path("one/summary.json").read_text())
    assert rows[100, 1]["trace_sha256"] == alone["trace_sha256"]
    assert rows[100, 1]["min_separation_m"] == alone["min_separation_m"]
    assert csv.read_csv("s/cells.csv").num_rows == 2
    figures = sorted(file.name for file in Path("s/figures").iterdir())
    assert figures == ["along-netem.loss_percent.png", "along-netem.loss_percent.svg"]
    assert not Path("s/.flights").exists()


def test_ctrl_c_says_how_far_a_sweep_is_and_it_goes_on(small: Path, qswarm: Command) -> None:
    options = ("sweep", str(small), "--vary", "duration_s=4,4000", "--seeds", "0:1", "--out", "s")
    flights = Path("s/flights.jsonl")
    with Started([*QSWARM, *options, "--jobs", "1"], Path("output"), Path.cwd()) as started:
        eventually(lambda: flights.exists() and flights.read_text().count("\n") == 1, 20.0)
        eventually(lambda: any(Path("s/.flights").glob("*/events.jsonl")), 20.0)
        started.process.send_signal(signal.SIGINT)
        assert started.status(within_s=20.0) == 130, small
    how_far = "interrupted: 1 of 2 flights done"
    told = f"{how_far}, 1 pass, 0 fail; the same command with --out s goes on  s/summary.json"
    assert told in started.text.splitlines()
    assert "fail:" not in started.text
    made = json.loads(Path("s/summary.json").read_text())
    assert (made["outcome"], made["reason"]) == ("inconclusive", how_far)
    assert len(flights.read_text().splitlines()) == 1


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--vary", "netem.los_percent=0,1"], "netem.los_percent: unknown key; did you mean"),
        (["--vary", "netem.loss_percent=0,150"], "netem.loss_percent: got 150"),
        (["--vary", "netem.loss_percent="], "--vary: netem.loss_percent: has no value"),
        (["--vary", "netem.loss_percent=1", "--seeds", "3:3"], "--seeds: '3:3'"),
        (
            ["--vary", "netem.loss_percent=1", "--set", "netem.loss_percent=2"],
            "--vary: netem.loss_percent: is set as well",
        ),
        (["--vary", "control.controller=q_structure,no.such:One"], "control.controller: "),
        (["--vary", "netem.loss_percent=1", "--out", "taken"], "holds no sweep"),
        ([], "--vary"),
    ],
)
def test_bad_input_is_refused_before_anything_starts(
    small: Path, qswarm: Command, options: list[str], says: str
) -> None:
    Path("taken").mkdir()
    Path("taken/mine.txt").touch()
    printed = qswarm("sweep", small, *options)
    assert (printed.status, printed.out) == (2, "")
    assert says in printed.err
    assert printed.err.count("\n") == 1
    assert sorted(file.name for file in Path().iterdir()) == ["small.toml", "taken"]
