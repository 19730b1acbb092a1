"""A disk that is full at the start is bad input; one that fills up later costs no figures."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.commands.conftest import PROGRESS
from tests.small_scenario import SMALL

LIMITED = """
import resource, sys
from worldsim.commands.app import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
sys.argv[1:2] = []
main()
"""
"""``qswarm`` on a disk on which no file can grow beyond a size [bytes]."""
FILLING = """
import errno, os, sys
from worldsim.commands.app import main
files = int(sys.argv[1])
allocate = os.posix_fallocate
def filling(*place):
    global files
    files -= 1
    if files < 0:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    allocate(*place)
os.posix_fallocate = filling
sys.argv[1:2] = []
main()
"""
"""``qswarm`` on a disk that is full once room was reserved for so many files."""
UNWRITTEN = """
import errno, os
from worldsim.results import run_folder
from worldsim.commands.app import main
write = run_folder.write_json
def full(path, content):
    if (path.parent / "scenario.toml").exists():
        raise run_folder.RunWriteError(path, "no space left on device")
    write(path, content)
run_folder.write_json = full
main()
"""
"""``qswarm`` on a disk that has lost the room reserved for each run's summary."""


def limited(room_b: int, *arguments: str) -> subprocess.CompletedProcess[str]:
    return qswarm_on(LIMITED, str(room_b), *arguments)


def qswarm_on(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", program, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(SMALL)
    return tmp_path


@pytest.mark.parametrize("command", ["sim", "run"])
@pytest.mark.parametrize("room_b", [0, 300, 20_000])
def test_no_room_at_the_start_is_one_line_and_leaves_nothing(
    small: Path, command: str, room_b: int
) -> None:
    ended = limited(room_b, command, "small.toml", "--out", "run")
    assert ended.returncode == 2
    assert ended.stderr == "run: file too large\n"
    assert sorted(each.name for each in small.iterdir()) == ["small.toml"]


def test_a_disk_that_fills_up_in_flight_keeps_the_figures_and_is_no_pass(small: Path) -> None:
    ended = limited(200_000, "sim", "small.toml", "--out", "run")
    assert ended.returncode == 3
    assert PROGRESS.sub("", ended.stderr).count("\n") == 1
    made = json.loads((small / "run/summary.json").read_text())
    assert made["outcome"] == "inconclusive"
    assert made["reason"].startswith("results were lost: recording: run.rrd ends here")
    assert made["min_separation_m"] > 1.0
    assert all(row["held"] for row in made["expectations"])
    assert "inconclusive (results were lost: " in ended.stdout
    verified = limited(200_000, "verify", "run")
    assert verified.returncode == 3
    assert not (small / "run/.reserve").exists()


@pytest.mark.parametrize("room_b", [0, 300, 20_000])
def test_no_room_for_the_first_of_many_runs_leaves_nothing(small: Path, room_b: int) -> None:
    ended = limited(room_b, "sim", "small.toml", "--seeds", "0:3", "--out", "many")
    assert (ended.returncode, ended.stderr) == (2, "many: file too large\n")
    assert sorted(each.name for each in small.iterdir()) == ["small.toml"]


def test_a_first_run_without_room_leaves_no_folder_of_many(small: Path) -> None:
    ended = qswarm_on(FILLING, "1", "sim", "small.toml", "--seeds", "0:3", "--out", "many")
    assert ended.returncode == 2
    told = PROGRESS.sub("", ended.stderr)
    assert told == "many/small-seed0: no space left on device\n"
    assert sorted(each.name for each in small.iterdir()) == ["small.toml"]


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_disk_that_fills_up_between_seeds_keeps_the_rows(small: Path, jobs: str) -> None:
    options = ("--no-recording", "--seeds", "0:4", "--jobs", jobs, "--out", "many")
    ended = qswarm_on(FILLING, "3", "sim", "small.toml", *options)
    assert ended.returncode == 3
    made = json.loads((small / "many/summary.json").read_text())
    assert [row["run"] for row in made["rows"]] == ["small-seed0", "small-seed1"]
    assert [row["outcome"] for row in made["rows"]] == ["pass", "pass"]
    reason = "many/small-seed2: no space left on device: 2 of 4 runs done"
    assert (made["outcome"], made["reason"]) == ("inconclusive", reason)
    assert f"inconclusive ({reason})" in ended.stdout
    assert not list((small / "many").rglob(".reserve"))


def test_a_summary_that_cannot_be_written_is_inconclusive(small: Path) -> None:
    ended = qswarm_on(UNWRITTEN, "sim", "small.toml", "--no-recording", "--out", "run")
    assert ended.returncode == 3
    assert ended.stderr.splitlines()[-1] == "run: summary.json: no space left on device"


def test_a_seed_whose_summary_cannot_be_written_is_an_inconclusive_row(small: Path) -> None:
    options = ("--no-recording", "--seeds", "0:2", "--out", "many")
    ended = qswarm_on(UNWRITTEN, "sim", "small.toml", *options)
    assert ended.returncode == 3
    made = json.loads((small / "many/summary.json").read_text())
    row = ("inconclusive", "summary.json: no space left on device")
    assert [(each["outcome"], each["reason"]) for each in made["rows"]] == [row, row]
