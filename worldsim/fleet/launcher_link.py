"""What the world hears and says beside its topics: who is lost, when to stop, how far it is.

Under a launcher, deaths are what waitpid says, and the launcher shows progress. By hand, deaths
are what liveliness hints at, and progress is printed.
"""

import select
import time
from collections.abc import Callable
from math import inf
from typing import NamedTuple, Protocol

from worldsim.fleet.ipc import MessageSocket

PRINT_EVERY_S = 2.0


class Loss(NamedTuple):
    """An agent whose process is gone: by a signal, with a status, or nobody knows how.

    incarnation: which of its processes; None where nobody counts them.
    """

    agent: int
    incarnation: int | None = None
    signal: int | None = None
    status: int | None = None

    def __str__(self) -> str:
        if self.signal is not None:
            return f"agent-{self.agent} was killed by signal {self.signal}"
        how = f" with status {self.status}" if self.status is not None else ""
        return f"agent-{self.agent} ended{how}"


class Progress(NamedTuple):
    """How far a flight is. separation_m: the least so far; late: share of late ticks."""

    time_s: float
    duration_s: float
    agents: int
    in_place: int
    separation_m: float | None
    late: float | None

    def __str__(self) -> str:
        separation = "-" if self.separation_m is None else f"{self.separation_m:.2f} m"
        late = "-" if self.late is None else f"{self.late:.1%}"
        return (
            f"{self.time_s:6.1f} of {self.duration_s:g} s   in place {self.in_place}/{self.agents}"
            f"   least separation {separation}   late ticks {late}"
        )


class LauncherLink(Protocol):
    """What a flight needs of whoever started it."""

    launches: bool
    """Whether processes can be started and ended."""

    broken: str | None
    """How a process ended of which there is one, or None."""

    @property
    def stopped(self) -> str | None:
        """Why the flight must end now, or None."""

    def wait(self, left_s: float) -> None:
        """Wait ``left_s`` [s], or less when there is news."""

    def losses(self) -> list[Loss]:
        """Return whose process ended since the last call, planned or not."""

    def act(self, deed: str, whom: list[tuple[int, int]], after_s: float = 0.0) -> None:
        """Ask for a deed on processes, (agent, incarnation) each: start, kill, pause or resume.

        after_s: how long a process that starts sleeps first [s].
        """

    def has_done(self, deed: str, whom: list[tuple[int, int]]) -> bool:
        """Whether a deed that was asked for has been done; it is told once."""

    def missing(self, names: list[str]) -> None:
        """Say who is not there yet."""

    def progress(self, progress: Progress) -> None:
        """Say how far the flight is."""

    def waiting(self, what: str) -> None:
        """Say for what the flight has been standing still."""

    def landing(self) -> None:
        """Say that the run is over, before the others hear of it and end."""


class Conducted:
    """Under a launcher, at the other end of ``lines``."""

    launches = True

    def __init__(self, lines: MessageSocket) -> None:
        self._lines = lines
        self._losses: list[Loss] = []
        self._done: list[tuple[str, list[list[int]]]] = []
        self.broken: str | None = None

    @property
    def stopped(self) -> str | None:
        """The launcher's end is the flight's, and that of a process of which there is one."""
        return "the launcher is gone" if self._lines.closed else self.broken

    def wait(self, left_s: float) -> None:
        """Wait, but not longer than until the launcher says something."""
        _wait([] if self._lines.closed else [self._lines], left_s)
        self._hear()

    def losses(self) -> list[Loss]:
        """Return the exits that the launcher told."""
        self._hear()
        losses, self._losses = self._losses, []
        return losses

    def act(self, deed: str, whom: list[tuple[int, int]], after_s: float = 0.0) -> None:
        """Ask the launcher for it."""
        if whom:
            self._lines.send(do=deed, whom=whom, after_s=after_s)

    def has_done(self, deed: str, whom: list[tuple[int, int]]) -> bool:
        """Whether the launcher's zygote has confirmed it."""
        self._hear()
        told = (deed, [list(who) for who in whom])
        if told not in self._done:
            return False
        self._done.remove(told)
        return True

    def missing(self, names: list[str]) -> None:
        """Tell the launcher who is not there yet; an empty list when everybody is."""
        self._lines.send(missing=names)

    def progress(self, progress: Progress) -> None:
        """Tell the launcher how far the flight is."""
        self._lines.offer(progress=progress._asdict())

    def waiting(self, what: str) -> None:
        """Tell the launcher for what the flight stands still."""
        self._lines.offer(waiting=what)

    def landing(self) -> None:
        """Tell the launcher that from now on everybody ends as planned."""
        self._lines.send(landing=True)

    def _hear(self) -> None:
        for line in self._lines.receive():
            if "lost" in line:
                self._losses.append(Loss(*line["lost"]))
            elif "done" in line:
                self._done.append((line["done"], line["whom"]))
            else:
                self.broken = line["broken"]


class ByHand:
    """Without a launcher; ``gone`` tells which names stopped showing signs of life."""

    launches = False

    def __init__(self, gone: Callable[[], list[str]]) -> None:
        self.stopped: str | None = None
        self.broken: str | None = None
        self._gone = gone
        self._print_at_s = -inf

    def wait(self, left_s: float) -> None:
        """Wait; there is never news."""
        _wait([], left_s)

    def losses(self) -> list[Loss]:
        """Return the agents that went; when the medium went, everybody seems to have: stop."""
        gone = self._gone()
        if "netem" in gone:
            self.stopped = "netem is gone"
            return []
        agents = [int(name.removeprefix("agent-")) for name in gone if name.startswith("agent-")]
        for agent in agents:
            print(f"agent-{agent} is gone", flush=True)
        return [Loss(agent) for agent in agents]

    def act(self, deed: str, whom: list[tuple[int, int]], after_s: float = 0.0) -> None:
        """Refuse: what was started by hand is stopped by hand. Raises LookupError."""
        raise LookupError(f"nobody can {deed} {whom}: these processes were started by hand")

    def has_done(self, deed: str, whom: list[tuple[int, int]]) -> bool:
        """Refuse: nothing was asked for. Raises LookupError."""
        raise LookupError(f"nobody was asked to {deed} {whom}")

    def missing(self, names: list[str]) -> None:
        """Print who is not there yet, every two seconds."""
        if not names:
            print("everybody is there", flush=True)
        elif self._due():
            print(f"waiting for {', '.join(names)}", flush=True)

    def progress(self, progress: Progress) -> None:
        """Print how far the flight is, every two seconds."""
        if self._due():
            print(progress, flush=True)

    def waiting(self, what: str) -> None:
        """Print for what the flight stands still."""
        print(f"waiting for {what}", flush=True)

    def landing(self) -> None:
        """Print what is ahead: the end."""
        print("world: the run is over", flush=True)

    def _due(self) -> bool:
        now_s = time.monotonic()
        due = now_s >= self._print_at_s
        if due:
            self._print_at_s = now_s + PRINT_EVERY_S
        return due


def _wait(news: list[MessageSocket], left_s: float) -> None:
    if left_s > 0.0:
        select.select(news, [], [], left_s)
