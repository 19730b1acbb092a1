"""The way to a running world that needs no router: a local socket, for while netem is down.

The socket has a name in the kernel's abstract namespace, from the world's pid, and no file. Each
end checks that the other belongs to the same user. One message asks and one answers.
"""

import os
import socket
import struct
from collections.abc import Callable
from contextlib import suppress

MAX_WAITING = 8
"""Connections that may wait with no request yet; of more, the oldest is closed."""
MAX_ANSWER_B = 4 * 1024 * 1024
_ACCEPTED, _REFUSED = b"+", b"-"
_CREDENTIALS = struct.Struct("3i")


class LocalRefusalError(Exception):
    """The world refuses the request; the text is its reason."""


class LocalServer:
    """The world's end. max_request_b: longest request [B].

    Where the name is taken already, nobody is answered: the router is left.
    """

    def __init__(self, max_request_b: int) -> None:
        self._max_request_b = max_request_b
        self._waiting: list[socket.socket] = []
        self._listener = _socket()
        self._listener.setblocking(False)
        with suppress(OSError):
            self._listener.bind(_name(os.getpid()))
            self._listener.listen(MAX_WAITING)

    def answer_waiting(self, answer: Callable[[bytes], bytes], most: int) -> None:
        """Answer up to ``most`` requests that have arrived; wait for nobody.

        answer: raises ValueError, with the reason, where it refuses a request.
        """
        self._accept(most)
        answered = 0
        for peer in tuple(self._waiting):
            if answered == most:
                return
            try:
                data = peer.recv(self._max_request_b + 1)
            except BlockingIOError:
                continue
            except OSError:
                data = b""
            self._waiting.remove(peer)
            with peer:
                if data:
                    answered += 1
                    _reply(peer, _answered(answer, data))

    def close(self) -> None:
        """Answer nobody from now on."""
        for each in (self._listener, *self._waiting):
            each.close()

    def _accept(self, most: int) -> None:
        for _ in range(most):
            try:
                peer, _ = self._listener.accept()
            except OSError:
                return
            if not _is_own(peer):
                peer.close()
                continue
            peer.setblocking(False)
            self._waiting.append(peer)
        while len(self._waiting) > MAX_WAITING:
            self._waiting.pop(0).close()


def ask_locally(pid: int, request: bytes, within_s: float) -> bytes | None:
    """Return the answer of the world with this pid, or None where it does not answer in time.

    Raises ConnectionRefusedError where no world listens, LocalRefusalError where it refuses.
    """
    with _socket() as world:
        world.settimeout(within_s)
        try:
            world.connect(_name(pid))
            if not _is_own(world):
                raise ConnectionRefusedError
            world.send(request)
            answer = world.recv(MAX_ANSWER_B)
        except (BlockingIOError, TimeoutError, BrokenPipeError, ConnectionResetError):
            return None
    if answer[:1] == _REFUSED:
        raise LocalRefusalError(answer[1:].decode("utf-8", "replace"))
    return answer[1:] if answer else None


def _answered(answer: Callable[[bytes], bytes], data: bytes) -> bytes:
    try:
        return _ACCEPTED + answer(data)
    except ValueError as refusal:
        return _REFUSED + str(refusal).encode()


def _reply(peer: socket.socket, answer: bytes) -> None:
    """Send an answer, or that it is too long; whoever is gone gets none."""
    try:
        peer.send(answer)
    except ConnectionError:
        pass
    except OSError:
        peer.send(_REFUSED + b"it is carried out, but the answer is too long")


def _socket() -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, MAX_ANSWER_B)
    return made


def _name(pid: int) -> str:
    return f"\0qswarm-world-{pid}"


def _is_own(peer: socket.socket) -> bool:
    """Return whether the other end belongs to a process of this user."""
    size = _CREDENTIALS.size
    credentials = peer.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size)
    return bool(_CREDENTIALS.unpack(credentials)[1] == os.getuid())
