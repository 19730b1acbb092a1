"""The zygote, with sleeping children as agents: acknowledgements, exits, and how it ends."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

DEADLINE_S = 30.0
PRELUDE = """
import os, select, signal, sys, time
from pathlib import Path
from agent import process as agent_process
from worldsim.fleet.fork import ProcessExit, fork
from worldsim.fleet.ipc import (
    AgentExited, AgentProcess, AgentStarted, EndRequest, Message, ActionDone, ActionRequest,
    IntruderEndRequest, IntruderExited, IntruderRequest, IntruderStarted, zygote_sockets,
)
from worldsim.fleet import intruder
from worldsim.fleet.zygote import AgentProcessConfig, Zygote

FIRST, SECOND = AgentProcess(0, 0), AgentProcess(1, 0)
ready, is_ready = os.pipe()

def sleep(*_):
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    os.write(is_ready, b".")
    time.sleep(60.0)
    return 7

def serve():
    launcher.close()
    return Zygote(zygote_end, AgentProcessConfig("mine", "tcp/x", Path("."))).serve()

agent_process.run = sleep
intruder.run = lambda attack, row: 1 if attack.per_s == 1.0 else sleep()
launcher, zygote_end = zygote_sockets()
zygote = fork(Path("zygote.log"), signal.SIGKILL, serve)
zygote_end.close()
messages = []

def receive(kind):
    while True:
        for message in messages:
            if isinstance(message, kind):
                messages.remove(message)
                return message
        assert not launcher.closed, messages
        select.select([launcher], [], [], 10.0)
        messages.extend(launcher.receive())

def request(action, *processes):
    launcher.send(ActionRequest(action, processes))
    assert receive(ActionDone) == ActionDone(action, processes)

def state(pid):
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]

request("start", FIRST, SECOND)
pids = {each.process: each.pid for each in (receive(AgentStarted), receive(AgentStarted))}
assert [os.read(ready, 1) for _ in pids] == [b".", b"."]
"""
ACTIONS = """
request("pause", FIRST)
assert state(pids[FIRST]) == "T" != state(pids[SECOND])
request("resume", FIRST)
assert state(pids[FIRST]) != "T"
request("kill", AgentProcess(0, 1))  # no such incarnation
request("kill", FIRST)
assert receive(AgentExited) == AgentExited(FIRST, pids[FIRST], ProcessExit(9, None))
request("kill", FIRST)  # it has ended already
request("pause", FIRST)
request("start", AgentProcess(0, 1))
assert receive(AgentStarted).process == AgentProcess(0, 1)
assert messages == []
assert state(pids[SECOND]) not in "TZ"
print("done")
"""
END = """
request("pause", SECOND)
launcher.send(MESSAGE())
exits = [receive(AgentExited) for _ in pids]
print(sorted((each.process.agent, *each.exit) for each in exits))
print(os.waitstatus_to_exitcode(os.waitpid(zygote, 0)[1]))
print(Path("zygote.log").read_text(), end="")
"""
INTRUDERS = """
for number in (5, 6):
    launcher.send(IntruderRequest(number, (1,), 9.0))
fifth, sixth = receive(IntruderStarted), receive(IntruderStarted)
assert (fifth.number, sixth.number) == (5, 6)
assert [os.read(ready, 1) for _ in (fifth, sixth)] == [b".", b"."]
launcher.send(IntruderEndRequest(5))
launcher.send(IntruderEndRequest(7))  # there is none
request("resume")
assert not Path(f"/proc/{fifth.pid}").exists() or state(fifth.pid) == "Z"
assert state(sixth.pid) not in "TZ"
launcher.send(IntruderRequest(8, (), 1.0))
assert receive(IntruderExited) == IntruderExited(8, ProcessExit(None, 1))
launcher.close()
os.waitpid(zygote, 0)
print(Path(f"/proc/{sixth.pid}").exists())
"""
LAUNCHER_GONE = """
request("pause", SECOND)
launcher.close()
print(os.waitstatus_to_exitcode(os.waitpid(zygote, 0)[1]))
print([Path(f"/proc/{pid}").exists() for pid in pids.values()])
"""


def ran(program: str, folder: Path) -> list[str]:
    """Run a program after the prelude; return the lines that it prints."""
    path = os.pathsep.join(sys.path)
    done = subprocess.run(
        [sys.executable, "-c", PRELUDE + program],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": f"{Path(__file__).parents[2]}{os.pathsep}{path}"},
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.splitlines()


def test_actions_are_acknowledged_when_they_have_taken_effect(tmp_path: Path) -> None:
    assert ran(ACTIONS, tmp_path) == ["done"]


def test_an_intruder_ends_with_its_fault_and_with_the_fleet(tmp_path: Path) -> None:
    assert ran(INTRUDERS, tmp_path) == ["False"]


def test_it_ends_all_agents_on_request_also_a_paused_one(tmp_path: Path) -> None:
    lines = ran(END.replace("MESSAGE", "EndRequest"), tmp_path)
    assert lines == ["[(0, None, 0), (1, None, 0)]", "0"]


def test_it_ends_all_agents_after_a_message_that_does_not_decode(tmp_path: Path) -> None:
    agents, status, *log = ran(END.replace("MESSAGE", "Message"), tmp_path)
    assert agents == "[(0, None, 0), (1, None, 0)]"
    assert (status, len(log)) == ("1", 1)
    assert log[0].startswith("zygote: launcher sent a message that cannot be decoded: ")


def test_it_ends_all_agents_when_the_launcher_is_gone(tmp_path: Path) -> None:
    assert ran(LAUNCHER_GONE, tmp_path) == ["0", "[False, False]"]


@pytest.mark.parametrize("number", [9, 15])
def test_no_agent_outlives_it(tmp_path: Path, number: int) -> None:
    killed = f"os.kill(zygote, {number})"
    gone = "[os.read(ready, 1), print('all ended')]"
    program = f"os.close(is_ready)\n{killed}\nos.waitpid(zygote, 0)\n{gone}\n"
    assert ran(program, tmp_path) == ["all ended"]


FOREIGN = """
launcher.close()
os.waitpid(zygote, 0)
CHILD = "echo $$ \\"$@\\"; (trap '' TERM; echo child; exec sleep 61) & echo $!; wait"

def serve_foreign():
    launcher.close()
    commands = {0: ("/bin/sh", "-c", CHILD, "sh"), 1: ("/no/such/program",)}
    config = AgentProcessConfig(
        "mine", "tcp/x", Path("."), users=Path("users.txt"), commands=commands
    )
    return Zygote(zygote_end, config).serve()

launcher, zygote_end = zygote_sockets()
zygote = fork(Path("zygote.log"), signal.SIGKILL, serve_foreign)
zygote_end.close()

def until(there):
    deadline = time.monotonic() + 20.0
    while not there():
        assert time.monotonic() < deadline, lines()
        time.sleep(0.01)

def is_gone(pid):
    try:
        return state(pid) == "Z"
    except OSError:
        return True

def lines():
    log = Path("agent-0.log")
    return log.read_text().splitlines() if log.exists() else []

def child_of(times):
    until(lambda: lines().count("child") == times and len(lines()) == 3 * times)
    return int([line for line in lines() if line.isdecimal()][-1])

Path("agent-0.log").unlink()
Path("agent-1.log").unlink()
request("start", FIRST)
pid = receive(AgentStarted).pid
child = child_of(1)
print(lines()[0].replace(str(pid), "PID"))
assert os.getpgid(child) == os.getpgid(pid) == pid != os.getpgid(zygote)
request("pause", FIRST)
assert state(pid) == "T"
until(lambda: state(child) == "T")
request("resume", FIRST)
assert state(pid) != "T"
until(lambda: state(child) != "T")
request("kill", FIRST)
print(tuple(receive(AgentExited).exit))
until(lambda: is_gone(child))
request("start", AgentProcess(0, 1))
receive(AgentStarted)
child = child_of(2)
request("start", SECOND)
print(tuple(receive(AgentExited).exit), Path("agent-1.log").read_text().strip())
END
os.waitpid(zygote, 0)
until(lambda: is_gone(child))
print("done")
"""


@pytest.mark.parametrize("end", ["launcher.send(EndRequest())", "os.kill(zygote, signal.SIGKILL)"])
def test_a_foreign_agent_is_struck_and_ends_with_all_that_it_started(
    tmp_path: Path, end: str
) -> None:
    told, killed, not_started, done = ran(FOREIGN.replace("END\n", f"{end}\n"), tmp_path)
    users = tmp_path / "users.txt"
    assert told == f"PID --id 0 --run mine --connect tcp/x --credentials {users}"
    assert killed == "(9, None)"
    said = "agent-1: '/no/such/program' cannot be started: No such file or directory"
    assert not_started == f"(None, 127) {said}"
    assert done == "done"
