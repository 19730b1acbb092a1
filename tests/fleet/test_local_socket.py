"""The local socket to a running world: requests, refusals, and peers that do not behave."""

import os
import socket
from collections.abc import Iterator
from threading import Thread

import pytest

from worldsim.fleet import local_socket
from worldsim.fleet.local_socket import (
    MAX_WAITING,
    LocalRefusalError,
    LocalServer,
    _name,
    ask_locally,
)


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[LocalServer]:
    monkeypatch.setattr(local_socket, "_name", lambda pid: f"{_name(pid)}-tested")
    server = LocalServer(100)
    yield server
    server.close()


def answer(data: bytes) -> bytes:
    if data == b"no":
        raise ValueError("not now")
    return b"a" * 3_000_000 if data == b"long" else data.upper()


class Asking(Thread):
    def __init__(self, request: bytes) -> None:
        super().__init__()
        self._request = request
        self.found: bytes | Exception | None = None
        self.start()

    def run(self) -> None:
        try:
            self.found = ask_locally(os.getpid(), self._request, 5.0)
        except LocalRefusalError as refusal:
            self.found = refusal


def asked(server: LocalServer, request: bytes) -> bytes | Exception | None:
    asking = Asking(request)
    while asking.is_alive():
        server.answer_waiting(answer, 4)
        asking.join(0.001)
    return asking.found


def test_a_request_is_answered_or_refused(server: LocalServer) -> None:
    assert asked(server, b"yes") == b"YES"
    assert str(asked(server, b"no")) == "not now"
    assert str(asked(server, b"long")) == "it is carried out, but the answer is too long"


def test_peers_that_say_nothing_or_leave_are_dropped_and_hold_nobody_up(
    server: LocalServer,
) -> None:
    silent = []
    for _ in range(3 * MAX_WAITING):
        silent.append(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
        silent[-1].connect(local_socket._name(os.getpid()))
        server.answer_waiting(answer, 4)
    assert asked(server, b"yes") == b"YES"
    gone = silent.pop()
    gone.send(b"yes")
    gone.close()
    server.answer_waiting(answer, MAX_WAITING)
    for each in silent:
        each.close()
    assert asked(server, b"yes") == b"YES"


def test_nobody_of_another_user_is_answered(
    server: LocalServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(local_socket, "_is_own", lambda _: False)
    with pytest.raises(ConnectionRefusedError):
        ask_locally(os.getpid(), b"yes", 1.0)


def test_no_world_and_one_that_hangs_do_not_answer(server: LocalServer) -> None:
    with pytest.raises(ConnectionRefusedError):
        ask_locally(2**22 + 1, b"yes", 1.0)
    assert ask_locally(os.getpid(), b"yes", 0.01) is None
