"""The processes started by hand: a start that fails is one line and status 2."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from netem.link_parameters import Conditions
from netem.messages import MediumSetup
from netem.wire.bus import Bus, RefusedError
from netem.wire.keys import Keys
from netem.wire.session import SessionError, open_client, open_router
from netem.wire.shutdown import RUN_OVER
from tests.processes.harness import Started

pytestmark = pytest.mark.processes

Start = Callable[..., Started]
PYTHON = [sys.executable, "-m"]
REPOSITORY = Path(__file__).parents[2]


def test_without_a_router_agent_and_world_fail_within_ten_seconds(
    start: Start, scenario: Callable[[float], str], endpoint: str, tmp_path: Path
) -> None:
    agent = start(*PYTHON, "agent", "--id", "0", "--run", "lonely", "--connect", endpoint)
    out = tmp_path / "run"
    world = start(*PYTHON, "worldsim", scenario(6.0), "--connect", endpoint, "--out", str(out))
    error = f"no router answers at {endpoint} within 8 s"
    assert (agent.status(10.0), agent.text) == (2, f"agent-0: {error}\n")
    assert (world.status(10.0), world.text) == (2, f"world: {error}\n")
    assert not out.exists()


def test_a_port_in_use_is_one_line(start: Start, endpoint: str) -> None:
    with open_router(endpoint):
        netem = start(*PYTHON, "netem", "--listen", endpoint)
        assert netem.status(10.0) == 2
    assert netem.text == f"netem: {endpoint}: the port is in use\n"


def test_netem_serves_the_first_run_that_asks_and_refuses_a_second(
    start: Start, endpoint: str
) -> None:
    netem = start(*PYTHON, "netem", "--listen", endpoint)
    netem.wait_for_output("netem listens at")
    question = msgspec.json.encode(MediumSetup(1, 2, 4, 80.0, Conditions()))
    with open_client(endpoint) as session:
        first, second = Bus(session, Keys("first")), Bus(session, Keys("second"))
        assert first.query("medium", None, question, timeout_s=5.0) == b""
        with pytest.raises(RefusedError, match="serves run 'first' already"):
            second.query("medium", None, question, timeout_s=5.0)
        assert first.query("medium", None, question, timeout_s=5.0) == b""
        first.publisher("over")(RUN_OVER)
        assert netem.status(5.0) == 0, netem.text


def test_netem_refuses_invalid_conditions(start: Start, endpoint: str) -> None:
    netem = start(*PYTHON, "netem", "--listen", endpoint)
    netem.wait_for_output("netem listens at")
    with open_client(endpoint) as session, pytest.raises(RefusedError, match="conditions: "):
        Bus(session, Keys("odd")).query("medium", None, b'{"seed": -1}', timeout_s=5.0)


@pytest.mark.real_time
def test_a_fleet_started_by_a_shell_loop_passes(
    start: Start, scenario: Callable[[float], str], tmp_path: Path
) -> None:
    fleet = start("bash", str(REPOSITORY / "deploy/by-hand.sh"), scenario(5.0), f"{tmp_path}/run")
    assert fleet.status(30.0) == 0, fleet.text
    assert json.loads((tmp_path / "run/summary.json").read_text())["outcome"] == "pass"
    assert "outcome: pass" in fleet.text


@pytest.mark.usefixtures("port_by_hand")
def test_a_shell_loop_refuses_bad_input_and_reports_no_earlier_run(
    start: Start, scenario: Callable[[float], str], tmp_path: Path
) -> None:
    by_hand = ("bash", str(REPOSITORY / "deploy/by-hand.sh"))
    missing = start(*by_hand, "none.toml")
    assert (missing.status(15.0), missing.text) == (2, "none.toml: no such file\n")
    (tmp_path / "older").mkdir()
    (tmp_path / "older/summary.json").write_text('{"outcome": "pass"}')
    late = start(*by_hand, scenario(6.0), f"{tmp_path}/older")
    assert late.status(15.0) == 2
    assert "older: exists; a run is never overwritten" in late.text
    assert "outcome" not in late.text


@pytest.mark.usefixtures("port_by_hand")
def test_a_shell_loop_does_not_use_the_netem_of_another_fleet(
    start: Start, scenario: Callable[[float], str], endpoint: str, tmp_path: Path
) -> None:
    other = start(*PYTHON, "netem", "--listen", endpoint)
    other.wait_for_output("netem listens at")
    out = tmp_path / "run"
    fleet = start("bash", str(REPOSITORY / "deploy/by-hand.sh"), scenario(8.0), str(out))
    assert fleet.status(30.0) == 2, fleet.text
    assert fleet.text == f"netem: {endpoint}: the port is in use\n"
    assert not out.exists()
    assert other.process.poll() is None
    assert "serves" not in other.text


def test_netem_without_a_run_ends_on_sigterm(start: Start, endpoint: str) -> None:
    netem = start(*PYTHON, "netem", "--listen", endpoint)
    netem.wait_for_output("netem listens at")
    netem.process.terminate()
    assert netem.status(5.0) == 0


@pytest.mark.parametrize(
    ("listen", "reason"),
    [
        ("tcp/0.0.0.0:7447", "not a loopback address"),
        ("tcp/192.168.1.2:7447", "not a loopback address"),
        ("tcp/[::]:7447", "not a loopback address"),
        ("tcp/example.org:7447", "not a loopback address"),
        ("tcp/127.0.0.1", "the port is missing or wrong"),
        ("tcp/127.0.0.1:99999", "the port is missing or wrong"),
        ("127.0.0.1:7447", "not an endpoint"),
        ("", "not an endpoint"),
    ],
)
def test_a_router_listens_on_loopback_only(listen: str, reason: str) -> None:
    with pytest.raises(SessionError, match=reason) as refusal:
        open_router(listen)
    assert "\n" not in str(refusal.value)


def test_a_client_needs_an_endpoint() -> None:
    with pytest.raises(SessionError, match="not an endpoint"):
        open_client("localhost:7447")


def test_an_unknown_protocol_is_one_line() -> None:
    with pytest.raises(SessionError, match="not supported") as refusal:
        open_router("pigeon/127.0.0.1:7447")
    assert "\n" not in str(refusal.value)
    assert ".rs" not in str(refusal.value)
