"""An operator's commands to a running fleet: missions, faults and changes of the radio."""

import json
import re
import signal
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from netem.wire.access import login_of
from netem.wire.session import open_client
from tests.processes.harness import QSWARM, Started, events_of, eventually, pids
from worldsim.fleet.process_table import read_fleet
from worldsim.results.run_folder import USERS

pytestmark = pytest.mark.processes

Start = Callable[..., Started]
REPOSITORY = Path(__file__).parents[2]
COLUMN = """
name = "column"
vertices = { V1 = [0, 0, 1] }
queue = [{ name = "Q1", vertices = ["V1"], shape = { kind = "ray", direction = [0, 0, 1] } }]
"""


def check_faults(command: Callable[..., tuple[int, str]]) -> None:
    """Check that faults are refused with the reason, or carried out."""
    assert command("netem", "set", "loss_percent=101")[0] == 2
    status, output = command("fault", "clock", "7", "offset_s=3")
    assert (status, "refused: clock.agents[0]: no agent 7; 0 to 3" in output) == (2, True)
    assert command("fault", "pose", "1")[0] == 2
    status, output = command("fault", "starve", "0", "cpu_percent=50", "--for", "1")
    assert (status, "a0 gets 50 % of the CPU in each 0.5 s" in output) == (0, True)


def test_a_running_fleet_carries_out_commands_and_refuses_impossible_ones(
    start: Start, scenario: Callable[[float], str], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    (tmp_path / "column.toml").write_text(COLUMN)
    options = ("--out", str(run), "--no-recording", "--speed", "2")
    fleet = start(*QSWARM, "run", scenario(90.0), *options)
    fleet.wait_for_output("in place 4/4")

    def command(*words: str) -> tuple[int, str]:
        verb, *rest = words
        operator = start(*QSWARM, verb, str(run), *rest)
        return operator.status(15.0), operator.text

    assert command("fault", "kill", "7") == (
        2,
        f"{run}: refused: kill[0]: no agent 7; 0 to 3 by then\n",
    )
    check_faults(command)
    assert command("netem", "set", "loss_percent=20", "--for", "2")[0] == 0
    status, output = command("mission", "column.toml", "--to", "2")
    assert (status, "new formation 'column', given to a2" in output) == (0, True)
    assert command("fault", "kill", "3", "--for", "1")[0] == 0
    assert command("netem", "jam", "centre_m=[9,9,9]", "radius_m=0.5", "--for", "8")[0] == 0
    shown = command("netem", "show")[1]
    words = ("range_m = 6", "not partitioned, ", "1 jam", 'kind = "jam"', "radius_m = 0.5")
    assert [each for each in words if each not in shown] == []
    paused = pids(run)["agent-1"]
    status, output = command("fault", "pause", "1")
    assert (status, "its name, to end it early: pause-" in output) == (0, True)
    eventually(lambda: state(paused) == "T", 5.0, lambda: state(paused))
    status, output = command("fault", "resume", "all")
    assert status == 0, output
    eventually(lambda: state(paused) in "RS", 5.0, lambda: state(paused))

    def converged() -> bool:
        restarted = any(event["kind"] == "restart" for event in events_of(run))
        return restarted and fleet.text.rstrip().splitlines()[-1].count("in place 4/4") == 1

    eventually(converged, 25.0, lambda: fleet.text)
    fleet.kill_group(signal.SIGINT)
    assert fleet.status(10.0) == 130, fleet.text
    phases = json.loads((run / "summary.json").read_text())["phases"]
    assert [phase["formation"] for phase in phases] == ["line", "column"]
    assert phases[1]["residual_m"] < 0.12
    check_askers([e["kind"] for e in events_of(run) if e.get("by") == "operator"])


def check_askers(by_operator: list[str]) -> None:
    """Check which events are the operator's: what is asked for, and what ends with it."""
    asked = [kind for kind in dict.fromkeys(by_operator) if kind != "restart"]
    assert asked == ["starve", "netem", "formation", "kill", "jam", "pause", "resume"]
    assert by_operator.count("restart") == 1
    assert by_operator.count("starve") == 2


@pytest.mark.usefixtures("port_by_hand")
def test_in_a_fleet_started_by_hand_only_the_radio_can_be_changed(
    start: Start, scenario: Callable[[float], str], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    fleet = start("bash", str(REPOSITORY / "deploy/by-hand.sh"), scenario(60.0), str(run))
    fleet.wait_for_output("in place 4/4")
    refused = start(*QSWARM, "fault", str(run), "kill", "2")
    assert refused.status(15.0) == 2
    assert refused.text == f"{run}: refused: kill: this fleet has no launcher; do it by hand\n"
    assert start(*QSWARM, "netem", str(run), "partition", "0,1", "--for", "1").status(15.0) == 0
    eventually(lambda: any(event["kind"] == "heal" for event in events_of(run)), 10.0)
    fleet.kill_group(signal.SIGINT)
    assert fleet.status(10.0) == -signal.SIGINT, fleet.text
    summary = json.loads((run / "summary.json").read_text())
    (fault,) = summary["faults"]
    assert (fault["kind"], fault["by"]) == ("partition", "operator")
    assert 0 < fault["frames"] == summary["packets"]["dropped_partition"]


def state(pid: int) -> str:
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]


def test_many_connections_and_sessions_do_not_lock_the_operator_out(
    start: Start, scenario: Callable[[float], str], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    fleet = start(*QSWARM, "run", scenario(20.0), "--no-recording", "--out", str(run))
    fleet.wait_for_output("minimum separation")
    host, _, port = read_fleet(run).endpoint.removeprefix("tcp/").rpartition(":")
    held = [socket.create_connection((host, int(port))) for _ in range(150)]
    login = login_of(run / USERS, "agent-1")
    sessions = [open_client(f"tcp/{host}:{port}", login=login) for _ in range(20)]
    asked = start(*QSWARM, "netem", str(run), "show")
    assert asked.status(10.0) == 0, asked.text
    for session in sessions:
        session.close()
    for each in held:
        each.settimeout(5.0)
    assert [each.recv(1) for each in held[20:]] == [b""] * 130  # the router has ended them
    for each in held:
        each.close()
    fleet.kill_group(signal.SIGINT)
    assert fleet.status(10.0) == 130, fleet.text
    log = (run / "logs/netem.log").read_text()
    closed = re.search(r"closed (\d+) connections of processes with too many", log)
    assert closed is not None
    assert int(closed[1]) >= 130 + 20
