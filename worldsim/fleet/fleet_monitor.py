"""The launcher's reactions to messages and exits: reports, relays, and the state of the run.

Agents' exits come from the zygote, progress and requests from the world; the launcher's own
children exit under its supervisor.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeVar, assert_never

import msgspec

from worldsim.fleet.fork import ProcessExit
from worldsim.fleet.ipc import (
    ActionDone,
    ActionRequest,
    AgentExited,
    AgentProcess,
    AgentStarted,
    FromWorld,
    FromZygote,
    IntruderEndRequest,
    IntruderExited,
    IntruderRequest,
    IntruderStarted,
    LauncherToWorld,
    LauncherToZygote,
    MessageError,
    Notice,
    OtherProcessRequest,
    ProcessesMissing,
    Progress,
    RunFailed,
    RunOver,
    Stalled,
)
from worldsim.fleet.planned_stops import WORLD, PlannedStops
from worldsim.fleet.process_table import ProcessTable
from worldsim.fleet.terminal import Terminal
from worldsim.judge.event import By
from worldsim.judge.event_text import origin

REPORT_MISSING_EVERY_S = 5.0
TAIL_LINES = 5
MAX_TAIL_B = 4096
MAX_QUOTED = 300
"""[characters]"""

_T = TypeVar("_T")


class StartError(RuntimeError):
    """A process of the fleet that did not start; the text names it and quotes its log."""


class ProcessSockets(NamedTuple):
    """The launcher's ends of its socket pairs."""

    zygote: LauncherToZygote
    world: LauncherToWorld


class FleetMonitor:
    """Handles the messages and exits of one launched fleet.

    lockstep: an unexpected exit of an agent ends the run.
    """

    def __init__(
        self,
        sockets: ProcessSockets,
        terminal: Terminal,
        table: ProcessTable,
        logs: Path,
        lockstep: bool,
    ) -> None:
        self.run_over = False
        """Whether exits are expected from now on."""
        self.failed = False
        """Whether the run cannot go on."""
        self.stops: PlannedStops | None = None
        """Carries out planned stops of netem and the world; None: there are none."""
        self.world_exit: str | None = None
        """How the world ended before the run was over; None: it did not."""
        self._zygote, self._world = sockets
        self._terminal = terminal
        self._table = table
        self._logs = logs
        self._lockstep = lockstep
        self._expected_exits: dict[AgentProcess, By] = {}
        """Who asked for each exit that is expected."""
        self._missing: tuple[str, ...] | None = None
        self._report_missing_at_s = time.monotonic() + REPORT_MISSING_EVERY_S
        self._time_s = 0.0

    @property
    def all_present(self) -> bool:
        """Whether the world has reported that no process is missing: the run has begun."""
        return self._missing == ()

    def receive_from_zygote(self) -> None:
        """Handle the messages that the zygote has sent.

        Before the run has begun, raises StartError at an agent's exit and at a message that does
        not decode. Raises RunWriteError when fleet.json cannot be written.
        """
        messages = self._received(self._zygote.receive)
        for message in messages:
            self._handle_zygote(message)
        started = any(isinstance(each, AgentStarted | IntruderStarted) for each in messages)
        if not self.run_over and started:
            self._table.write()

    def receive_from_world(self) -> None:
        """Handle the messages that the world has sent.

        Raises StartError at one that does not decode, before the run has begun.
        """
        for message in self._received(self._world.receive):
            self._handle_world(message)

    def child_exited(self, name: str, process_exit: ProcessExit) -> None:
        """Handle the exit of a child of the launcher: of the zygote, netem or the world.

        Raises StartError before the run has begun.
        """
        self.receive_from_world()  # the world may have reported the run's end just before
        if self.run_over:
            return
        if not self.all_present:
            raise self._start_error(name, process_exit)
        planned = self.stops.take_kill(name) if self.stops is not None else None
        if name == WORLD:
            self.world_exit = f"the world {process_exit} at about {self._time_s:.1f} s"
        if planned is not None:
            ends = "; the run ends" if name == WORLD else ""
            when = f"at about {self._time_s:.1f} s{origin(planned.by)}"
            self._terminal.print(f"{name} {process_exit} {when}{ends}")
        else:
            self._fail(f"{name} {process_exit}", self._log_end(name, process_exit))

    def report_missing(self) -> None:
        """Print now and then which processes are still missing."""
        if self._missing and time.monotonic() > self._report_missing_at_s:
            self._report_missing_at_s = time.monotonic() + REPORT_MISSING_EVERY_S
            self._terminal.print(f"still waiting for {', '.join(self._missing)}")

    def log_tail(self, name: str) -> str:
        """Return the last lines of a process's log, as part of a message."""
        log = self._logs / f"{name}.log"
        lines = log.read_bytes()[-MAX_TAIL_B:].decode("utf-8", "replace").splitlines()
        if not lines:
            return f"{log} is empty"
        return "\n  ".join([f"{log} ends with:", *lines[-TAIL_LINES:]])

    def _received(self, receive: Callable[[], list[_T]]) -> list[_T]:
        """Return the messages of a socket; a message that does not decode fails the run."""
        try:
            return receive()
        except MessageError as error:
            if not self.run_over and not self.all_present:
                raise StartError(f"the fleet did not start: {error}") from error
            self._fail(str(error))
            return []

    def _log_end(self, name: str, process_exit: ProcessExit) -> str:
        """Return the last line of the log of a process that ended by an error, to be appended."""
        log = self._logs / f"{name}.log"
        if not process_exit.status or not log.exists():
            return ""
        lines = log.read_bytes()[-MAX_TAIL_B:].decode("utf-8", "replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "")
        return f": {last[:MAX_QUOTED]} ({log.parent.name}/{log.name})" if last else ""

    def _fail(self, reason: str, log_end: str = "") -> None:
        """End the run. log_end: the end of a log, to quote."""
        if self.run_over or self.failed:
            return
        self.failed = True
        when = f" at about {self._time_s:.1f} s"
        self._terminal.print_error(f"{reason}{when}; the run ends{log_end}")
        self._world.send(RunFailed(f"{reason}{log_end}"))

    def _handle_zygote(self, message: FromZygote) -> None:
        match message:
            case AgentStarted(process=process, pid=pid):
                self._table.add(f"agent-{process.agent}", pid)
            case AgentExited():
                self._agent_exited(message)
            case ActionDone():
                self._world.send(message)
            case IntruderStarted(number=number, pid=pid):
                self._table.add(f"intruder-{number}", pid)
            case IntruderExited(number=number, exit=process_exit):
                name = f"intruder-{number}"
                self._terminal.print_error(f"{name} {process_exit}; {self.log_tail(name)}")
            case _:
                assert_never(message)

    def _handle_world(self, message: FromWorld) -> None:
        match message:
            case Progress():
                self._time_s = message.time_s
                self._terminal.show(message)
            case ActionRequest() | OtherProcessRequest():
                self._relay(message)
            case IntruderRequest() | IntruderEndRequest():
                self._zygote.send(message)
            case ProcessesMissing(names=names):
                self._missing = names
            case Stalled(waiting_for=waiting_for):
                self._report_stall(waiting_for)
            case Notice(text=text):
                self._terminal.print(text)
            case RunOver():
                self.run_over = True
            case _:
                assert_never(message)

    def _relay(self, request: ActionRequest | OtherProcessRequest) -> None:
        """Send a request of the world to the zygote, the parent of the agents, or carry it out."""
        if isinstance(request, OtherProcessRequest):
            if self.stops is not None and not self.run_over:
                self.stops.carry_out(request)
            return
        if request.action == "kill":
            self._expected_exits.update(dict.fromkeys(request.processes, request.by))
        self._table.note_action(request.action, request.processes)
        self._zygote.send(request)

    def _report_stall(self, waiting_for: str) -> None:
        stopped = self._table.stopped()
        suffix = f"; stopped: {', '.join(stopped)}" if stopped else ""
        self._terminal.print(f"stalled: waiting for {waiting_for}{suffix}")

    def _agent_exited(self, message: AgentExited) -> None:
        # The kill that caused this exit, or the run's end, is there already: read it first.
        self.receive_from_world()
        if self.run_over:
            return
        name, process_exit = f"agent-{message.process.agent}", message.exit
        if not self.all_present:
            raise self._start_error(name, process_exit)
        log_end = self._log_end(name, process_exit)
        self._world.send(msgspec.structs.replace(message, log_end=log_end))
        expected = message.process in self._expected_exits
        show = self._terminal.print if expected else self._terminal.print_error
        show(
            f"{name} (pid {message.pid}) {process_exit} at about {self._time_s:.1f} s"
            f"{self._consequence(message.process)}"
        )
        if process_exit.status is not None:
            self._terminal.print_error(self.log_tail(name))

    def _consequence(self, process: AgentProcess) -> str:
        if process in self._expected_exits:
            return origin(self._expected_exits[process])
        ends = "the run ends" if self._lockstep else "its vehicle stops and hovers"
        return f" (not scheduled); {ends}"

    def _start_error(self, name: str, process_exit: ProcessExit) -> StartError:
        return StartError(f"{name} did not start: it {process_exit}; {self.log_tail(name)}")
