"""The folder of a sweep: it goes on where it was cut off, and is never another sweep's."""

import json
from pathlib import Path

import pytest

from worldsim.results.run_folder import RunDirectoryError
from worldsim.sweep.flight_row import FlightRow
from worldsim.sweep.journal import LINES, Identity, Journal, read_sweep
from worldsim.sweep.plan import FlightKey

IDENTITY: Identity = {
    "schema": 1,
    "scenario": "small",
    "vary": [("netem.loss_percent", ["0", "50"])],
    "seeds": (0, 4),
    "content_sha256": "a",
    "controllers": {},
    "version": "1",
    "commit": "c0ffee",
    "commit_dirty": False,
    "python": "3.11",
    "packages": {},
}


def row(cell: int, seed: int, outcome: str = "pass") -> FlightRow:
    return {
        "cell": cell, "seed": seed, "outcome": outcome, "reason": None, "figures": {},
        "trace_sha256": None,
    }  # type: ignore[typeddict-item]  # fmt: skip


def test_a_sweep_goes_on_and_a_line_that_was_cut_off_is_flown_again(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "s", IDENTITY)
    for each in (row(0, 0), row(1, 0), row(0, 1)):
        journal.append(each)
    journal.close()
    lines = tmp_path / "s" / LINES
    lines.write_bytes(lines.read_bytes()[:-5])
    again = Journal(tmp_path / "s", IDENTITY)
    assert list(again.rows) == [FlightKey(0, 0), FlightKey(1, 0)]
    again.append(row(0, 1, "fail"))
    again.append(row(0, 1))  # flown twice: the first counts
    again.close()
    assert len(lines.read_bytes().splitlines()) == 3
    plan, _, rows = read_sweep(tmp_path / "s")
    assert [each["outcome"] for each in rows.values()] == ["pass", "pass", "fail"]
    assert len(plan) == 8


def test_of_two_lines_of_one_flight_the_first_counts(tmp_path: Path) -> None:
    Journal(tmp_path / "s", IDENTITY).close()
    twice = [json.dumps(row(0, 0, outcome)) + "\n" for outcome in ("fail", "pass")]
    (tmp_path / "s" / LINES).write_text("".join(twice))
    journal = Journal(tmp_path / "s", IDENTITY)
    journal.close()
    for rows in (journal.rows, read_sweep(tmp_path / "s")[2]):
        assert [each["outcome"] for each in rows.values()] == ["fail"]


def test_one_process_at_a_time(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "s", IDENTITY)
    with pytest.raises(RunDirectoryError, match="another process flies this sweep"):
        Journal(tmp_path / "s", IDENTITY)
    journal.close()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"commit": "bad"}, r"\(what differs: the commit of qswarm\)"),
        ({"vary": [("netem.loss_percent", ["0"])]}, r"\(what differs: what is varied\)"),
        ({"content_sha256": "b"}, "the scenario's content, or a --set"),
        ({"controllers": {"mine:Mine": "d"}}, "the code of a controller"),
        ({"seeds": (1, 4)}, "seeds 0:4, which can only grow"),
        ({"seeds": (0, 3)}, "seeds 0:4, which can only grow"),
    ],
)
def test_another_sweeps_folder_is_refused(
    tmp_path: Path, change: dict[str, object], says: str
) -> None:
    Journal(tmp_path / "s", IDENTITY).close()
    before = {file: file.read_bytes() for file in (tmp_path / "s").iterdir()}
    with pytest.raises(RunDirectoryError, match=says):
        Journal(tmp_path / "s", {**IDENTITY, **change})  # type: ignore[typeddict-item]
    assert {file: file.read_bytes() for file in (tmp_path / "s").iterdir()} == before


def test_more_seeds_go_on(tmp_path: Path) -> None:
    Journal(tmp_path / "s", IDENTITY).close()
    Journal(tmp_path / "s", {**IDENTITY, "seeds": (0, 6)}).close()
    assert read_sweep(tmp_path / "s")[0].seeds == range(6)


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(RunDirectoryError, match="holds no sweep; nothing is overwritten"):
        Journal(tmp_path, IDENTITY)
    assert [file.name for file in tmp_path.iterdir()] == ["notes.txt"]
