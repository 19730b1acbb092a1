"""The process at fault: agents that end or hang, processes that are stopped, or the host.

Agents note their steps in a shared page; /proc says what a process does. Where processes are
started by hand there is no page, and nobody is named.
"""

import re
import signal
import time
from collections.abc import Callable, Container, Iterable, Sequence
from typing import NamedTuple

from agent.step_page import StepPage, StepTimes
from netem.wire.keys import agent_name, medium_name
from worldsim.fleet.fork import ProcessExit
from worldsim.fleet.process_state import ProcessState, process_state

HANG_S = 1.0
"""A step hangs that has used this CPU time, or that sleeps and has lasted this wall time."""
ASLEEP_S = 0.3
"""A process sleeps that has not run for so long though no core was denied to it."""
LONG_HANG_S = 5.0
"""A step that has lasted this wall time hangs whatever it does: no host delays it so long."""
SLOW_FRACTION = 0.1
"""From this share of slow steps on, a controller is too slow."""
CRASH_SIGNALS = frozenset(
    {signal.SIGABRT, signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGTRAP}
)
"""Signals that a process gets for its own errors."""
MAX_NAMED = 5
NUMBER = re.compile(r"\d+(?:\.\d+)?")
"""Ends of logs are alike that differ in numbers only: in ids and times."""
LARGE_B = 1024**3


class SharedSteps(NamedTuple):
    """The page of a launched fleet: a row for each agent, then one for each medium."""

    page: StepPage
    agents: int
    mediums: int

    @staticmethod
    def of(agents: int, mediums: int) -> "SharedSteps":
        """Return a new page. Make it before any process is forked."""
        return SharedSteps(StepPage(agents + mediums), agents, mediums)

    def note_medium(self, shard: int, pid: int) -> None:
        """Note the process of a medium."""
        self.page.note_pid(self.agents + shard, pid)

    def medium_pid(self, shard: int) -> int:
        """Return the process of a medium; 0 before it is noted."""
        return self.page.read(self.agents + shard).pid


class ForeignSteps:
    """Notes the steps of foreign agents, which do not note them themselves.

    A step lasts from an observation to the next command. steps: None where nobody reads them.
    """

    def __init__(self, steps: SharedSteps | None, foreign: Container[int]) -> None:
        self._steps = steps
        self._foreign = foreign

    def begin(self, agent: int) -> None:
        """Note that an agent was sent an observation, unless it still owes a command."""
        if self._steps is None or agent not in self._foreign:
            return
        times = self._steps.page.read(agent)
        process = process_state(times.pid) if times.entered_s is None else None
        if process is not None:
            self._steps.page.note_step(agent, process.cpu_s)

    def end(self, agents: Iterable[int]) -> None:
        """Note that agents owe no command: it has come, or their processes are held up or gone."""
        if self._steps is not None:
            for agent in agents:
                if agent in self._foreign:
                    self._steps.page.note_step(agent, None)


class _Fault(NamedTuple):
    """What an agent's process did."""

    agent: int
    what: str
    time_s: float
    log_end: str = ""


class Culprits:
    """Names the process at fault; ``report`` gets a line the first time.

    speed: simulated seconds in a second of wall time, 0 where time waits for all. steps: None where
    nobody can be named.
    """

    def __init__(
        self, steps: SharedSteps | None, report: Callable[[str], None], speed: float = 1.0
    ) -> None:
        self._steps = steps
        self._report = report
        self._speed = speed
        self._hangs: dict[int, _Fault] = {}
        self._ends: list[_Fault] = []
        self._asleep_since: dict[int, tuple[int, float]] = {}  # switches and time, by agent
        self._stops: dict[str, str] = {}

    def look(self, late: Sequence[int], time_s: float) -> None:
        """Look for the reason why agents have not answered at ``time_s`` [s; simulated time]."""
        if self._steps is None or not late:
            return
        halted = False
        for shard in range(self._steps.mediums):
            medium = process_state(self._steps.medium_pid(shard))
            self._note_stop(medium_name(shard), medium, time_s)
            halted = halted or (medium is not None and medium.stopped)
        for agent in late:
            times = self._steps.page.read(agent)
            process = process_state(times.pid)
            self._note_stop(agent_name(agent), process, time_s)
            # While a medium stands still, a foreign agent waits for the next observation.
            if process is not None and not process.stopped and not halted:
                self._note_hang(agent, times, process, time_s)

    def note_exit(
        self, agent: int, process_exit: ProcessExit, time_s: float, log_end: str = ""
    ) -> None:
        """Note that an agent's process ended unplanned at ``time_s`` [s; simulated time].

        It is the agent's own failure unless another process may have killed it. log_end: the end of
        its log, to quote.
        """
        if process_exit.status is not None or process_exit.signal in CRASH_SIGNALS:
            self._ends.append(_Fault(agent, str(process_exit), time_s, log_end))

    def named(self, agent: int) -> bool:
        """Return whether an agent itself is at fault: it hangs, or was stopped."""
        return agent in self._hangs or agent_name(agent) in self._stops

    @property
    def failure(self) -> str | None:
        """Which agents have ended by themselves, or have not returned; None: none.

        Those that did so alike are named together, with the log of the first.
        """
        texts = [*map(_ended, _alike(self._ends)), *map(_hang, _alike(self._hangs.values()))]
        return "; ".join(texts[:MAX_NAMED]) or None

    @property
    def stop(self) -> str | None:
        """Which processes were stopped from outside, or None."""
        return "; ".join(self._stops.values()) or None

    def slow(self, ticks: float) -> str | None:
        """Return which controllers take too long, in a run of so many ticks; None: none does."""
        if self._steps is None:
            return None
        times = {agent: self._steps.page.read(agent) for agent in range(self._steps.agents)}
        slow = {a: t for a, t in times.items() if t.slow_steps > SLOW_FRACTION * ticks}
        if not slow:
            return None
        steps = sum(each.slow_steps for each in slow.values())
        mean_ms = 1e3 * sum(each.slow_s for each in slow.values()) / steps
        names = ", ".join(map(agent_name, list(slow)[:MAX_NAMED]))
        more = f" and {len(slow) - MAX_NAMED} more" if len(slow) > MAX_NAMED else ""
        return f"the controllers of {names}{more} took {mean_ms:.0f} ms a step"

    def _note_stop(self, name: str, process: ProcessState | None, time_s: float) -> None:
        if process is not None and process.stopped and name not in self._stops:
            self._stops[name] = f"{name} was stopped by a signal at {time_s:.1f} s"
            self._report(self._stops[name])

    def _note_hang(
        self, agent: int, times: StepTimes, process: ProcessState, time_s: float
    ) -> None:
        if times.entered_s is None or agent in self._hangs:
            return
        lasts_s = time.monotonic() - times.entered_s
        does = self._hang_in_words(agent, lasts_s, process.cpu_s - times.cpu_s, process)
        if does is None:
            return
        since_s = max(0.0, time_s - lasts_s * self._speed)
        holds = f", and holds {process.resident_b / 1e9:.1f} GB of memory"
        what = f"{does}{holds if process.resident_b > LARGE_B else ''}"
        self._hangs[agent] = _Fault(agent, what, since_s)
        self._report(_hang([self._hangs[agent]]))

    def _hang_in_words(
        self, agent: int, lasts_s: float, cpu_s: float, process: ProcessState
    ) -> str | None:
        """Return what a step does that hangs; None for one that a slow host may delay."""
        if cpu_s > HANG_S:
            return "computes without end"
        if lasts_s <= HANG_S:
            return None
        if self._asleep(agent, process):
            return "is blocked"
        return "computes and waits in turn" if lasts_s > LONG_HANG_S else None

    def _asleep(self, agent: int, process: ProcessState) -> bool:
        """Return whether a process has waited without a break for ASLEEP_S."""
        now_s = time.monotonic()
        switches, since_s = self._asleep_since.get(agent, (-1, now_s))
        if not process.waits or process.switches != switches:
            self._asleep_since[agent] = (process.switches, now_s)
            return False
        return now_s - since_s >= ASLEEP_S


def _alike(faults: Iterable[_Fault]) -> list[list[_Fault]]:
    """Return faults in groups that differ in their agents, times and numbers only, in order."""
    groups: dict[tuple[str, str], list[_Fault]] = {}
    for each in faults:
        groups.setdefault((each.what, NUMBER.sub("0", each.log_end)), []).append(each)
    return list(groups.values())


def _ended(alike: Sequence[_Fault]) -> str:
    """Return which agents have ended, and how, with the end of the first one's log."""
    first, agents = alike[0], [each.agent for each in alike]
    what = first.what if len(alike) == 1 else re.sub("^was ", "were ", first.what)
    return f"{_names(agents)} {what} at {_times(alike)}{first.log_end}"


def _hang(alike: Sequence[_Fault]) -> str:
    """Return whose controllers have not returned, and what they do."""
    agents = _names([each.agent for each in alike])
    if len(alike) == 1:
        who = f"the controller of {agents} has not returned since {_times(alike)}: it"
    else:
        who = f"the controllers of {agents} have not returned since {_times(alike)}: each"
    return f"{who} {alike[0].what}"


def _times(faults: Sequence[_Fault]) -> str:
    times_s = [each.time_s for each in faults]
    first, last = (f"{time_s:.1f} s" for time_s in (min(times_s), max(times_s)))
    return first if first == last else f"{first} to {last}"


def _names(agents: Iterable[int]) -> str:
    """Return the names of agents: "agent-0 to agent-4, agent-7"; of many, the first."""
    runs: list[list[int]] = []
    for agent in sorted(agents):
        if not runs or agent != runs[-1][-1] + 1:
            runs.append([])
        runs[-1].append(agent)
    left = sum(map(len, runs[MAX_NAMED:]))
    more = f" and {left} more" if left else ""
    return f"{', '.join(map(_run, runs[:MAX_NAMED]))}{more}"


def _run(agents: Sequence[int]) -> str:
    """Return the names of agents with ids one after the other."""
    names = list(map(agent_name, agents))
    return f"{names[0]} to {names[-1]}" if len(names) > 2 else ", ".join(names)
