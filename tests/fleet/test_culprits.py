"""Who is at fault: real processes that are stopped, blocked or busy, and pages of steps."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from agent.step_page import StepGuard
from tests.processes.harness import eventually
from worldsim.fleet import culprits
from worldsim.fleet.culprits import Culprits, SharedSteps
from worldsim.fleet.fork import ProcessExit

Start = Callable[[str], int]
BLOCKED, BUSY = "input()", "\nwhile True: pass"
TURNS = "import time\nwhile True: time.sleep(0.001)"


@pytest.fixture
def process() -> Iterator[Start]:
    """Start a process that runs a line of Python; return its pid."""
    started = []

    def start(line: str) -> int:
        program = [sys.executable, "-c", f"print(flush=True); {line}"]
        streams = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        started.append(subprocess.Popen(program, **streams))  # type: ignore[call-overload]
        started[-1].stdout.readline()
        return int(started[-1].pid)

    yield start
    for each in started:
        each.kill()
        each.communicate()


def steps_in(pid: int, agents: int = 2) -> SharedSteps:
    """Return a page on which agent 1's process, ``pid``, has just begun a step."""
    steps = SharedSteps.of(agents, 1)
    StepGuard(steps.page.row(1), 0.05).enter()
    steps.page.note_pid(1, pid)
    return steps


@pytest.mark.parametrize(
    ("line", "does"), [(BLOCKED, "it is blocked"), (BUSY, "it computes without end")]
)
def test_a_step_that_does_not_return_is_named_once(
    process: Start, monkeypatch: pytest.MonkeyPatch, line: str, does: str
) -> None:
    monkeypatch.setattr(culprits, "HANG_S", 0.2)
    monkeypatch.setattr(culprits, "ASLEEP_S", 0.05)
    steps, told = steps_in(process(line)), list[str]()
    steps.page.row(1)[2] = 0  # CPU time at the step's begin, of the process that is looked at
    found = Culprits(steps, told.append)
    found.look([1], 5.0)
    assert (found.failure, told) == (None, [])

    def named() -> bool:
        found.look([0, 1], 5.0)
        return found.failure is not None

    eventually(named, 10.0)
    assert re.fullmatch(
        rf"the controller of agent-1 has not returned since [0-4]\.\d s: {does}",
        found.failure or "",
    )
    found.look([1], 6.0)
    assert told == [found.failure]
    assert (found.named(0), found.named(1)) == (False, True)


def test_a_step_that_a_slow_host_may_delay_is_not_called_a_hang(
    process: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(culprits, "ASLEEP_S", 10.0)
    steps = steps_in(process(TURNS))
    found = Culprits(steps, lambda _: None)
    steps.page.row(1)[1] -= 2_000_000  # it began two seconds earlier
    found.look([1], 5.0)
    assert found.failure is None
    steps.page.row(1)[1] -= 4_000_000
    found.look([1], 5.0)
    assert found.failure is not None
    assert found.failure.endswith(": it computes and waits in turn")


def test_a_stopped_process_is_not_called_a_hang(
    process: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(culprits, "HANG_S", 0.0)
    pid = process(BLOCKED)
    os.kill(pid, signal.SIGSTOP)
    os.waitid(os.P_PID, pid, os.WSTOPPED | os.WNOWAIT)
    found = Culprits(steps_in(pid), lambda _: None)
    found.look([1], 5.0)
    assert (found.failure, found.stop) == (None, "agent-1 was stopped by a signal at 5.0 s")


def test_a_stopped_medium_is_named(process: Start) -> None:
    pid = process(BLOCKED)
    os.kill(pid, signal.SIGSTOP)
    os.waitid(os.P_PID, pid, os.WSTOPPED | os.WNOWAIT)
    steps = SharedSteps.of(2, 2)
    steps.note_medium(1, pid)
    found = Culprits(steps, lambda _: None)
    found.look([], 4.0)
    assert found.stop is None  # nobody is late
    found.look([0], 5.0)
    assert found.stop == "netem-1 was stopped by a signal at 5.0 s"


@pytest.mark.parametrize(
    ("process_exit", "fails"),
    [
        (ProcessExit(None, 0), "agent-1 ended with status 0 at 2.0 s"),
        (ProcessExit(None, 1), "agent-1 ended with status 1 at 2.0 s"),
        (ProcessExit(11, None), "agent-1 was killed by signal 11 at 2.0 s"),
        (ProcessExit(9, None), None),
        (ProcessExit(None, None), None),
    ],
)
def test_an_agent_that_ends_by_itself_fails_the_run(
    process_exit: ProcessExit, fails: str | None
) -> None:
    found = Culprits(None, lambda _: None)
    found.note_exit(1, process_exit, 2.0)
    assert found.failure == fails


def test_slow_steps_count_where_the_controller_computes_or_waits() -> None:
    steps = SharedSteps.of(2, 1)
    for agent, wait in ((0, lambda: None), (1, lambda: eventually(later(3), 5.0))):
        guard = StepGuard(steps.page.row(agent), 0.02)
        guard.enter()
        wait()
        guard.leave()
    found = Culprits(steps, lambda _: None)
    assert found.slow(100) is None
    slow = found.slow(5)
    assert slow is not None
    assert slow.startswith("the controllers of agent-1 took ")
    assert slow.endswith(" ms a step")


def later(polls: int) -> Callable[[], bool]:
    left = iter(range(polls))
    return lambda: next(left, None) is None


def test_without_a_page_nobody_is_named() -> None:
    found = Culprits(None, lambda _: None)
    found.look([0, 1], 5.0)
    assert (found.failure, found.stop, found.slow(1)) == (None, None, None)


CLOSES = """
import os, sys
from agent.step_page import StepGuard
guard = StepGuard(None, 0.05)
guard.enter()
{misdeed}
guard.leave()
print("left")
"""


@pytest.mark.parametrize(
    ("misdeed", "status", "out"),
    [("pass", 0, "left\n"), ("os.closerange(0, 64)", 5, ""), ("os.fork()", 0, "left\n")],
)
def test_a_process_without_files_ends_and_so_does_a_copy(
    misdeed: str, status: int, out: str
) -> None:
    program = [sys.executable, "-c", CLOSES.format(misdeed=misdeed)]
    root = Path(__file__).parents[2]
    ended = subprocess.run(program, capture_output=True, text=True, check=False, cwd=root)
    assert (ended.returncode, ended.stdout) == (status, out), ended.stderr
