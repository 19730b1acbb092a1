"""A foreign agent: a command that runs in place of an agent's process (docs/wire.md).

It is told what ``python -m agent`` is told, by the same options. It leads a process group of its
own, so that what it starts is paused and ends with it.
"""

import os
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

NOT_STARTED = 127
"""Exit status of a command that could not be started, as a shell has it."""


def options_of(agent: int, run: str, endpoint: str, users: Path | None) -> list[str]:
    """Return what a command is told behind its own arguments."""
    told = ["--id", str(agent), "--run", run, "--connect", endpoint]
    return told if users is None else [*told, "--credentials", str(users.resolve())]


def become(agent: int, command: Sequence[str], options: Sequence[str]) -> int:
    """Become a command; return an exit status where it cannot be started.

    The signal at the parent's death stays in force. SIGXFSZ stays ignored: a command whose log is
    full loses its output, not its life.
    """
    own_group(os.getpid())
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    try:
        os.execv(command[0], [*command, *options])
    except OSError as error:
        print(f"agent-{agent}: {command[0]!r} cannot be started: {error.strerror}", file=sys.stderr)
        return NOT_STARTED


def own_group(pid: int) -> None:
    """Let a process lead a group of its own. Parent and child both ask for it: one is first."""
    with suppress(OSError):
        os.setpgid(pid, pid)


def signal_group(pid: int, number: signal.Signals) -> None:
    """Signal a foreign agent, and what it has started."""
    with suppress(ProcessLookupError):
        os.killpg(pid, number)
