"""Controllers agree in their own words, without beacons, over a bad radio; in C as in Python."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from agent.messages import DATAGRAM_HEAD_B
from tests.tutorial.meeting import assert_agreed, save_files, trace_of
from worldsim.commands.app import command


def fly(folder: Path, name: str, *settings: str) -> Path:
    run = folder / name
    options = [part for each in ("duration_s=8", *settings) for part in ("--set", each)]
    assert command(["sim", str(folder / "meeting.toml"), "--out", str(run), *options]) == 0
    return run


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    save_files(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_all_agree_and_only_their_words_are_on_the_air(folder: Path) -> None:
    run = fly(folder, "python")
    assert_agreed(run)
    summary = json.loads((run / "summary.json").read_text())
    said, flown_s = summary["datagrams"], 8.05
    for agent, rate in enumerate(summary["bytes_per_s"]["local"]):
        count, own_b = said["sent"][agent], said["sent_b"][agent]
        assert count > 10
        # All of them are short, so each has one byte less before it than the longest.
        assert rate * flown_s == pytest.approx(own_b + count * (DATAGRAM_HEAD_B - 1))
    assert not any(summary["bytes_per_s"]["multihop"])
    lines = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
    logged = [row["text"] for row in lines if row["kind"] == "log" and row["agent"] == 4]
    assert logged[-1] == "knows of 9"


def test_the_same_controller_in_c_says_the_same_words(folder: Path) -> None:
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    build = "gcc -O2 -ffp-contract=off -o meeting meeting.c -lm"
    subprocess.run(build, shell=True, check=True, cwd=folder)
    in_c = folder / "in_c.toml"
    text = (folder / "meeting.toml").read_text()
    by_command = 'command = ["./meeting"]\nservices = []'
    in_c.write_text(text.replace('controller = "meeting:Meeting"', by_command))
    options = ["--no-recording", "--set", "duration_s=8"]
    assert command(["sim", str(in_c), "--out", str(folder / "c"), *options]) == 0
    assert trace_of(folder / "c") == trace_of(fly(folder, "python"))
