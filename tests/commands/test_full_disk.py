"""A disk that is full at the start is bad input; one that fills up later costs no figures."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.small_scenario import SMALL

LIMITED = """
import resource, sys
from worldsim.commands.app import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
sys.argv[1:2] = []
main()
"""
"""``qswarm`` on a disk on which no file can grow beyond a size [bytes]."""


def limited(room_b: int, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", LIMITED, str(room_b), *arguments]
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
    assert ended.stderr.count("\n") == 1
    made = json.loads((small / "run/summary.json").read_text())
    assert made["outcome"] == "inconclusive"
    assert made["reason"].startswith("results were lost: recording: run.rrd ends here")
    assert made["min_separation_m"] > 1.0
    assert all(row["held"] for row in made["expectations"])
    assert "inconclusive (results were lost: " in ended.stdout
    verified = limited(200_000, "verify", "run")
    assert verified.returncode == 3
    assert not (small / "run/.reserve").exists()
