"""A foreign agent: a command that runs in place of an agent's process (docs/wire.md).

It is told what ``python -m agent`` is told, by the same options. It leads a process group of its
own, so that what it starts is paused and ends with it. The kernel ends only the command itself when
its parent dies; a guard ends the rest of its group.
"""

import os
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from worldsim.fleet.fork import fork

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


class GroupGuard:
    """A process that kills the groups of foreign agents once its parent is dead, by kill -9 too.

    in_child: called in the guard first, to close what only its parent may hold. Make it in a
    process that has opened no Zenoh session.
    """

    def __init__(self, in_child: Callable[[], None]) -> None:
        read_end, self._write_end = os.pipe()

        def main() -> int:
            in_child()
            os.close(self._write_end)
            return _kill_groups_at_end(read_end)

        # SIGCONT does nothing to a process that runs: the end of the pipe tells it more.
        fork(None, signal.SIGCONT, main)
        os.close(read_end)

    def watch(self, pid: int) -> None:
        """Guard the group of a foreign agent."""
        os.write(self._write_end, b"%d\n" % pid)

    def forget(self, pid: int) -> None:
        """Guard a group no longer: it is gone, and its number may be given to another one."""
        os.write(self._write_end, b"-%d\n" % pid)


def _kill_groups_at_end(read_end: int) -> int:
    """Read which groups there are until nobody is left to say so; kill those."""
    groups: set[int] = set()
    with os.fdopen(read_end, "rb") as told:
        for line in told:
            pid = int(line)
            groups.add(pid) if pid > 0 else groups.discard(-pid)
    for pid in groups:
        signal_group(pid, signal.SIGKILL)
    return 0
