"""The zygote: a warm process of one thread, without sessions, that agents are forked from.

It does what the launcher asks for over a socket pair, at the start or late: start agents, kill,
pause or resume them. It reaps its agents and reports each exit as waitpid has it, which is what the
launcher believes.
"""

import gc
import os
import selectors
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from agent import process as agent_process
from worldsim.fleet.fork import fork, reaped
from worldsim.fleet.ipc import Line, MessageSocket

END_WITHIN_S = 2.0
SIGNALS = {"kill": signal.SIGKILL, "pause": signal.SIGSTOP, "resume": signal.SIGCONT}
ARRIVED = {signal.SIGSTOP: os.WSTOPPED, signal.SIGCONT: os.WCONTINUED}
"""What waitid waits for, to see that a signal has done what it should."""


class Brood(NamedTuple):
    """What all agents of a run have in common.

    patient: who is silent for long is still there. users: the file of passwords.
    """

    run: str
    endpoint: str
    logs: Path
    patient: bool = False
    users: Path | None = None


class Zygote:
    """Forks agents on request, and reports their exits; ends them all when asked or alone."""

    def __init__(self, lines: MessageSocket, brood: Brood) -> None:
        self._lines = lines
        self._brood = brood
        self._agents: dict[int, tuple[int, int]] = {}
        self._watch = selectors.DefaultSelector()
        self._ending = False

    def serve(self) -> int:
        """Serve until told to end, or the launcher is gone; return 0 when no agent is left."""
        gc.freeze()  # what is warm stays shared with the children
        self._watch.register(self._lines, selectors.EVENT_READ, self._hear)
        while not self._ending:
            self._turn(None)
        self._watch.unregister(self._lines)
        self._signal_all(signal.SIGTERM)
        self._signal_all(signal.SIGCONT)  # who is paused ends, too
        deadline = time.monotonic() + END_WITHIN_S
        while self._agents and (left_s := deadline - time.monotonic()) > 0.0:
            self._turn(left_s)
        self._signal_all(signal.SIGKILL)
        while self._agents:
            self._turn(None)
        return 0

    def _turn(self, timeout_s: float | None) -> None:
        for key, _ in self._watch.select(timeout_s):
            act: Callable[[], None] = key.data
            act()

    def _hear(self) -> None:
        for line in self._lines.receive():
            self._obey(line)
        self._ending = self._ending or self._lines.closed

    def _obey(self, line: Line) -> None:
        if "end" in line:
            self._ending = True
            return
        for agent, incarnation in line["whom"]:
            if line["do"] == "start":
                self._spawn(agent, incarnation, line["after_s"])
            else:
                self._signal(agent, incarnation, SIGNALS[line["do"]])
        self._lines.send(done=line["do"], whom=line["whom"])

    def _signal(self, agent: int, incarnation: int, number: signal.Signals) -> None:
        """Send a signal to an agent's process; to one that has ended there is nothing to do."""
        for pid, who in self._agents.items():
            if who == (agent, incarnation):
                os.kill(pid, number)
                if number in ARRIVED:
                    os.waitid(os.P_PID, pid, ARRIVED[number] | os.WEXITED | os.WNOWAIT)

    def _spawn(self, agent: int, incarnation: int, after_s: float) -> None:
        log = self._brood.logs / f"agent-{agent}.log"
        pid = fork(log, signal.SIGKILL, lambda: self._live(agent, after_s))
        exit_descriptor = os.pidfd_open(pid)
        self._agents[pid] = (agent, incarnation)
        self._watch.register(
            exit_descriptor, selectors.EVENT_READ, lambda: self._bury(exit_descriptor, pid)
        )
        self._lines.send(spawned=agent, pid=pid, incarnation=incarnation)

    def _live(self, agent: int, after_s: float) -> int:
        self._lines.close()
        time.sleep(after_s)
        brood = self._brood
        return agent_process.run(agent, brood.run, brood.endpoint, brood.patient, brood.users)

    def _bury(self, exit_descriptor: int, pid: int) -> None:
        end = reaped(pid)
        if end is None:
            return
        self._watch.unregister(exit_descriptor)
        os.close(exit_descriptor)
        agent, incarnation = self._agents.pop(pid)
        self._lines.send(exit=[agent, incarnation, *end], pid=pid)

    def _signal_all(self, number: signal.Signals) -> None:
        for pid in self._agents:
            os.kill(pid, number)
