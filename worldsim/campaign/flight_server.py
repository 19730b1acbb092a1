"""A process that flies orders, one after another, for a worker of a cluster.

A worker has threads and starts many flights, while a flight is forked and ends what its controller
started: it needs a process of its own, without threads. Orders come by stdin and what they showed
leaves by stdout, each pickled with its length. The process ends with its worker, also in a flight.
"""

import os
import pickle
import select
import struct
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any, NoReturn

from netem.wire.shutdown import StopRequest
from worldsim.campaign.flight_site import Flown, LocalSite, Order

_LENGTH = struct.Struct("<Q")
_PROGRAM = "from worldsim.campaign.flight_server import main; main()"


class ServerEndedError(OSError):
    """The process that flies has ended, or its worker has."""


class FlightServer:
    """The process as the worker sees it. folder: where a user's controllers are imported from."""

    def __init__(self, folder: str) -> None:
        path = os.pathsep.join(each for each in (*sys.path, folder) if each)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", _PROGRAM],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": path},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._to, self._from = self._process.stdin, self._process.stdout

    def fly(self, order: Order) -> Flown:
        """Return what an order showed. Raises ServerEndedError; then the server is of no use."""
        try:
            _send(self._to, order)
            flown: Flown = _received(self._from)
        except OSError as error:
            status = self.close()
            raise ServerEndedError(f"the process that flies ended ({status})") from error
        return flown

    def close(self) -> int:
        """End the process, whatever it does, and return its exit status."""
        self._process.kill()
        for stream in (self._to, self._from):
            with suppress(OSError):  # what was not sent is lost
                stream.close()
        return self._process.wait()


def main() -> NoReturn:
    """Fly the orders of stdin until it ends."""
    orders, out = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)  # a controller reads no order
    os.dup2(2, 1)  # what it prints is no answer
    with TemporaryDirectory(prefix="qswarm-flights-") as scratch:
        site = LocalSite(1, Path(scratch) / "flights", lambda: _check_worker(orders))
        while (order := _next(orders)) is not None:
            (flown,) = site.fly([order], StopRequest())
            _send(out, flown)
    sys.exit(0)


def _check_worker(orders: IO[bytes]) -> None:
    """Raise ServerEndedError once nobody can send orders any more."""
    poll = select.poll()
    poll.register(orders, select.POLLHUP)
    if any(event & select.POLLHUP for _, event in poll.poll(0)):
        raise ServerEndedError("its worker has ended")


def _next(orders: IO[bytes]) -> Order | None:
    try:
        order: Order = _received(orders)
    except ServerEndedError:
        return None
    return order


def _send(stream: IO[bytes], message: Order | Flown) -> None:
    data = pickle.dumps(message)
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def _received(stream: IO[bytes]) -> Any:
    """Return the next message. Raises ServerEndedError at the end of the stream."""
    head = stream.read(_LENGTH.size)
    data = stream.read(_LENGTH.unpack(head)[0]) if len(head) == _LENGTH.size else b""
    if not data:
        raise ServerEndedError("the stream has ended")
    return pickle.loads(data)  # from this package's other end
