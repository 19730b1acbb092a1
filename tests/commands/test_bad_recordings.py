"""Recordings that are missing, damaged or foreign: each command says in a line what is wrong."""

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.commands.conftest import Command
from tests.processes.harness import rrd_verify
from tests.small_scenario import SMALL
from worldsim.commands.app import command
from worldsim.recording import viewer

READERS = ("report", "picture", "video", "export", "verify")


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a short run."""
    base = tmp_path_factory.mktemp("flown")
    (base / "small.toml").write_text(SMALL)
    out = str(base / "run")
    assert command(["sim", str(base / "small.toml"), "--duration", "2", "--out", out]) in (1, 3)
    return base / "run"


@pytest.fixture
def run(flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the run in the current folder, to damage."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(flown, tmp_path / "run")
    return Path("run")


def removed(run: Path) -> None:
    (run / "run.rrd").unlink()


def gone(run: Path) -> None:
    shutil.rmtree(run)


def bare(run: Path) -> None:
    gone(run)
    run.mkdir()


def text(run: Path) -> None:
    (run / "run.rrd").write_text("no recording, but text")


def empty(run: Path) -> None:
    (run / "run.rrd").write_bytes(b"")


def only_begun(run: Path) -> None:
    (run / "run.rrd").write_bytes((run / "run.rrd").read_bytes()[:8])


def damaged(run: Path) -> None:
    content = bytearray((run / "run.rrd").read_bytes())
    half = len(content) // 2
    content[half : half + 2000] = b"\xff" * 2000
    (run / "run.rrd").write_bytes(content)


def foreign(run: Path) -> None:
    import rerun as rr  # noqa: PLC0415 - a second that other tests save

    stream = rr.RecordingStream("another_program")
    stream.save(run / "run.rrd")
    stream.log("points", rr.Points3D([[0, 0, 0]]))
    stream.disconnect()


def other_schema(run: Path) -> None:
    summary = run / "summary.json"
    summary.write_text(summary.read_text().replace('"schema": 1,', '"schema": 7,'))


@pytest.mark.parametrize(
    ("damage", "says", "refused_by"),
    [
        (gone, "no such r", READERS),
        (bare, "no run.rrd in it|no recording in it|no such recording", READERS),
        (removed, "no recording in it|no such recording", READERS),
        (text, "not a recording", READERS),
        (empty, "not a recording", READERS),
        (only_begun, "not a recording", READERS),
        (damaged, "run/run.rrd: (cannot be read|damaged): ", READERS[-2:]),
        (foreign, "holds no scenario: it is no run's, or not whole", READERS[-2:]),
        (other_schema, "schema 7; this version of qswarm reads schema 1", READERS[:-1]),
    ],
)
def test_what_cannot_be_read_is_one_line_and_writes_nothing(
    run: Path,
    qswarm: Command,
    damage: Callable[[Path], None],
    says: str,
    refused_by: tuple[str, ...],
) -> None:
    damage(run)
    before = files_of(run)
    for name in refused_by:
        printed = qswarm(name, "run")
        expected = (2, 3) if name == "verify" else (2,)
        assert printed.status in expected, printed
        assert (printed.out, printed.err.count("\n")) == ("", 1), printed
        assert re.search(says, printed.err), printed
        assert "/tmp/tmp" not in printed.err
    assert files_of(run) == before


def files_of(run: Path) -> list[Path]:
    return sorted(run.rglob("*"))


@pytest.mark.parametrize("damage", [gone, bare, removed, text, empty, only_begun])
def test_what_is_no_recording_is_not_shown(
    run: Path, qswarm: Command, damage: Callable[[Path], None]
) -> None:
    damage(run)
    for web in ((), ("--web",)):
        printed = qswarm("view", "run", *web)
        assert (printed.status, printed.out, printed.err.count("\n")) == (2, "", 1), printed


def test_a_recording_that_is_cut_off_is_shown_and_read_with_a_note(
    run: Path, qswarm: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = (run / "run.rrd").read_bytes()
    # The first two fifths are the layout; all ticks come in the next one.
    (run / "run.rrd").write_bytes(content[: 45 * len(content) // 100])
    shown: list[Path] = []
    monkeypatch.setattr(viewer, "view", lambda found, _: shown.extend(found) or 0)
    printed = qswarm("view", "run")
    note = "run/run.rrd: cut off, or still being written; shown as far as it is\n"
    assert (printed.status, printed.err, shown) == (0, note, [Path("run/run.rrd")])
    printed = qswarm("export", "run", "--csv")
    assert printed.status == 0
    assert "run: The recording is cut off: its end was never written.\n" in printed.err
    assert "run: It ends at " in printed.err
    assert qswarm("verify", "run").status == 3


@pytest.mark.parametrize(("kept", "status"), [(1.0, 0), (0.75, 1)])
def test_rerun_finds_a_whole_recording_valid(run: Path, kept: float, status: int) -> None:
    content = (run / "run.rrd").read_bytes()
    (run / "run.rrd").write_bytes(content[: int(len(content) * kept)])
    assert rrd_verify(run / "run.rrd") == status
