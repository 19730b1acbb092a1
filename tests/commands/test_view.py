"""view: which recordings it opens, its errors, and that it serves loopback alone."""

import re
import shutil
import signal
import urllib.request
from pathlib import Path

import pytest

from tests.commands.conftest import Command
from tests.processes.harness import QSWARM, Started, eventually
from tests.small_scenario import SMALL
from worldsim.commands.app import command
from worldsim.recording.viewer import recordings


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recorded runs in one folder."""
    base = tmp_path_factory.mktemp("flown")
    (base / "small.toml").write_text(SMALL)
    options = ["--seeds", "1:3", "--duration", "0.5", "--jobs", "1", "--out", str(base / "two")]
    assert command(["sim", str(base / "small.toml"), *options]) == 1
    return base / "two"


@pytest.fixture
def recorded(small: Path, flown: Path) -> Path:
    """A copy of the two runs beside the small scenario, in the current folder."""
    return Path(shutil.copytree(flown, small.parent / "two"))


def test_a_run_a_recording_and_a_folder_of_runs_are_found(recorded: Path) -> None:
    both = [recorded / "small-seed1" / "run.rrd", recorded / "small-seed2" / "run.rrd"]
    assert recordings([recorded]) == both
    assert recordings([recorded / "small-seed2", both[0]]) == both[::-1]


@pytest.mark.parametrize("web", [[], ["--web"]])
def test_no_recording_is_one_line_and_exit_2(small: Path, qswarm: Command, web: list[str]) -> None:
    small.with_name("bare").mkdir()
    for run, says in (("none", "none: no such run"), ("bare", "bare: no recording in it")):
        printed = qswarm("view", run, *web)
        assert (printed.status, printed.out, printed.err.count("\n")) == (2, "", 1)
        assert printed.err.startswith(says)


def test_without_a_display_the_browser_is_named(
    recorded: Path, qswarm: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    for display in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(display, raising=False)
    printed = qswarm("view", recorded)
    assert (printed.status, printed.out) == (2, "")
    assert "--web" in printed.err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_browser_is_served_on_loopback_until_it_is_ended(
    recorded: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    configuration = recorded.parent / "configuration"
    monkeypatch.setenv("XDG_CONFIG_HOME", str(configuration))
    arguments = [*QSWARM, "view", "two", "--web"]
    with Started(arguments, recorded.parent / "output", recorded.parent) as started:
        started.wait_for_output("Ctrl-C ends it")
        address = re.search(r"http://127\.0\.0\.1:\d+/", started.text)
        assert address is not None
        eventually(lambda: answers(address[0]), 20.0, lambda: started.text)
        started.process.send_signal(number)
        assert started.status(within_s=10.0) == 0
        eventually(lambda: not answers(address[0]), 10.0)
    assert not configuration.exists()


def answers(address: str) -> bool:
    try:
        with urllib.request.urlopen(address, timeout=1.0) as page:
            html = page.read().lower()
            return b"rerun" in html and b'<link rel="preconnect"' not in html
    except OSError:
        return False
