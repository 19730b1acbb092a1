"""JSON messages over a socket pair: how the launcher, the zygote and the world talk."""

import json
import socket
from typing import Any

Line = dict[str, Any]

MAX_LINE_B = 64 * 1024


class MessageSocket:
    """One end of a socket pair; ``closed`` once the other end is gone.

    Reading never waits: wait for ``fileno`` to become readable.
    """

    def __init__(self, end: socket.socket) -> None:
        self.closed = False
        self._end = end

    @staticmethod
    def pair() -> tuple["MessageSocket", "MessageSocket"]:
        """Return two connected ends."""
        near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        return MessageSocket(near), MessageSocket(far)

    def fileno(self) -> int:
        """Return the descriptor to wait for."""
        return self._end.fileno()

    def send(self, **line: Any) -> None:
        """Send one message; to an end that is gone it is lost, and ``closed`` says so."""
        self._send(line, 0)

    def offer(self, **line: Any) -> None:
        """Send one message unless the other end has fallen far behind in reading."""
        self._send(line, socket.MSG_DONTWAIT)

    def receive(self) -> list[Line]:
        """Return the messages that have come."""
        lines: list[Line] = []
        while not self.closed:
            try:
                data = self._end.recv(MAX_LINE_B, socket.MSG_DONTWAIT)
            except BlockingIOError:
                break
            except ConnectionResetError:
                data = b""
            if data:
                lines.append(json.loads(data))
            else:
                self.closed = True
        return lines

    def close(self) -> None:
        """Close this end."""
        self.closed = True
        self._end.close()

    def _send(self, line: Line, flags: int) -> None:
        if self.closed:
            return
        try:
            self._end.send(json.dumps(line).encode(), flags)
        except BlockingIOError:
            return
        except (BrokenPipeError, ConnectionResetError):
            self.closed = True
