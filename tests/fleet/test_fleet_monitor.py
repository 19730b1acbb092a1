"""What the launcher prints, relays and decides on each message and each exit."""

import io
import os
import signal
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import cast

import msgspec
import pytest
from rich.console import Console

from worldsim.fleet import fleet_monitor
from worldsim.fleet.fleet_monitor import FleetMonitor, ProcessSockets, StartError
from worldsim.fleet.fork import ProcessExit
from worldsim.fleet.ipc import (
    ActionDone,
    ActionRequest,
    AgentExited,
    AgentProcess,
    AgentStarted,
    FromWorld,
    FromZygote,
    Message,
    MessageSocket,
    ProcessesMissing,
    Progress,
    RunFailed,
    RunOver,
    Stalled,
    ToWorld,
    ToZygote,
)
from worldsim.fleet.planned_stops import PlannedKill, PlannedStops
from worldsim.fleet.process_table import ProcessTable, processes
from worldsim.fleet.terminal import Terminal
from worldsim.judge.event import By

AGENT = AgentProcess(2, 0)
KILLED = ProcessExit(9, None)
FAILED = ProcessExit(None, 1)
PROGRESS = Progress(3.21, 20.0, 9, 4, 0.5, 0.0)


class Peer:
    """The other end of one of the launcher's sockets."""

    def __init__(self, name: str, received: object, sent: object) -> None:
        near, self._far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.launchers_end = MessageSocket(near, name, msgspec.msgpack.Decoder(sent))
        self._received = MessageSocket(self._far, "launcher", msgspec.msgpack.Decoder(received))

    def send_raw(self, data: bytes) -> None:
        self._far.send(data)

    def send(self, *messages: Message) -> None:
        for message in messages:
            self._received.send(message)

    def receive(self) -> list[Message]:
        return self._received.receive()

    def close(self) -> None:
        self._far.close()
        self.launchers_end.close()


class Launched:
    """A monitor with both of its peers, its output and its folder."""

    def __init__(self, folder: Path, lockstep: bool) -> None:
        self.zygote = Peer("zygote", ToZygote, FromZygote)
        self.world = Peer("world", ToWorld, FromWorld)
        self.folder = folder
        self._output = io.StringIO()
        self.table = ProcessTable(folder, "mine", "tcp/127.0.0.1:7447")
        self.monitor = FleetMonitor(
            ProcessSockets(self.zygote.launchers_end, self.world.launchers_end),
            Terminal(Console(file=self._output)),
            self.table,
            folder,
            lockstep,
        )

    @property
    def lines(self) -> list[str]:
        return self._output.getvalue().splitlines()

    def begin(self) -> None:
        """Let the run begin, and reach 3.21 s."""
        self.world.send(ProcessesMissing(()), PROGRESS)
        self.monitor.receive_from_world()
        self._output.truncate(0)
        self._output.seek(0)

    def from_zygote(self, *messages: Message) -> None:
        self.zygote.send(*messages)
        self.monitor.receive_from_zygote()

    def from_world(self, *messages: Message) -> None:
        self.world.send(*messages)
        self.monitor.receive_from_world()

    def close(self) -> None:
        self.zygote.close()
        self.world.close()


@pytest.fixture
def launched(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Launched]:
    fleet = Launched(tmp_path, lockstep=getattr(request, "param", False))
    yield fleet
    fleet.close()


lockstep = pytest.mark.parametrize("launched", [True], indirect=True)


def test_started_agents_are_written_to_the_process_table(launched: Launched) -> None:
    launched.from_zygote(AgentStarted(AGENT, os.getpid()))
    assert processes(launched.folder) == [("agent-2", os.getpid(), True)]


def test_a_request_of_the_world_is_relayed_and_its_acknowledgement_returned(
    launched: Launched,
) -> None:
    launched.begin()
    launched.from_world(ActionRequest("pause", (AGENT,)))
    assert launched.zygote.receive() == [ActionRequest("pause", (AGENT,))]
    launched.from_zygote(ActionDone("pause", (AGENT,)))
    assert launched.world.receive() == [ActionDone("pause", (AGENT,))]


def test_an_unexpected_exit_is_printed_and_relayed(launched: Launched) -> None:
    launched.begin()
    launched.from_zygote(AgentExited(AGENT, 123, KILLED))
    assert launched.lines == [
        "agent-2 (pid 123) was killed by signal 9 at about 3.2 s (not scheduled);"
        " its vehicle stops and hovers"
    ]
    assert launched.world.receive() == [AgentExited(AGENT, 123, KILLED)]
    assert not launched.monitor.failed


@lockstep
def test_an_unexpected_exit_ends_a_lockstep_run(launched: Launched) -> None:
    launched.begin()
    launched.from_zygote(AgentExited(AGENT, 123, KILLED))
    assert launched.lines[0].endswith("(not scheduled); the run ends")


@pytest.mark.parametrize("launched", [False, True], indirect=True)
@pytest.mark.parametrize(
    ("by", "origin"), [(None, "(scheduled)"), ("operator", "(by the operator)")]
)
def test_a_kill_that_the_world_requested_is_by_who_asked_for_it(
    launched: Launched, by: By, origin: str
) -> None:
    launched.begin()
    launched.world.send(ActionRequest("kill", (AGENT,), by=by))  # not read before the exit arrives
    launched.from_zygote(AgentExited(AGENT, 123, KILLED))
    assert launched.lines == [f"agent-2 (pid 123) was killed by signal 9 at about 3.2 s {origin}"]
    launched.from_zygote(AgentExited(AgentProcess(2, 1), 124, KILLED))
    assert "(not scheduled)" in launched.lines[1]


def test_an_exit_with_a_status_quotes_the_end_of_the_log(launched: Launched) -> None:
    launched.begin()
    log = launched.folder / "agent-2.log"
    log.write_text("".join(f"line {number}\n" for number in range(9)))
    launched.from_zygote(AgentExited(AGENT, 123, FAILED))
    assert launched.lines[1:] == [
        f"{log} ends with:",
        *(f"  line {number}" for number in range(4, 9)),
    ]
    (relayed,) = launched.world.receive()
    assert isinstance(relayed, AgentExited)
    assert relayed.log_end == f": line 8 ({log.parent.name}/agent-2.log)"


def test_an_exit_before_the_run_has_begun_is_a_start_error(launched: Launched) -> None:
    (launched.folder / "agent-2.log").write_text("no battery\n")
    launched.world.send(ProcessesMissing(("agent-2",)))
    with pytest.raises(StartError, match=r"^agent-2 did not start: it ended with status 1; .*\n"):
        launched.from_zygote(AgentExited(AGENT, 123, FAILED))
    (launched.folder / "netem.log").touch()
    with pytest.raises(StartError, match=r"^netem did not start: .*netem\.log is empty$"):
        launched.monitor.child_exited("netem", FAILED)


def test_the_exit_of_a_child_ends_the_run_once(launched: Launched) -> None:
    launched.begin()
    launched.monitor.child_exited("netem", KILLED)
    launched.monitor.child_exited("world", FAILED)
    assert launched.monitor.failed
    assert launched.lines == ["netem was killed by signal 9 at about 3.2 s; the run ends"]
    assert launched.world.receive() == [RunFailed("netem was killed by signal 9")]


def test_a_child_that_ends_by_an_error_is_quoted(launched: Launched) -> None:
    launched.begin()
    log = launched.folder / "netem.log"
    log.write_text("Traceback (most recent call last):\nZeroDivisionError: division by zero\n\n")
    launched.monitor.child_exited("netem", FAILED)
    quoted = f": ZeroDivisionError: division by zero ({log.parent.name}/netem.log)"
    assert launched.lines == [
        f"netem ended with status 1 at about 3.2 s; the run ends{quoted}",
    ]
    assert launched.world.receive() == [RunFailed(f"netem ended with status 1{quoted}")]


class AskedKills:
    """Planned stops of which each exit is a kill by the operator."""

    def take_kill(self, name: str) -> PlannedKill:
        return PlannedKill("operator")


def test_an_operators_kill_of_netem_or_the_world_is_by_the_operator(launched: Launched) -> None:
    launched.begin()
    launched.monitor.stops = cast(PlannedStops, AskedKills())
    launched.monitor.child_exited("netem", KILLED)
    launched.monitor.child_exited("world", KILLED)
    assert not launched.monitor.failed
    assert launched.lines == [
        "netem was killed by signal 9 at about 3.2 s (by the operator)",
        "world was killed by signal 9 at about 3.2 s (by the operator); the run ends",
    ]


def test_exits_are_expected_once_the_run_is_over(launched: Launched) -> None:
    launched.begin()
    launched.world.send(RunOver())
    launched.from_zygote(AgentExited(AGENT, 123, FAILED))
    launched.monitor.child_exited("netem", ProcessExit(None, 0))
    assert launched.monitor.run_over
    assert not launched.monitor.failed
    assert (launched.lines, launched.world.receive()) == ([], [])


@pytest.mark.parametrize("sender", ["zygote", "world"])
def test_garbage_ends_a_running_fleet_and_names_its_sender(launched: Launched, sender: str) -> None:
    launched.begin()
    peer = launched.zygote if sender == "zygote" else launched.world
    peer.send_raw(b"landing")
    launched.monitor.receive_from_zygote()
    launched.monitor.receive_from_world()
    assert launched.monitor.failed
    assert len(launched.lines) == 1
    assert launched.lines[0].startswith(f"{sender} sent a message that cannot be decoded: ")
    (failure,) = launched.world.receive()
    assert isinstance(failure, RunFailed)
    assert failure.reason.startswith(f"{sender} sent a message that cannot be decoded: ")


@pytest.mark.parametrize("sender", ["zygote", "world"])
def test_garbage_before_the_run_has_begun_is_a_start_error(launched: Launched, sender: str) -> None:
    peer = launched.zygote if sender == "zygote" else launched.world
    peer.send_raw(b"landing")
    with pytest.raises(StartError, match=rf"^the fleet did not start: {sender} sent a message"):
        launched.monitor.receive_from_zygote()
        launched.monitor.receive_from_world()


@pytest.mark.parametrize("sender", ["zygote", "world"])
def test_garbage_does_not_disturb_the_end_of_a_run(launched: Launched, sender: str) -> None:
    launched.monitor.run_over = True
    peer = launched.zygote if sender == "zygote" else launched.world
    peer.send_raw(b"landing")
    launched.monitor.receive_from_zygote()
    launched.monitor.receive_from_world()
    assert not launched.monitor.failed
    assert launched.lines == []


def test_a_stall_names_what_it_waits_for_and_which_processes_are_stopped(
    launched: Launched,
) -> None:
    launched.begin()
    launched.from_world(Stalled("netem's answer of slot 3"))
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE) as process:
        process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, process.pid, os.WSTOPPED)
        launched.from_zygote(AgentStarted(AGENT, process.pid))
        launched.from_world(Stalled("agent-2's command of slot 5"))
        launched.from_world(ActionRequest("pause", (AGENT,)))
        launched.from_world(Stalled("agent-3's command of slot 6"))
        process.kill()
    assert launched.lines == [
        "stalled: waiting for netem's answer of slot 3",
        "stalled: waiting for agent-2's command of slot 5; stopped: agent-2",
        "stalled: waiting for agent-3's command of slot 6",
    ]


def test_progress_is_printed_now_and_then_where_there_is_no_terminal(launched: Launched) -> None:
    launched.from_world(ProcessesMissing(()), PROGRESS, PROGRESS)
    assert launched.lines == [
        "3.2 of 20 s   in place 4/9   minimum separation 0.50 m   late ticks 0.0%"
    ]


def test_missing_processes_are_printed_until_all_are_present(
    launched: Launched, monkeypatch: pytest.MonkeyPatch
) -> None:
    launched.from_world(ProcessesMissing(("netem", "agent-3")))
    launched.monitor.report_missing()
    assert launched.lines == []  # it is too early
    later = fleet_monitor.time.monotonic() + fleet_monitor.REPORT_MISSING_EVERY_S
    monkeypatch.setattr(fleet_monitor.time, "monotonic", lambda: later)
    launched.monitor.report_missing()
    launched.monitor.report_missing()
    assert launched.lines == ["still waiting for netem, agent-3"]
    assert not launched.monitor.all_present
    launched.from_world(ProcessesMissing(()))
    assert launched.monitor.all_present


def test_a_quiet_terminal_shows_errors_alone() -> None:
    output = io.StringIO()
    terminal = Terminal(Console(file=output), quiet=True)
    terminal.print("starting")
    terminal.show(PROGRESS)
    terminal.print_error("netem was killed")
    terminal.close()
    assert output.getvalue() == "netem was killed\n"
