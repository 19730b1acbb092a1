"""An intruder: a process outside the fleet that attacks its router, until it is killed.

With the passwords of agents it puts messages on every key that they may write to: noise, old
messages, and messages of other incarnations and of future slots. Without a password it opens
connections and sends noise.
"""

import mmap
import os
import socket
import struct
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from itertools import cycle
from pathlib import Path
from random import Random
from typing import Final, NamedTuple

from agent.codec import encode
from agent.messages import ZERO, Command, Telemetry
from netem.wire.access import AccessError, login_of
from netem.wire.bus import Bus
from netem.wire.connections import MAX_PER_PROCESS
from netem.wire.frame import Frame, Outgoing, Transmission, pack
from netem.wire.keys import Keys, agent_name
from netem.wire.latency import LatencyHistogram
from netem.wire.session import SessionError, open_client

BURST_S: Final = 0.005
MIXED: Final = 400
"""Different messages on each key."""
NICENESS: Final = 10
"""An attack comes from another host: here it takes no time that the fleet needs."""
CONNECT_WITHIN_S: Final = 0.5
COUNTED: Final = 4096
"""The messages of faults with higher numbers are not counted."""
_RESET: Final = struct.pack("ii", 1, 0)
"""Closes a connection at once; otherwise its port stays in use for a minute."""
_TELEMETRY: Final = Telemetry(ZERO, 0.0, None, None, (), (), 0, -1, -1, 0)

Put = Callable[[bytes], object]
Make = Callable[[int, int], bytes]


class IntruderCounts:
    """How many messages each intruder has put, in memory that all processes of a run share.

    Make it before any process is forked.
    """

    def __init__(self) -> None:
        self._numbers = memoryview(mmap.mmap(-1, 8 * COUNTED)).cast("q")

    def row(self, number: int) -> "memoryview[int]":
        """Return the row that the intruder of a fault writes; empty where it is not counted."""
        return self._numbers[number : number + 1]

    def read(self, number: int) -> int | None:
        """Return how many messages the intruder of a fault has put; None where not counted."""
        return self._numbers[number] if number < COUNTED else None


class Attack(NamedTuple):
    """What an intruder attacks."""

    run: str  # name of the run
    endpoint: str  # of its router
    users: Path | None  # file of passwords, where the router requires one
    agents: Sequence[int]  # whose passwords it has; none: it has no password
    per_s: float  # messages on each key, or connections [1/s; wall time]


class Flood:
    """Puts messages on some keys at a rate. row: counts the messages."""

    def __init__(self, puts: Sequence[tuple[Put, Sequence[bytes]]], row: "memoryview[int]") -> None:
        self._puts = [(put, cycle(messages)) for put, messages in puts]
        self._row = row
        self._sent = 0

    def catch_up(self, due: int) -> None:
        """Put what is due: so many messages on each key since the start."""
        burst = due - self._sent
        for put, messages in self._puts:
            for _ in range(burst):
                put(next(messages))
        self._sent = due
        if len(self._row):
            self._row[0] = due * len(self._puts)


def run(attack: Attack, row: "memoryview[int]") -> int:
    """Attack until this process is killed. Returns 1 where it cannot, after saying why."""
    os.setpriority(os.PRIO_PROCESS, 0, max(NICENESS, os.getpriority(os.PRIO_PROCESS, 0)))
    try:
        with ExitStack() as sessions:
            puts = _insider(attack, sessions) if attack.agents else _outsider(attack)
            _flood(attack, puts, row)
    except (AccessError, SessionError) as error:
        print(f"intruder: {error}", file=sys.stderr)
    return 1


def _flood(
    attack: Attack, puts: Sequence[tuple[Put, Sequence[bytes]]], row: "memoryview[int]"
) -> None:
    flood, begun_s = Flood(puts, row), time.monotonic()
    print(f"intruder: attacks {attack.endpoint}", flush=True)
    while True:
        flood.catch_up(int((time.monotonic() - begun_s) * attack.per_s))
        time.sleep(BURST_S)


def _insider(attack: Attack, sessions: ExitStack) -> list[tuple[Put, Sequence[bytes]]]:
    """Return what puts on each key of the agents, in sessions with their passwords."""
    puts: list[tuple[Put, Sequence[bytes]]] = []
    for agent in attack.agents[:MAX_PER_PROCESS]:
        login = login_of(attack.users, agent_name(agent)) if attack.users is not None else None
        session = sessions.enter_context(open_client(attack.endpoint, login=login))
        bus, random = Bus(session, Keys(attack.run)), Random(agent)
        for topic, make in MAKERS.items():
            puts.append((bus.publisher(topic, agent), mixed(make, random)))
    return puts


def _outsider(attack: Attack) -> list[tuple[Put, Sequence[bytes]]]:
    """Return what opens a connection for each message."""
    host, _, port = attack.endpoint.removeprefix("tcp/").rpartition(":")
    address, random = (host, int(port)), Random(0)

    def knock(noise: bytes) -> None:
        with suppress(OSError), socket.create_connection(address, CONNECT_WITHIN_S) as one:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
            one.sendall(noise)

    return [(knock, [random.randbytes(random.randrange(200)) for _ in range(MIXED)])]


def mixed(make: Make, random: Random) -> list[bytes]:
    """Return messages that a fleet must reject: none is of the present slot and incarnation."""
    kinds: list[Callable[[], bytes]] = [
        lambda: random.randbytes(random.randrange(200)),
        lambda: make(0, 0),
        lambda: make(random.randrange(4000), random.randrange(10**6, 10**9)),
        lambda: make(random.randrange(10**6, 2**52), random.randrange(3)),
    ]
    return [random.choice(kinds)() for _ in range(MIXED)]


def command(slot: int, incarnation: int) -> bytes:
    """Return a command of a slot."""
    velocity = (0.3, 0.3, 0.3)
    return encode(Command(slot, incarnation, slot + 8, velocity, 0.0, (0.0, 0.0), _TELEMETRY))


def transmission(slot: int, incarnation: int) -> bytes:
    """Return a transmission of a slot."""
    return pack(Transmission(slot, incarnation, (Outgoing(0, bytes(200)), Outgoing(1, bytes(90)))))


def arrivals(slot: int, incarnation: int) -> bytes:
    """Return a report on delays."""
    histogram = LatencyHistogram(0.0125)
    histogram.add((Frame(1, 0, 0, 0, b""),) * (slot % 50), (slot,) * (slot % 50), slot % 7)
    return pack(histogram.report(incarnation))


MAKERS: Final[dict[str, Make]] = {
    "tx": transmission,
    "command": command,
    "arrivals": arrivals,
}
"""The topics that an agent may write to, and what makes a message on each."""
