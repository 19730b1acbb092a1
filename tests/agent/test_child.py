"""A child that answers lines: it cannot hold its caller, and never outlives it."""

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep

import pytest

from agent.child import Child, ChildError

WITHIN_S = 10.0
ECHO = "import sys\nfor line in sys.stdin:\n    print(line.strip().upper(), flush=True)"


def python(program: str) -> Child:
    return Child([sys.executable, "-c", program])


def test_each_line_is_answered_in_order() -> None:
    child = python(ECHO)
    assert [child.ask(line, WITHIN_S) for line in (b"one", b"two")] == [b"ONE", b"TWO"]


def test_a_line_that_is_told_is_not_answered() -> None:
    child = python(f"import sys\nsys.stdin.readline()\n{ECHO}")
    child.tell(b"setup", WITHIN_S)
    assert child.ask(b"one", WITHIN_S) == b"ONE"


def test_long_lines_pass_both_ways() -> None:
    child = python(
        "import sys\nfor line in sys.stdin:\n    print(line[:60_000].strip(), flush=True)"
    )
    assert child.ask(b"x" * 500_000, WITHIN_S) == b"x" * 60_000


def test_a_late_answer_is_dropped_and_the_next_one_counts() -> None:
    held = Child(
        ["sh", "-c", "read a; sleep 0.4; echo late; while read b; do echo now; done"],
    )
    assert held.ask(b"one", 0.01) is None
    assert held.ask(b"two", 0.01) is None, "an answer is owed, so nothing is asked"
    assert wait_for(lambda: held.ask(b"three", 0.05)) == b"now"


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("import sys; sys.exit(3)", "ended with status 3"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "was ended by SIGSEGV"),
        (
            # By one write: print makes two of it where Python is told to buffer nothing.
            "import os, sys\nfor line in sys.stdin: os.write(1, b'once\\ntwice\\n')",
            "wrote what was not asked for: 'twice\\n'",
        ),
        (
            "input(); print('x' * 70_000, flush=True); input()",
            "wrote a line of more than 65536 bytes",
        ),
        ("input(); 1/0", "ended with status 1; its last line on stderr: 'ZeroDivisionError"),
        ("import os; os.close(1); input(); input()", "closed its output"),
        ("import os\nwhile True: os.write(1, b'y' * 9999)", "wrote"),
    ],
)
def test_a_child_that_does_not_keep_to_it_says_why(program: str, said: str) -> None:
    child = python(program)
    with pytest.raises(ChildError) as failed:
        wait_for(lambda: child.ask(b"one", WITHIN_S) and None)
    assert said in str(failed.value)
    assert len(str(failed.value).splitlines()) == 1


def test_a_flood_of_errors_does_not_hold_the_caller(capfd: pytest.CaptureFixture[str]) -> None:
    child = Child(["sh", "-c", "while true; do echo noise >&2; done"])
    begun = monotonic()
    assert child.ask(b"one", 0.3) is None
    assert monotonic() - begun < WITHIN_S
    assert "noise" in capfd.readouterr().err


def test_a_child_that_reads_nothing_is_a_failure() -> None:
    with pytest.raises(ChildError, match="does not read its lines"):
        Child(["sleep", "60"]).ask(b"x" * 1_000_000, 0.2)


def test_a_program_that_is_not_there_is_named() -> None:
    with pytest.raises(ChildError, match="No such file"):
        wait_for(lambda: Child(["/nowhere/at-all"]).ask(b"one", WITHIN_S))


def test_a_child_ends_when_it_is_dropped() -> None:
    child = python("import os\nprint(os.getpid(), flush=True)\ninput()\ninput()")
    pid = int(child._answer(monotonic() + WITHIN_S) or b"0")
    del child
    assert wait_for(lambda: not alive(pid))


def test_a_child_ends_when_its_caller_is_killed() -> None:
    caller = (
        "import os, sys, time\nfrom agent.child import Child\n"
        "child = Child(['sleep', '60'])\nprint(child._process.pid, flush=True)\ntime.sleep(60)"
    )
    parent = Child([sys.executable, "-c", caller])
    pid = int(parent._answer(monotonic() + WITHIN_S) or b"0")
    # It is the child's child only once the first Python has become it.
    assert wait_for(lambda: b"sleep" in command_of(pid))
    parent._process.send_signal(signal.SIGKILL)
    assert wait_for(lambda: not alive(pid))


def alive(pid: int) -> bool:
    return bool(command_of(pid))


def command_of(pid: int) -> bytes:
    """Return a process's command line; empty once it has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def wait_for(condition: Callable[[], object]) -> object:
    """Return what a condition gives as soon as it gives something."""
    until = monotonic() + WITHIN_S
    while not (found := condition()):
        assert monotonic() < until, "it never came"
        sleep(0.01)
    return found


def test_ctrl_c_of_the_terminal_does_not_reach_it() -> None:
    """It ends with its caller; a program that heeds Ctrl-C would fail its agent before."""
    child = python("import os\ninput()\nprint(os.getpgrp(), flush=True)\ninput()")
    answer = child.ask(b"whose group?\n", WITHIN_S)
    assert answer is not None
    assert int(answer) != os.getpgrp()
