"""A router's connections: each process has its share, and keeps it."""

import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from netem.wire.connections import MAX_PER_PROCESS, ConnectionLimiter

CLIENT = """
import socket, sys
family, address, count = sys.argv[1:]
address = address if family == "AF_UNIX" else ("127.0.0.1", int(address))
held = []
for _ in range(int(count)):
    held.append(socket.socket(getattr(socket, family)))
    held[-1].connect(address)
print("held", flush=True)
sys.stdin.read()
"""
Hold = Callable[[int], list[socket.socket]]


@pytest.fixture(params=["AF_INET", "AF_UNIX"])
def hold(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Hold]:
    """Let a new process hold some connections; return this process's ends."""
    processes, ends = [], []
    with socket.socket(getattr(socket, request.param)) as listener:
        listener.bind(str(tmp_path / "s") if request.param == "AF_UNIX" else ("127.0.0.1", 0))
        listener.listen(64)
        name = listener.getsockname()
        address = name if isinstance(name, str) else str(name[1])

        def begin(count: int) -> list[socket.socket]:
            arguments = [sys.executable, "-c", CLIENT, request.param, address, str(count)]
            pipe = subprocess.PIPE
            processes.append(subprocess.Popen(arguments, stdin=pipe, stdout=pipe))
            accepted = [listener.accept()[0] for _ in range(count)]
            ends.extend(accepted)
            return accepted

        yield begin
    for end in ends:
        end.close()
    for process in processes:
        process.communicate()


def open_ones(ends: list[socket.socket]) -> int:
    """Count the connections that were not shut down: reading would block."""
    for end in ends:
        end.setblocking(False)
    return sum(not ended(end) for end in ends)


def ended(end: socket.socket) -> bool:
    try:
        return end.recv(1) == b""
    except BlockingIOError:
        return False


def test_a_process_with_too_many_loses_the_rest_and_others_lose_none(hold: Hold) -> None:
    greedy, modest = hold(40), hold(2)
    limiter = ConnectionLimiter(usual=10)
    limiter.enforce()
    assert (open_ones(greedy), open_ones(modest)) == (MAX_PER_PROCESS, 2)
    assert limiter.closed == 40 - MAX_PER_PROCESS


def test_few_connections_are_left_alone(hold: Hold) -> None:
    own = hold(12)
    limiter = ConnectionLimiter(usual=10_000)
    limiter.enforce()
    assert (open_ones(own), limiter.closed) == (12, 0)


def test_own_sockets_are_no_connections_of_others() -> None:
    pairs = [socket.socketpair() for _ in range(20)]
    limiter = ConnectionLimiter(usual=0)
    limiter.enforce()
    assert open_ones([end for pair in pairs for end in pair]) == 40
    for pair in pairs:
        for end in pair:
            end.close()
