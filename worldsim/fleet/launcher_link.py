"""The world's link to its launcher: exits, actions on processes, progress, stop requests.

Under a launcher, exits are what waitpid reports, and the launcher shows progress. When processes
are started by hand, exits are inferred from Zenoh liveliness, and progress is printed.
"""

import select
import time
from collections.abc import Callable, Iterable, Sequence
from math import inf
from typing import NamedTuple, Protocol, assert_never

from worldsim.fleet.culprits import SharedSteps
from worldsim.fleet.fork import ProcessExit
from worldsim.fleet.intruder import IntruderCounts
from worldsim.fleet.ipc import (
    ActionDone,
    ActionRequest,
    AgentExited,
    AgentProcess,
    IntruderEndRequest,
    IntruderRequest,
    MessageError,
    Notice,
    OtherProcessRequest,
    ProcessAction,
    ProcessesMissing,
    Progress,
    RunFailed,
    RunOver,
    Stalled,
    ToWorld,
    WorldToLauncher,
    WorldWoken,
    names_of,
)
from worldsim.judge.event import By
from worldsim.scenario.selectors import ProcessName

PRINT_EVERY_S = 2.0


class AgentExit(NamedTuple):
    """The end of an agent's process."""

    agent: int
    incarnation: int | None = None  # None: unknown, for processes started by hand
    exit: ProcessExit = ProcessExit(None, None)  # unknown, for processes started by hand
    log_end: str = ""  # see AgentExited

    def __str__(self) -> str:
        return f"agent-{self.agent} {self.exit}{self.log_end}"


class LauncherLink(Protocol):
    """What the world needs of the launcher, or of its substitute when there is none."""

    controls_processes: bool
    """Whether processes can be started, killed, paused and resumed."""

    failure: str | None
    """Why the run cannot go on (netem died, for instance), or None."""

    steps: SharedSteps | None
    """Where the agents note their steps, or None."""

    @property
    def orphaned(self) -> bool:
        """Whether the launcher is gone, and cannot clean up."""

    @property
    def stop_reason(self) -> str | None:
        """Why the run must end now, or None."""

    def wait(self, left_s: float) -> None:
        """Wait ``left_s`` [s], or less when a message arrives."""

    def agent_exits(self) -> list[AgentExit]:
        """Return the agents' processes that ended since the last call, expected or not."""

    def request(
        self,
        action: ProcessAction,
        processes: Sequence[AgentProcess],
        after_s: float = 0.0,
        by: By = None,
    ) -> None:
        """Request an action on agents' processes; without processes do nothing.

        A process that is started sleeps ``after_s`` [s] of wall time first. by: who asked for it.
        """

    def stop(
        self, process: ProcessName, action: ProcessAction, for_s: float = 0.0, by: By = None
    ) -> None:
        """Request an action on netem's processes or the world's.

        A pause of the world ends after ``for_s`` [s] of wall time. by: who asked for it.
        """

    def is_woken(self) -> bool:
        """Return whether a pause of the world is over; True once for each."""

    def has_done(self, action: ProcessAction, processes: Sequence[AgentProcess]) -> bool:
        """Return whether a requested action has taken effect; True once for each request."""

    def request_intruder(self, request: IntruderRequest | IntruderEndRequest) -> None:
        """Request the start or the end of an intruder."""

    def messages_put(self, number: int) -> int | None:
        """Return how many messages the intruder of a fault has put; None where nobody counts."""

    def report_missing(self, names: Iterable[str]) -> None:
        """Report which processes are missing at the start; no names: none is missing."""

    def report_progress(self, progress: Progress) -> None:
        """Report the state of the running fleet."""

    def report_stall(self, waiting_for: str) -> None:
        """Report that simulated time stands still, and what it waits for."""

    def report_notice(self, text: str) -> None:
        """Report something that a person should know at once."""

    def report_run_over(self) -> None:
        """Report that the run is over, before the other processes learn of it and exit."""


class LaunchedLink:
    """The link to a launcher over a socket."""

    controls_processes = True

    def __init__(
        self,
        launcher: WorldToLauncher,
        steps: SharedSteps | None = None,
        counts: IntruderCounts | None = None,
    ) -> None:
        self.steps = steps
        self._counts = counts
        self._launcher = launcher
        self._exits: list[AgentExit] = []
        self._done: list[ActionDone] = []
        self._woken = 0
        self.failure: str | None = None

    @property
    def orphaned(self) -> bool:
        """Whether the launcher is gone."""
        return self._launcher.closed

    @property
    def stop_reason(self) -> str | None:
        """The run ends with the launcher, and with a failure that the launcher reports."""
        return "the launcher is gone" if self._launcher.closed else self.failure

    def wait(self, left_s: float) -> None:
        """Wait ``left_s`` [s], or less when the launcher sends a message."""
        if left_s > 0.0:
            select.select([] if self._launcher.closed else [self._launcher], [], [], left_s)
        self._receive()

    def agent_exits(self) -> list[AgentExit]:
        """Return the exits that the launcher reported since the last call."""
        self._receive()
        exits, self._exits = self._exits, []
        return exits

    def request(
        self,
        action: ProcessAction,
        processes: Sequence[AgentProcess],
        after_s: float = 0.0,
        by: By = None,
    ) -> None:
        """Ask the launcher for an action."""
        if processes:
            self._launcher.send(ActionRequest(action, tuple(processes), after_s, by))

    def stop(
        self, process: ProcessName, action: ProcessAction, for_s: float = 0.0, by: By = None
    ) -> None:
        """Ask the launcher for an action on netem's processes or the world's."""
        self._launcher.send(OtherProcessRequest(process, action, for_s, by))

    def is_woken(self) -> bool:
        """Return whether the launcher has ended a pause of the world."""
        self._receive()
        woken = self._woken > 0
        self._woken -= woken
        return woken

    def has_done(self, action: ProcessAction, processes: Sequence[AgentProcess]) -> bool:
        """Return whether the zygote has acknowledged an action."""
        self._receive()
        done = ActionDone(action, tuple(processes))
        if done not in self._done:
            return False
        self._done.remove(done)
        return True

    def request_intruder(self, request: IntruderRequest | IntruderEndRequest) -> None:
        """Ask the launcher for it."""
        self._launcher.send(request)

    def messages_put(self, number: int) -> int | None:
        """Return how many messages the intruder of a fault has put."""
        return self._counts.read(number) if self._counts is not None else None

    def report_missing(self, names: Iterable[str]) -> None:
        """Tell the launcher which processes are missing."""
        self._launcher.send(ProcessesMissing(tuple(names)))

    def report_progress(self, progress: Progress) -> None:
        """Send progress, unless the launcher has fallen behind in reading."""
        self._launcher.offer(progress)

    def report_stall(self, waiting_for: str) -> None:
        """Send what the run waits for, unless the launcher has fallen behind in reading."""
        self._launcher.offer(Stalled(waiting_for))

    def report_notice(self, text: str) -> None:
        """Send it, unless the launcher has fallen behind in reading."""
        self._launcher.offer(Notice(text))

    def report_run_over(self) -> None:
        """Tell the launcher that exits are expected from now on."""
        self._launcher.send(RunOver())

    def _receive(self) -> None:
        try:
            for message in self._launcher.receive():
                self._handle(message)
        except MessageError as error:
            self.failure = str(error)

    def _handle(self, message: ToWorld) -> None:
        match message:
            case AgentExited(process=process, exit=process_exit, log_end=log_end):
                self._exits.append(
                    AgentExit(process.agent, process.incarnation, process_exit, log_end)
                )
            case ActionDone():
                self._done.append(message)
            case WorldWoken():
                self._woken += 1
            case RunFailed(reason=reason):
                self.failure = reason
            case _:
                assert_never(message)


class ManualLink:
    """The substitute for a link when processes are started by hand.

    ``vanished`` returns the names of the processes whose liveliness ended since its last call.
    """

    controls_processes = False
    orphaned = False
    steps: SharedSteps | None = None

    def __init__(self, vanished: Callable[[], list[str]]) -> None:
        self.stop_reason: str | None = None
        self.failure: str | None = None
        self._vanished = vanished
        self._print_at_s = -inf

    def wait(self, left_s: float) -> None:
        """Wait ``left_s`` [s]; no message ever arrives."""
        if left_s > 0.0:
            time.sleep(left_s)

    def agent_exits(self) -> list[AgentExit]:
        """Return the agents that vanished.

        When netem, the router, vanished too, every process seems to have: then only stop the run.
        """
        vanished = self._vanished()
        if "netem" in vanished:
            self.stop_reason = "netem is gone"
            return []
        agents = [int(n.removeprefix("agent-")) for n in vanished if n.startswith("agent-")]
        for agent in agents:
            print(f"agent-{agent} is gone", flush=True)
        return [AgentExit(agent) for agent in agents]

    def request(
        self,
        action: ProcessAction,
        processes: Sequence[AgentProcess],
        after_s: float = 0.0,
        by: By = None,
    ) -> None:
        """Refuse: a process that was started by hand is ended by hand. Raises LookupError."""
        raise LookupError(
            f"cannot {action} {names_of(processes)}: these processes were started by hand"
        )

    def stop(
        self, process: ProcessName, action: ProcessAction, for_s: float = 0.0, by: By = None
    ) -> None:
        """Refuse: a process that was started by hand is stopped by hand. Raises LookupError."""
        raise LookupError(f"cannot {action} {process}: these processes were started by hand")

    def is_woken(self) -> bool:
        """Refuse: no pause was accepted. Raises LookupError."""
        raise LookupError("no pause of the world was accepted")

    def has_done(self, action: ProcessAction, processes: Sequence[AgentProcess]) -> bool:
        """Refuse: no action was accepted. Raises LookupError."""
        raise LookupError(f"no request to {action} {names_of(processes)} was accepted")

    def request_intruder(self, request: IntruderRequest | IntruderEndRequest) -> None:
        """Refuse: nothing here starts processes. Raises LookupError."""
        raise LookupError(f"no launcher starts or ends intruder-{request.number}")

    def messages_put(self, number: int) -> int | None:
        """Return None: nobody counts them."""
        return None

    def report_missing(self, names: Iterable[str]) -> None:
        """Print which processes are missing, at most every two seconds."""
        missing = ", ".join(names)
        if not missing:
            print("all processes are present", flush=True)
        elif self._print_is_due():
            print(f"waiting for {missing}", flush=True)

    def report_progress(self, progress: Progress) -> None:
        """Print progress, at most every two seconds."""
        if self._print_is_due():
            print(progress, flush=True)

    def report_stall(self, waiting_for: str) -> None:
        """Print what the run waits for."""
        print(f"stalled: waiting for {waiting_for}", flush=True)

    def report_notice(self, text: str) -> None:
        """Print it."""
        print(text, flush=True)

    def report_run_over(self) -> None:
        """Print that the run is over."""
        print("world: the run is over", flush=True)

    def _print_is_due(self) -> bool:
        now_s = time.monotonic()
        due = now_s >= self._print_at_s
        if due:
            self._print_at_s = now_s + PRINT_EVERY_S
        return due
