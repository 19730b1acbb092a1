"""Fleets of real processes, killed at the end of each test."""

import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import count
from pathlib import Path

import pytest

from tests.processes.harness import SCENARIO, Started


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Started]]:
    with ExitStack() as stack:
        outputs = count()

        def begin(*arguments: str) -> Started:
            output = tmp_path / f"output-{next(outputs)}.txt"
            return stack.enter_context(Started(list(arguments), output, tmp_path))

        yield begin


@pytest.fixture
def scenario(tmp_path: Path) -> Callable[[float], str]:
    def write(duration_s: float) -> str:
        path = tmp_path / "four.toml"
        path.write_text(SCENARIO.format(duration_s=duration_s))
        return str(path)

    return write


@pytest.fixture
def port_by_hand(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A free port for deploy/by-hand.sh, of which another test may use the default one."""
    monkeypatch.setenv("QSWARM_PORT", endpoint.rpartition(":")[2])


@pytest.fixture
def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"
