"""The zygote: a warm, single-threaded process without Zenoh sessions that forks the agents.

The launcher sends it requests over a socket pair, at the start and during the run: start, kill,
pause or resume agents. It reaps the agents and reports each exit as waitpid gives it; the launcher
relies on these reports alone.
"""

import gc
import os
import resource
import selectors
import signal
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple, assert_never

from agent import process as agent_process
from agent.step_page import CLOSED_FILES, StepPage
from worldsim.fleet import foreign_agent, intruder
from worldsim.fleet.fork import ProcessExit, adopt_orphans, end_orphans, fork, reap
from worldsim.fleet.intruder import Attack, IntruderCounts
from worldsim.fleet.ipc import (
    ActionDone,
    ActionRequest,
    AgentExited,
    AgentProcess,
    AgentStarted,
    EndRequest,
    IntruderEndRequest,
    IntruderExited,
    IntruderRequest,
    IntruderStarted,
    MessageError,
    ToZygote,
    ZygoteToLauncher,
)
from worldsim.fleet.warm_up import warm_up

END_WITHIN_S = 2.0
AGENT_MEMORY_B = 2 * 1024**3
"""What an agent may allocate, beside what it shares with others."""
AGENT_FILE_B = 64 * 1024**2
"""The longest file that an agent may write; its log stays far below."""
CLOSED_FILES_EXIT = ProcessExit(None, CLOSED_FILES)
NO_COMMANDS: Mapping[int, tuple[str, ...]] = MappingProxyType({})


class AgentProcessConfig(NamedTuple):
    """The settings that all agent processes of a run share."""

    run: str  # name of the run
    endpoint: str  # of the Zenoh router
    logs: Path  # folder of the log files
    users: Path | None = None  # file of passwords, where the router requires one
    steps: StepPage | None = None  # where agents note their steps
    inputs: Path | None = None  # folder where agents keep all that they are given
    counts: IntruderCounts | None = None  # where intruders count their messages
    commands: Mapping[int, tuple[str, ...]] = NO_COMMANDS  # of each foreign agent, by id


class Zygote:
    """Forks agents on request and reports their exits.

    It ends all agents when the launcher asks for it, is gone, or sends a message that does not
    decode.
    """

    def __init__(self, launcher: ZygoteToLauncher, config: AgentProcessConfig) -> None:
        self._launcher = launcher
        self._config = config
        self._agents: dict[int, AgentProcess] = {}  # by pid
        self._intruders: dict[int, int] = {}  # pids, by their faults' numbers
        self._selector = selectors.DefaultSelector()
        self._guard: foreign_agent.GroupGuard | None = None
        self._ending = False
        self._status = 0

    def serve(self) -> int:
        """Serve until asked to end or the launcher is gone, then end all agents.

        Returns the exit status: 0, or 1 after a message that does not decode.
        """
        adopt_orphans()
        warm_up()
        if self._config.commands:
            self._guard = foreign_agent.GroupGuard(self._launcher.close)
        gc.freeze()  # keeps the warm objects' memory pages shared with the children
        self._selector.register(self._launcher, selectors.EVENT_READ, self._receive)
        while not self._ending:
            self._poll(None)
        self._selector.unregister(self._launcher)
        self._end_agents()
        end_orphans(())
        return self._status

    def _end_agents(self) -> None:
        for number in list(self._intruders):
            self._end_intruder(number)
        self._signal_all(signal.SIGTERM)
        self._signal_all(signal.SIGCONT)  # a paused agent handles SIGTERM once it continues
        deadline = time.monotonic() + END_WITHIN_S
        while self._agents and (left_s := deadline - time.monotonic()) > 0.0:
            self._poll(left_s)
        self._signal_all(signal.SIGKILL)
        while self._agents:
            self._poll(None)

    def _poll(self, timeout_s: float | None) -> None:
        for key, _ in self._selector.select(timeout_s):
            callback: Callable[[], None] = key.data
            callback()

    def _receive(self) -> None:
        try:
            for message in self._launcher.receive():
                self._handle(message)
        except MessageError as error:
            print(f"zygote: {error}", file=sys.stderr)
            self._ending, self._status = True, 1
        self._ending = self._ending or self._launcher.closed

    def _handle(self, message: ToZygote) -> None:
        match message:
            case ActionRequest():
                for process in message.processes:
                    self._act_on(process, message)
                self._launcher.send(ActionDone(message.action, message.processes))
            case IntruderRequest():
                self._start_intruder(message)
            case IntruderEndRequest(number=number):
                self._end_intruder(number)
            case EndRequest():
                self._ending = True
            case _:
                assert_never(message)

    def _start_intruder(self, request: IntruderRequest) -> None:
        number, config = request.number, self._config
        attack = Attack(config.run, config.endpoint, config.users, request.agents, request.per_s)

        def main() -> int:
            self._launcher.close()
            _limit_resources()
            counts = config.counts if config.counts is not None else IntruderCounts()
            return intruder.run(attack, counts.row(number))

        pid = fork(config.logs / f"intruder-{number}.log", signal.SIGKILL, main)
        exit_descriptor = os.pidfd_open(pid)
        self._intruders[number] = pid
        self._selector.register(
            exit_descriptor,
            selectors.EVENT_READ,
            lambda: self._reap_intruder(exit_descriptor, number, pid),
        )
        self._launcher.send(IntruderStarted(number, pid))

    def _end_intruder(self, number: int) -> None:
        """Kill an intruder and wait until it is gone: it must not outlive its fault."""
        pid = self._intruders.pop(number, None)
        if pid is not None:
            os.kill(pid, signal.SIGKILL)
            os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)

    def _reap_intruder(self, exit_descriptor: int, number: int, pid: int) -> None:
        process_exit = reap(pid)
        if process_exit is None:
            return
        self._selector.unregister(exit_descriptor)
        os.close(exit_descriptor)
        if self._intruders.get(number) == pid:
            del self._intruders[number]
            self._launcher.send(IntruderExited(number, process_exit))

    def _act_on(self, process: AgentProcess, request: ActionRequest) -> None:
        match request.action:
            case "start":
                self._start(process, request.after_s)
            case "kill":
                self._signal(process, signal.SIGKILL)
            case "pause":
                self._signal(process, signal.SIGSTOP, os.WSTOPPED)
            case "resume":
                self._signal(process, signal.SIGCONT, os.WCONTINUED)
            case _:
                assert_never(request.action)

    def _signal(
        self, process: AgentProcess, number: signal.Signals, awaited: int | None = None
    ) -> None:
        """Signal a process unless it has ended; wait for the state that waitid calls ``awaited``.

        Without that wait, the acknowledgement could precede the signal's effect.
        """
        for pid, running in self._agents.items():
            if running == process:
                self._kill(pid, number)
                if awaited is not None:
                    os.waitid(os.P_PID, pid, awaited | os.WEXITED | os.WNOWAIT)

    def _start(self, process: AgentProcess, after_s: float) -> None:
        pid = fork(
            self._log(process), signal.SIGKILL, lambda: self._run_agent(process.agent, after_s)
        )
        if self._guard is not None and process.agent in self._config.commands:
            foreign_agent.own_group(pid)
            self._guard.watch(pid)
            if self._config.steps is not None:  # a foreign agent does not write its row itself
                self._config.steps.note_pid(process.agent, pid)
        exit_descriptor = os.pidfd_open(pid)
        self._agents[pid] = process
        self._selector.register(
            exit_descriptor, selectors.EVENT_READ, lambda: self._reap(exit_descriptor, pid)
        )
        self._launcher.send(AgentStarted(process, pid))

    def _run_agent(self, agent: int, after_s: float) -> int:
        self._launcher.close()
        time.sleep(after_s)
        _limit_resources()
        config = self._config
        command = config.commands.get(agent)
        if command is not None:
            told = foreign_agent.options_of(agent, config.run, config.endpoint, config.users)
            return foreign_agent.become(agent, command, told)
        row = config.steps.row(agent) if config.steps is not None else None
        kept = agent_process.Kept(row, config.inputs)
        patience = agent_process.LAUNCHED
        return agent_process.run(agent, config.run, config.endpoint, patience, config.users, kept)

    def _reap(self, exit_descriptor: int, pid: int) -> None:
        if self._agents[pid].agent in self._config.commands:
            foreign_agent.signal_group(pid, signal.SIGKILL)  # what it has started ends with it
        process_exit = reap(pid)
        if process_exit is None:
            return
        if self._guard is not None:
            self._guard.forget(pid)
        self._selector.unregister(exit_descriptor)
        os.close(exit_descriptor)
        process = self._agents.pop(pid)
        if process_exit == CLOSED_FILES_EXIT:
            self._log_closed_files(process)
        self._launcher.send(AgentExited(process, pid, process_exit))

    def _log_closed_files(self, process: AgentProcess) -> None:
        """Write what an agent without descriptors cannot write."""
        with suppress(OSError), self._log(process).open("a", encoding="utf-8") as log:
            log.write(f"{process}: its controller closed the files of its process\n")

    def _log(self, process: AgentProcess) -> Path:
        return self._config.logs / f"{process}.log"

    def _signal_all(self, number: signal.Signals) -> None:
        for pid in self._agents:
            self._kill(pid, number)

    def _kill(self, pid: int, number: signal.Signals) -> None:
        """Signal an agent's process, and what a foreign one has started."""
        if self._agents[pid].agent in self._config.commands:
            foreign_agent.signal_group(pid, number)
        else:
            os.kill(pid, number)


def _limit_resources() -> None:
    """Bound what one agent's process may allocate and write, where the limits are not lower."""
    limits = {resource.RLIMIT_DATA: AGENT_MEMORY_B, resource.RLIMIT_FSIZE: AGENT_FILE_B}
    for kind, most_b in limits.items():
        _, hard = resource.getrlimit(kind)
        if hard == resource.RLIM_INFINITY or hard > most_b:
            resource.setrlimit(kind, (most_b, hard))
