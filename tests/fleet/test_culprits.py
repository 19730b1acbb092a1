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
from worldsim.fleet.culprits import Culprits, ForeignSteps, SharedSteps
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


def test_a_foreign_agent_that_owes_a_command_is_named(
    process: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(culprits, "HANG_S", -1.0)
    steps = SharedSteps.of(3, 1)
    for agent in (0, 1, 2):
        steps.page.note_pid(agent, process(BUSY))
    foreign = ForeignSteps(steps, {1, 2})
    for agent in (0, 1, 2):
        foreign.begin(agent)
    foreign.end([0, 2])
    found = Culprits(steps, lambda _: None)
    found.look([0, 1, 2], 5.0)
    assert [agent for agent in (0, 1, 2) if found.named(agent)] == [1]
    entered_s = steps.page.read(1).entered_s
    foreign.begin(1)  # the next observation does not begin the step anew
    assert steps.page.read(1).entered_s == entered_s


def test_a_foreign_agent_is_not_at_fault_while_a_medium_stands_still(
    process: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(culprits, "HANG_S", -1.0)
    pid = process(BLOCKED)
    steps = steps_in(process(BUSY))
    steps.page.row(1)[2] = 0
    steps.note_medium(0, pid)
    found = Culprits(steps, lambda _: None)
    for number, state, failed in (
        (signal.SIGSTOP, os.WSTOPPED, False),
        (signal.SIGCONT, os.WCONTINUED, True),
    ):
        os.kill(pid, number)
        os.waitid(os.P_PID, pid, state | os.WNOWAIT)
        found.look([1], 5.0)
        assert found.named(1) == failed


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


def test_agents_that_end_alike_are_named_together_with_the_log_of_the_first() -> None:
    found = Culprits(None, lambda _: None)
    for agent, time_s in ((0, 2.0), (1, 2.0), (4, 2.0), (2, 2.06), (3, 2.06), (6, 2.1), (9, 2.1)):
        log_end = f": agent {agent} failed at {time_s:g} s: died (logs/agent-{agent}.log)"
        found.note_exit(agent, ProcessExit(None, 1), time_s, log_end)
    found.note_exit(
        5, ProcessExit(None, 1), 3.0, ": agent 5 failed at 3 s: lost (logs/agent-5.log)"
    )
    found.note_exit(7, ProcessExit(11, None), 3.0)
    found.note_exit(8, ProcessExit(11, None), 3.0)
    assert (found.failure or "").split("; ") == [
        "agent-0 to agent-4, agent-6, agent-9 ended with status 1 at 2.0 s to 2.1 s:"
        " agent 0 failed at 2 s: died (logs/agent-0.log)",
        "agent-5 ended with status 1 at 3.0 s: agent 5 failed at 3 s: lost (logs/agent-5.log)",
        "agent-7, agent-8 were killed by signal 11 at 3.0 s",
    ]


def test_of_many_agents_that_end_alike_some_are_named() -> None:
    found = Culprits(None, lambda _: None)
    for agent in range(0, 20, 2):
        found.note_exit(agent, ProcessExit(None, 1), 2.0)
    named = ", ".join(f"agent-{agent}" for agent in range(0, 10, 2))
    assert found.failure == f"{named} and 5 more ended with status 1 at 2.0 s"


def test_controllers_that_hang_alike_are_named_together(
    process: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(culprits, "HANG_S", -1.0)
    steps, told = steps_in(process(BUSY), agents=3), list[str]()
    StepGuard(steps.page.row(2), 0.05).enter()
    steps.page.note_pid(2, steps.page.read(1).pid)
    for agent in (1, 2):
        steps.page.row(agent)[2] = 0
    found = Culprits(steps, told.append, speed=0.0)
    found.look([1, 2], 5.0)
    does = "computes without end"
    assert told == [
        f"the controller of agent-{agent} has not returned since 5.0 s: it {does}"
        for agent in (1, 2)
    ]
    assert found.failure == (
        f"the controllers of agent-1, agent-2 have not returned since 5.0 s: each {does}"
    )


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
