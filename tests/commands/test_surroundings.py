"""Whatever surrounds a command: it is right, or says in one line why not. Never a traceback."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from tests.commands.conftest import PROGRESS, Command
from tests.small_scenario import SMALL
from worldsim.commands.app import command
from worldsim.results.output_streams import SafeStream, escaped

ROOT = Path(__file__).parents[2]
PROGRAM = "from worldsim.commands.app import main; main()"
SIM = f"'{sys.executable}' -c '{PROGRAM}' sim small.toml --out out --duration 0.3 --set expect.converge=false"  # noqa: E501
QUICK = f"{SIM} --no-recording"


def ran(
    line: str, environment: Mapping[str, str | None] | None = None, folder: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a line of shell; None removes a variable."""
    own = {"PYTHONPATH": str(ROOT)} | dict(environment or {})
    kept = {name: value for name, value in os.environ.items() if name not in own}
    given = {name: value for name, value in own.items() if value is not None}
    ended = subprocess.run(
        ["bash", "-c", line],
        capture_output=True,
        text=True,
        check=False,
        timeout=60.0,
        cwd=folder,
        env={**kept, **given},
    )
    ended.stderr = PROGRESS.sub("", ended.stderr)  # of a slow host
    return ended


def outcome() -> Any:
    return json.loads(Path("out/summary.json").read_text())["outcome"]


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize(
    "environment",
    [
        {"MPLBACKEND": "module://matplotlib_inline.backend_inline"},
        {"PYTHONIOENCODING": "ascii"},
        {"LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"HOME": None, "TMPDIR": "/nonexistent", "TERM": "dumb", "NO_COLOR": "1", "TZ": "junk"},
        {"PYTHONOPTIMIZE": "2", "PYTHONHASHSEED": "0", "LC_NUMERIC": "junk"},
        {"ZENOH_RUNTIME": "junk", "ZENOH_CONFIG": "/nonexistent", "RUST_LOG": "junk,,="},
    ],
    ids=lambda environment: next(iter(environment)),
)
def test_an_odd_environment_changes_nothing(environment: dict[str, str | None]) -> None:
    ended = ran(QUICK, environment)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert outcome() == "pass"
    assert ended.stdout.endswith("pass  out/summary.json\n")


@pytest.mark.usefixtures("small")
def test_a_recording_is_made_whatever_rerun_is_told() -> None:
    ended = ran(SIM, {"RERUN": "off", "RERUN_STRICT": "0"})
    assert (ended.returncode, ended.stderr) == (0, "")
    assert Path("out/run.rrd").stat().st_size > 10_000


@pytest.mark.parametrize("backend", ["nonsense", "module://none.there", "TkAgg"])
def test_pictures_are_drawn_whatever_a_notebook_has_set(backend: str) -> None:
    prepare = "from worldsim.results.environment import prepare_environment as p; p()"
    program = f"{prepare}; from worldsim.link_check import plot; print('drawn')"
    ended = ran(f"'{sys.executable}' -c \"{program}\"", {"MPLBACKEND": backend})
    assert (ended.returncode, ended.stdout) == (0, "drawn\n"), ended.stderr


@pytest.mark.usefixtures("small")
def test_own_modules_with_our_names_do_no_harm() -> None:
    Path("agent.py").write_text("raise ValueError('not this one')")
    Path("netem").mkdir()
    Path("netem/__init__.py").write_text("raise ValueError('nor this one')")
    ended = ran(QUICK, {"PYTHONPATH": f"{Path.cwd()}:{ROOT}"})
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_a_closed_output_loses_only_what_is_printed(closed: str) -> None:
    assert ran(f"{SIM} {closed}").returncode == 0
    assert outcome() == "pass"
    assert Path("out/run.rrd").stat().st_size > 10_000


@pytest.mark.usefixtures("small")
def test_a_full_output_is_one_line_and_no_pass() -> None:
    ended = ran(f"{QUICK} >/dev/full")
    assert ended.returncode == 1
    assert ended.stderr == "qswarm: stdout cannot be written: no space left on device\n"
    assert outcome() == "pass"


@pytest.mark.usefixtures("small")
def test_a_removed_folder_is_one_line() -> None:
    ended = ran(f"mkdir gone; cd gone; rmdir ../gone; {QUICK.replace('small.toml', 'wedge-9')}")
    assert ended.returncode == 2
    assert ended.stderr == "qswarm: the current folder was removed\n"


@pytest.mark.usefixtures("small")
def test_few_descriptors_are_enough_or_named() -> None:
    assert ran(f"ulimit -n 64; {SIM}").returncode == 0
    ended = ran(f"ulimit -n 40; {QUICK.replace(' sim ', ' run ')} --out other")
    assert ended.returncode == 2
    assert "needs 66 file descriptors, and only 40 are allowed (ulimit -n)" in ended.stderr
    assert "Traceback" not in ended.stderr


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain \u00e9\u4e2d\tand\n", "plain \u00e9\u4e2d\tand\n"),
        ("\x1b]0;title\x07", "\\x1b]0;title\\x07"),
        ("\r\x9b\x7f", "\\x0d\\x9b\\x7f"),
        ("\u202eevil\u2066", "\\u202eevil\\u2066"),
        ("\udc80", "\\udc80"),
    ],
)
def test_control_characters_are_shown_not_obeyed(text: str, shown: str, tmp_path: Path) -> None:
    assert escaped(text) == shown
    with (tmp_path / "out").open("wb") as file:
        stream = SafeStream(file.fileno(), "utf-8")
        stream.write(text)
        stream.flush()
    assert (tmp_path / "out").read_text() == shown


@pytest.mark.usefixtures("small")
def test_control_characters_of_a_path_and_a_name_are_escaped() -> None:
    small = Path("small.toml")
    Path("evil\x1b[2J.toml").write_text(small.read_text())
    ended = ran(QUICK.replace("small.toml", "evil\x1b[2J.toml --set nonsense=1"))
    assert ended.returncode == 2
    assert "\x1b" not in ended.stderr
    assert "evil\\x1b[2J.toml: nonsense" in ended.stderr
    assert len(ended.stderr.splitlines()) == 1


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """A recorded run."""
    (tmp_path / "small.toml").write_text(SMALL)
    assert command(["sim", str(tmp_path / "small.toml"), "--out", str(tmp_path / "out")]) == 0
    return tmp_path / "out"


def test_a_summary_that_is_none_is_no_traceback(recorded: Path, qswarm: Command) -> None:
    """More such files are compared in the recording's test_edited_summary.py."""
    (recorded / "summary.json").write_text("[" * 100_000)
    ended = qswarm("verify", recorded)
    assert ended.status != 0
    assert "Traceback" not in ended.err + ended.out
