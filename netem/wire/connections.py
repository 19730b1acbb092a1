"""A router's connections: how many each process on this host may hold.

Zenoh bounds only the sum: one process with many connections would lock all others out. The router
finds the process at the other end of each connection, and closes what is above its share.
"""

import os
import socket
import struct
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import NamedTuple

MAX_PENDING = 1024
"""Connections that may be in their handshake at once."""
HANDSHAKE_WITHIN_S = 2.0
MAX_SESSIONS = 60_000
MAX_PER_PROCESS = 8
"""Connections that a process may hold; one of the fleet holds one."""
CHECK_EVERY_S = 0.5

_PEER_CREDENTIALS = struct.Struct("3i")
_Owner = tuple[str, int]
"""A process, or a user whose processes cannot be seen."""


class _Connection(NamedTuple):
    descriptor: int
    owner: _Owner


class ConnectionLimiter:
    """Closes connections of processes that hold too many. Call ``enforce`` again and again.

    usual: number of connections below which nothing is looked up.
    """

    def __init__(self, usual: int) -> None:
        self.closed = 0
        """Number of connections that were closed."""
        self._usual = usual
        self._next_s = time.monotonic()

    def enforce(self) -> None:
        """Close what is above a process's share, at most every CHECK_EVERY_S."""
        if time.monotonic() < self._next_s:
            return
        self._next_s = time.monotonic() + CHECK_EVERY_S
        descriptors = _sockets()
        if len(descriptors) <= self._usual:
            return
        held: dict[_Owner, list[int]] = defaultdict(list)
        for connection in _connections(descriptors):
            held[connection.owner].append(connection.descriptor)
        for mine in held.values():
            for descriptor in sorted(mine)[MAX_PER_PROCESS:]:
                _shut_down(descriptor)
                self.closed += 1


def _sockets() -> list[int]:
    """Return the descriptors of this process that are sockets."""
    found = []
    for name in os.listdir("/proc/self/fd"):  # noqa: PTH208 - names only, at 2 Hz
        with suppress(OSError):
            if os.readlink(f"/proc/self/fd/{name}").startswith("socket:"):  # noqa: PTH115
                found.append(int(name))
    return found


def _connections(descriptors: list[int]) -> Iterator[_Connection]:
    """Yield the connections that other processes have opened to this one."""
    inodes = _inodes_by_port()
    pids: dict[int, int] | None = None
    for descriptor in descriptors:
        with suppress(OSError), closing(socket.socket(fileno=os.dup(descriptor))) as one:
            if one.family == socket.AF_UNIX:
                size = _PEER_CREDENTIALS.size
                credentials = one.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size)
                pid, _, _ = _PEER_CREDENTIALS.unpack(credentials)
                if pid not in (0, os.getpid()):
                    yield _Connection(descriptor, ("pid", pid))
                continue
            here, there = one.getsockname()[1], one.getpeername()[1]
            inode, user = inodes.get((there, here), (0, -1))
            pids = pids if pids is not None else _pids_by_inode()
            owner = ("pid", pids[inode]) if inode in pids else ("user", user)
            if owner != ("pid", os.getpid()):
                yield _Connection(descriptor, owner)


def _inodes_by_port() -> dict[tuple[int, int], tuple[int, int]]:
    """Return inode and user of this host's TCP sockets, by their own port and the other's."""
    found = {}
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        with suppress(OSError):
            for line in Path(table).read_text(encoding="ascii").splitlines()[1:]:
                fields = line.split()
                here, there = (int(end.rpartition(":")[2], 16) for end in fields[1:3])
                found[here, there] = (int(fields[9]), int(fields[7]))
    return found


def _pids_by_inode() -> dict[int, int]:
    """Return the process of each socket, of the processes that this one may look into."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*/fd"):
        with suppress(OSError):
            for name in os.listdir(folder):  # noqa: PTH208 - names only
                target = os.readlink(folder / name)  # noqa: PTH115
                if target.startswith("socket:["):
                    found[int(target[8:-1])] = int(folder.parts[2])
    return found


def _shut_down(descriptor: int) -> None:
    """End a connection; Zenoh, which owns the descriptor, then closes it."""
    with suppress(OSError), closing(socket.socket(fileno=os.dup(descriptor))) as one:
        one.shutdown(socket.SHUT_RDWR)
