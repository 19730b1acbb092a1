"""A controller that fails fails its own run, named, whatever it does to the run's process."""

import json
import os
import re
import signal
import subprocess
import threading
from itertools import count
from pathlib import Path

import pytest

from netem.wire.shutdown import stop_requests
from tests.commands.conftest import Command, qswarm, small  # noqa: F401 - fixtures
from tests.processes.harness import QSWARM, Started, eventually
from worldsim.campaign import flight, printed, watched_flight
from worldsim.campaign.flight_site import LocalSite, Order
from worldsim.campaign.pool import FailedFlightError, Job, simulate
from worldsim.fleet import import_probe
from worldsim.results.overall import Cut, is_cut_off, over_all
from worldsim.scenario.file import load

MODULE = "tests.campaign.failing_controllers"
FAILURES = {
    "Exit0": "SystemExit: 0",
    "Interrupts": "KeyboardInterrupt",
    "ExitsGenerator": "GeneratorExit: x",
    "OwnBaseError": "StrangeError: odd",
    "OsExit0": "its process ended with status 0",
    "KillsItself": "its process was killed by signal 9",
    "Aborts": "its process was killed by signal 6",
    "Recurses": "(RecursionError: maximum recursion depth exceeded|SystemError: .*)",
    "OverflowsTheStack": "(its process was killed by signal 11|MemoryError)",
    "NulText": r"ValueError: a\\0b c",
    "EatsMemory": "MemoryError",
    "ClosesFiles": "it closed the files of its process",
    "NoText": "NoTextError: its text cannot be shown: RuntimeError in its __str__",
    "Blocks": r"did not return within 0\.4 s",
    "Spins": r"did not return within 0\.4 s",
}
WHEN_MADE = {
    "Exit0WhenMade": "failed in its constructor: SystemExit: 0",
    "OsExit0WhenMade": "failed at 0 s: its process ended with status 0",
}


HANGS = ("Blocks", "Spins")


@pytest.fixture(autouse=True)
def little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flight, "MEMORY_B", 1024**3)


@pytest.fixture(autouse=True)
def impatient(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if any(name in request.node.name for name in HANGS):
        monkeypatch.setattr(watched_flight, "STEP_WITHIN_S", 0.4)


def flown(name: str, *more: str) -> list[str]:
    controller = f'control.controller="{MODULE}:{name}"'
    hovering = ["--set", "expect.converge=false", "--duration", "0.6"]
    return ["sim", "small.toml", "--out", "out", "--set", controller, *hovering, *more]


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("name", FAILURES)
def test_the_failure_is_the_agents(qswarm: Command, name: str) -> None:  # noqa: F811
    ended = qswarm(*flown(name, "--no-recording"))
    assert (ended.status, ended.out) == (1, "")
    line = ended.err.splitlines()[-1]
    blamed = rf"qswarm: controller '{MODULE}:{name}' of agent 1 failed at 0\.2\d* s: "
    assert re.fullmatch(blamed + FAILURES[name], line), ended.err
    assert not Path("out/summary.json").exists()


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("name", WHEN_MADE)
def test_a_constructor_that_exits_is_named(qswarm: Command, name: str) -> None:  # noqa: F811
    ended = qswarm(*flown(name, "--no-recording"))
    assert ended.status == 1
    assert ended.err.endswith(f"of agent 1 {WHEN_MADE[name]}\n")


@pytest.mark.usefixtures("small")
def test_no_later_seed_is_dropped(qswarm: Command) -> None:  # noqa: F811
    ended = qswarm(*flown("OsExit0", "--no-recording", "--seeds", "0:3", "--jobs", "2"))
    assert ended.status == 1
    overall = json.loads(Path("out/summary.json").read_text())
    assert (overall["runs"], overall["outcome"]) == (3, "fail")
    assert {row["seed"] for row in overall["rows"]} == {0, 1, 2}
    assert all("ended with status 0" in row["reason"] for row in overall["rows"])


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("name", HANGS)
def test_the_place_of_a_hang_is_shown(qswarm: Command, name: str) -> None:  # noqa: F811
    ended = qswarm(*flown(name, "--no-recording"))
    assert re.search(r'failing_controllers\.py", line \d+ in fail\n', ended.err), ended.err


@pytest.mark.usefixtures("small")
def test_a_controller_that_keeps_all_memory_is_still_named(qswarm: Command) -> None:  # noqa: F811
    ended = qswarm(*flown("HoardsMemory", "--no-recording"))
    assert ended.status == 1
    assert "of agent 1 failed at 0.2" in ended.err.splitlines()[-1]


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize(
    "name", ["Forks", "ForksTwice", "ForksACopy", "StartsAThread", "ChangesFolder"]
)
def test_what_a_controller_starts_ends_with_the_run(qswarm: Command, name: str) -> None:  # noqa: F811
    ended = qswarm(*flown(name))
    assert ended.status == 0, ended.err
    assert "recording: " not in ended.err
    lines = Path("out/events.jsonl").read_text().splitlines()
    assert len(lines) == len(set(lines))
    for pid in re.findall(r"forked (\d+)", ended.err):
        assert not Path(f"/proc/{pid}").exists()
    if name == "ForksACopy":
        assert ended.err.endswith("agent 1's controller forked at 0.2125 s; the copy ends here\n")


@pytest.mark.usefixtures("small")
def test_what_controllers_print_is_bounded(
    qswarm: Command,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(printed, "MAX_PRINTED_B", 300_000)
    ended = qswarm(*flown("Prints", "--no-recording"))
    assert ended.status == 0
    *_, last = ended.err.splitlines()
    assert re.fullmatch(
        r"out: \d+ B more were printed and dropped; at most 300000 B of a run are shown", last
    )
    assert len(ended.err.encode()) < 301_000


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_run_whose_controller_ignores_signals_ends(number: signal.Signals) -> None:
    arguments = flown("IgnoresSignals", "--no-recording", "--duration", "1000")
    events = Path("out/events.jsonl")
    with Started([*QSWARM, *arguments], Path("output"), Path.cwd()) as started:
        eventually(events.exists, 20.0)
        started.wait_for_output("deaf")
        started.process.send_signal(number)
        assert started.status(within_s=20.0) == 130
    assert json.loads(Path("out/summary.json").read_text())["outcome"] == "inconclusive"


class Asked:
    """A stop request that comes once a flight stands still."""

    def __init__(self) -> None:
        self.requested = False
        self._before_s = 0.0

    def look(self, time_s: float) -> None:
        """Take how far the flight is [s; simulated time]."""
        self.requested = self.requested or time_s == self._before_s > 0.0
        self._before_s = time_s


@pytest.mark.usefixtures("small")
def test_a_step_that_a_stop_request_cuts_off_is_no_failure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(watched_flight, "STOPPED_STEP_WITHIN_S", 0.1)
    keys = {"control.controller": f"{MODULE}:Blocks", "expect.converge": "false"}
    scenario, stop = load(Path("small.toml"), keys), Asked()
    with pytest.raises(FailedFlightError) as failed:
        simulate(Job(scenario, Path("out"), False), stop, stop.look)  # type: ignore[arg-type]
    run = failed.value.run
    assert (run.outcome, is_cut_off(run, scenario)) == ("inconclusive", True)
    assert run.error.endswith(": did not return within 0.1 s")
    assert "Thread" not in capsys.readouterr().err, "the stack of what was cut off"
    cut = over_all([run], Cut("interrupted", 3, 1))
    assert (cut["outcome"], cut["reason"]) == (
        "inconclusive",
        "interrupted: 0 of 3 runs done, 1 cut off",
    )

    later, polls = Asked(), count()
    site = LocalSite(1, Path("scratch"), lambda: later.look(float(next(polls) // 4)))
    orders = [Order("one", scenario), Order("two", scenario)]
    assert list(site.fly(orders, later)) == []  # type: ignore[arg-type]


@pytest.mark.usefixtures("small")
def test_a_run_is_recorded_from_a_program_that_has_recorded_before() -> None:
    import rerun as rr  # noqa: PLC0415 - a second that the other tests save

    rr.RecordingStream("before").disconnect()
    scenario = load(Path("small.toml"), {"duration_s": "0.5", "expect.converge": "false"})
    with stop_requests() as stop:
        made = simulate(Job(scenario, Path("out"), True), stop)
    assert made.outcome == "pass"
    assert Path("out/run.rrd").stat().st_size > 10_000


@pytest.mark.usefixtures("small")
def test_a_breakpoint_stops_in_the_controller_for_as_long_as_it_takes() -> None:
    arguments = [QSWARM[0], "-c", PATIENCE + QSWARM[2], *flown("Breaks", "--no-recording")]
    asked = subprocess.Popen(
        arguments,
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    )
    assert asked.stdin is not None
    assert asked.stderr is not None
    shown = asked.stderr.readline()  # where it stops
    threading.Event().wait(0.6)  # longer than a step may last: nothing is to happen
    asked.stdin.write("p answer + 1\nc\n")
    asked.stdin.flush()
    _, err = asked.communicate(timeout=20.0)
    assert "failing_controllers.py" in shown
    assert "43" in err
    assert "agent 1 42" in err
    assert asked.returncode == 0


PATIENCE = "from worldsim.campaign import watched_flight; watched_flight.STEP_WITHIN_S = 0.3; "
IMPORTS = {
    "import os; os._exit(0)": "the process that imports it ended with status 0",
    "import os; os.kill(os.getpid(), 9)": "the process that imports it was killed by signal 9",
    "import time; time.sleep(600)": "its import did not return within 0.3 s",
    "import sys; sys.exit(0)": "cannot be imported: SystemExit: 0",
    "raise GeneratorExit": "cannot be imported: GeneratorExit",
    "1 / 0": "cannot be imported: ZeroDivisionError: division by zero",
    "def (": "cannot be imported: SyntaxError: ",
}


@pytest.mark.parametrize("line", IMPORTS)
def test_a_module_that_cannot_be_imported_is_bad_input(
    small: Path,  # noqa: F811
    qswarm: Command,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
    line: str,
) -> None:
    monkeypatch.syspath_prepend(small.parent)
    if "sleep" in line:
        monkeypatch.setattr(import_probe, "IMPORT_WITHIN_S", 0.3)
    name = f"own_{list(IMPORTS).index(line)}"
    small.with_name(f"{name}.py").write_text(line)
    ended = qswarm("check", small, "--set", f'control.controller="{name}:Own"')
    assert (ended.status, ended.out) == (2, "")
    (shown,) = ended.err.splitlines()
    assert shown.startswith(f"{small}: control.controller: '{name}:Own'")
    assert IMPORTS[line] in shown


@pytest.mark.usefixtures("small")
def test_what_a_process_holds_before_it_flies_does_not_count(
    monkeypatch: pytest.MonkeyPatch,
    qswarm: Command,  # noqa: F811
) -> None:
    monkeypatch.setattr(flight, "MEMORY_B", 300 * 1024**2)
    held = bytearray(400 * 1024**2)
    assert qswarm(*flown("TakesSome", "--no-recording", "--duration", "0.1")).status == 0
    assert len(held) > flight.MEMORY_B
