"""The world's link to its launcher, and its substitute for processes started by hand."""

import socket

import msgspec
import pytest

from worldsim.fleet.fork import ProcessExit
from worldsim.fleet.ipc import (
    ActionDone,
    ActionRequest,
    AgentExited,
    AgentProcess,
    MessageSocket,
    ProcessesMissing,
    Progress,
    RunFailed,
    RunOver,
    Stalled,
    ToWorld,
    world_sockets,
)
from worldsim.fleet.launcher_link import AgentExit, LaunchedLink, LauncherLink, ManualLink

KILLED = AgentExited(AgentProcess(3, 1), 4711, ProcessExit(9, None))
PROGRESS = Progress(1.5, 20.0, 9, 4, 0.5, None)


def test_a_launched_link_receives_exits_and_acknowledgements() -> None:
    launcher, world = world_sockets()
    link = LaunchedLink(world)
    launcher.send(ActionDone("kill", (AgentProcess(3, 1),)))
    launcher.send(KILLED)
    link.wait(5.0)
    assert link.agent_exits() == [AgentExit(3, 1, ProcessExit(9, None))]
    assert link.agent_exits() == []
    assert not link.has_done("kill", [AgentProcess(3, 0)])
    assert not link.has_done("pause", [AgentProcess(3, 1)])
    assert link.has_done("kill", [AgentProcess(3, 1)])
    assert not link.has_done("kill", [AgentProcess(3, 1)])
    launcher.close()
    world.close()


def test_a_launched_link_sends_requests_and_reports() -> None:
    launcher, world = world_sockets()
    link = LaunchedLink(world)
    link.request("start", [AgentProcess(2, 1)], after_s=1.5)
    link.request("resume", [])
    link.report_missing(["agent-1"])
    link.report_progress(PROGRESS)
    link.report_stall("netem's answer of slot 3")
    link.report_run_over()
    assert launcher.receive() == [
        ActionRequest("start", (AgentProcess(2, 1),), after_s=1.5),
        ProcessesMissing(("agent-1",)),
        PROGRESS,
        Stalled("netem's answer of slot 3"),
        RunOver(),
    ]
    launcher.close()
    world.close()


def test_a_run_stops_when_its_launcher_is_gone() -> None:
    launcher, world = world_sockets()
    link = LaunchedLink(world)
    assert link.stop_reason is None
    launcher.close()
    link.wait(5.0)
    assert link.agent_exits() == []
    assert (link.stop_reason, link.failure) == ("the launcher is gone", None)
    world.close()


def test_a_run_stops_with_the_failure_that_the_launcher_reports() -> None:
    launcher, world = world_sockets()
    link = LaunchedLink(world)
    launcher.send(RunFailed("netem was killed by signal 9"))
    link.wait(5.0)
    assert link.stop_reason == link.failure == "netem was killed by signal 9"
    launcher.close()
    world.close()


def test_a_run_stops_when_the_launcher_sends_garbage() -> None:
    far, near = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    link = LaunchedLink(MessageSocket(near, "launcher", msgspec.msgpack.Decoder(ToWorld)))
    far.send(b"landing")
    link.wait(5.0)
    assert link.failure is not None
    assert link.failure.startswith("launcher sent a message that cannot be decoded")
    assert link.stop_reason == link.failure
    far.close()
    near.close()


def test_an_exit_is_described_as_far_as_it_is_known() -> None:
    assert str(AgentExit(2, 0, ProcessExit(9, None))) == "agent-2 was killed by signal 9"
    assert str(AgentExit(2, 0, ProcessExit(None, 1))) == "agent-2 ended with status 1"
    assert str(AgentExit(2)) == "agent-2 ended"


def test_without_netem_no_agent_counts_as_vanished() -> None:
    vanished = [["agent-2"], ["agent-0", "netem", "agent-1"]]
    link = ManualLink(lambda: vanished.pop(0))
    assert link.agent_exits() == [AgentExit(2)]
    assert link.stop_reason is None
    assert link.agent_exits() == []
    assert link.stop_reason == "netem is gone"


def test_processes_started_by_hand_are_not_operated_on() -> None:
    link: LauncherLink = ManualLink(list)
    assert not link.controls_processes
    with pytest.raises(
        LookupError, match=r"^cannot kill agent-2, agent-3: these processes were started by hand"
    ):
        link.request("kill", [AgentProcess(2, 0), AgentProcess(3, 1)])
    with pytest.raises(LookupError, match="no request to kill agent-2 was accepted"):
        link.has_done("kill", [AgentProcess(2, 0)])


def test_a_manual_link_prints_what_a_launcher_would_show(
    capsys: pytest.CaptureFixture[str],
) -> None:
    link = ManualLink(lambda: ["agent-2"])
    link.report_missing(["netem", "agent-1"])
    link.report_missing(["agent-1"])  # within two seconds: not printed
    link.report_missing([])
    link.agent_exits()
    link.report_stall("agent-1's command of slot 3")
    link.report_run_over()
    assert capsys.readouterr().out.splitlines() == [
        "waiting for netem, agent-1",
        "all processes are present",
        "agent-2 is gone",
        "stalled: waiting for agent-1's command of slot 3",
        "world: the run is over",
    ]
