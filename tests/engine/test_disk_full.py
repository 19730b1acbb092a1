"""A disk that is full for a while: what was to be written is lost, and the flight goes on."""

import json
import sys
from pathlib import Path

import pytest

from tests.commands.test_full_disk import qswarm_on
from tests.small_scenario import SMALL

PLAIN = "from worldsim.commands.app import main; main()"
FAULT = "[[event]]\nat_s = 1.5\n{more}disk_full = true\n"
PARTED = "[[event]]\nat_s = 2\npartition = [[0]]\nfor_s = 0.25\n"
LATER = "[[event]]\nat_s = 4.5\nheal = true\n"


def flown(folder: Path, text: str, *options: str, command: str = "sim") -> tuple[int, dict, str]:
    (folder / "small.toml").write_text(SMALL + text)
    run = folder / "run"
    ended = qswarm_on(PLAIN, command, str(folder / "small.toml"), "--out", str(run), *options)
    return ended.returncode, json.loads((run / "summary.json").read_text()), ended.stdout


def kinds(folder: Path) -> list[str]:
    lines = (folder / "run/events.jsonl").read_text().splitlines()
    wanted = ("disk_full", "partition", "heal")
    return [each["kind"] for each in map(json.loads, lines) if each["kind"] in wanted]


@pytest.mark.parametrize("command", ["sim", "run"])
def test_recording_and_events_are_lost_and_the_flight_is_not(tmp_path: Path, command: str) -> None:
    text = FAULT.format(more="for_s = 2\n") + PARTED
    status, summary, told = flown(tmp_path, text, command=command)
    assert (status, summary["outcome"]) == (3, "inconclusive"), told
    assert summary["reason"].startswith("results were lost: ")
    assert "no space left on device" in summary["reason"].lower()
    assert summary["duration_s"] == 5.0
    assert all(row["held"] for row in summary["expectations"])
    (row,) = (each for each in summary["faults"] if each["kind"] == "disk_full")
    assert (row["from_s"], row["to_s"], row["agents"]) == (1.5, 3.5, None)
    assert row["writes"] >= 3, "the partition, its end, and the recording's next second"
    assert kinds(tmp_path) == ["disk_full", "disk_full"]
    verified = qswarm_on(PLAIN, "verify", str(tmp_path / "run"))
    assert verified.returncode == 3
    if command == "run":
        assert "no space left on device" in told.lower().split("minimum separation")[-1] or (
            "ends here, the run continues" in told
        )


def test_two_faults_of_the_disk_end_by_themselves(tmp_path: Path) -> None:
    second = "[[event]]\nat_s = 1.75\nfor_s = 1\ndisk_full = true\n"
    text = FAULT.format(more="for_s = 0.5\n") + second + PARTED
    _, summary, _ = flown(tmp_path, text, "--no-recording")
    first, later = (each for each in summary["faults"] if each["kind"] == "disk_full")
    assert (first["to_s"], later["to_s"]) == (2.0, 2.75)
    assert later["writes"] >= 2
    assert kinds(tmp_path)[-1] == "disk_full"


def test_a_full_disk_to_which_nothing_is_written_proves_nothing(tmp_path: Path) -> None:
    status, summary, told = flown(tmp_path, FAULT.format(more="for_s = 0.1\n"), "--no-recording")
    assert status == 3
    reason = "the disk_full at 1.5 s (nothing was to be written meanwhile) struck nothing"
    assert summary["reason"] == reason
    assert "disk_full, 1.5 s to 1.6 s: struck nothing: nothing was to be written meanwhile" in told


@pytest.mark.parametrize(
    ("at_s", "more", "kept"),
    [("1.5", "for_s = 0.05\n", "30 ticks, 1.45 s"), ("4.97", "", "100 ticks, 4.95 s")],
)
def test_what_a_full_disk_refuses_counts_however_short_and_late_it_is(
    tmp_path: Path, at_s: str, more: str, kept: str
) -> None:
    fault = FAULT.format(more=more).replace("1.5", at_s)
    jam = "[[event]]\nat_s = 1\nfor_s = 0.5\njam = { centre_m = [50, 0, 0], radius_m = 1 }\n"
    _, summary, told = flown(tmp_path, fault + jam)
    assert summary["reason"].startswith("results were lost: recording: run.rrd ends here")
    assert summary["reason"].endswith("; the jam at 1 s struck nothing")
    (row,) = (each for each in summary["faults"] if each["kind"] == "disk_full")
    assert row["writes"] == 1
    assert "let 1 write fail" in told
    assert kept in qswarm_on(PLAIN, "verify", str(tmp_path / "run")).stdout


def test_a_full_disk_cannot_be_denied() -> None:
    ended = qswarm_on(
        "from worldsim.scenario.file import parse\n"
        "import sys\nfrom tests.small_scenario import SMALL\n"
        "try:\n    parse(SMALL + '[[event]]\\nat_s = 1\\ndisk_full = false\\n')\n"
        "except Exception as error:\n    print(error)\n"
    )
    assert "event[0].disk_full: only true is allowed" in ended.stdout, (ended, sys.path)
