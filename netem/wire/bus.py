"""Messages by topic: one process's rings, puts, questions and sign of life in one run.

What arrives waits in rings, where the newest messages push out the oldest; nothing here runs a
thread of ours or blocks a sender.
"""

import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from operator import call
from types import FrameType
from typing import Any, Protocol, TypeVar

import zenoh
from zenoh.handlers import RingChannel

from netem.wire.keys import TOPICS, Keys

Put = Callable[[bytes], None]
LATE = "Timeout"
"""What Zenoh itself answers for somebody who has heard the question and says nothing in time."""

_T = TypeVar("_T")
_T_co = TypeVar("_T_co", covariant=True)


class RefusedError(RuntimeError):
    """A question that was answered with a refusal; the text is the other side's reason."""


class Waiting(Protocol[_T_co]):
    """What Zenoh's rings offer to a reader."""

    def recv(self) -> _T_co:
        """Wait for an item, for ever."""

    def try_recv(self) -> _T_co | None:
        """Return an item that is there, or None."""


class _DeadlineError(Exception):
    """Raised by the alarm within a wait, and nowhere else."""


class _Alarm:
    """A deadline for a wait that has none of its own: SIGALRM, so for the main thread only.

    Zenoh looks for signals about every 100 ms while it waits, so a deadline is that coarse.
    """

    def __init__(self) -> None:
        self._waiting = False

    def within(self, timeout_s: float, wait: Callable[[], _T]) -> _T | None:
        """Return what ``wait`` returns, or None when it has not by ``timeout_s`` [s]."""
        items: list[_T] = []
        before = signal.signal(signal.SIGALRM, self._ring)
        try:
            self._waiting = True
            signal.setitimer(signal.ITIMER_REAL, timeout_s)
            # All of it in C: an alarm that rings while an item is handed over finds it in the list.
            items.extend(map(call, (wait,)))
            self._waiting = False
        except _DeadlineError:
            self._waiting = False
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)
        return items[0] if items else None

    def _ring(self, _number: int, _frame: FrameType | None) -> None:
        if self._waiting:
            raise _DeadlineError


_alarm = _Alarm()


def receive(source: Waiting[_T], timeout_s: float) -> _T | None:
    """Return the next item, or None when none has come by ``timeout_s`` [s] (coarse: 0.1 s)."""
    item = source.try_recv()
    return item if item is not None else _alarm.within(timeout_s, source.recv)


def drained(source: Waiting[_T], quota: int) -> list[_T]:
    """Return what is there already, at most ``quota`` items; never waits."""
    items: list[_T] = []
    while len(items) < quota and (item := source.try_recv()) is not None:
        items.append(item)
    return items


class Ring:
    """The newest payloads on one key; with size 1, the latest wins."""

    def __init__(self, session: zenoh.Session, key: str, size: int) -> None:
        self._source = session.declare_subscriber(key, RingChannel(size))

    def wait(self, timeout_s: float) -> bytes | None:
        """Return the next payload, or None when none has come by ``timeout_s`` [s]."""
        sample = receive(self._source, timeout_s)
        return sample.payload.to_bytes() if sample is not None else None

    def drain(self, quota: int) -> list[bytes]:
        """Return the payloads that are there, oldest first, at most ``quota``."""
        return [sample.payload.to_bytes() for sample in drained(self._source, quota)]


class Rings:
    """The rings of all who say something on one topic, each read up to a quota at a time.

    Who has more there is read on, up to a reserve that all of them share: so what somebody says is
    found among much that is said in his name, others lose nothing by it, and the time that it
    costs is bounded.
    """

    SIZE = 256
    QUOTA = 2
    RESERVE = 256

    def __init__(self, rings: Sequence[Ring]) -> None:
        self._rings = rings

    def drain(self) -> Iterator[tuple[int, list[bytes]]]:
        """Yield for each sender the payloads that are there, oldest first."""
        left = self.RESERVE
        for sender, ring in enumerate(self._rings):
            found = ring.drain(self.QUOTA + left)
            left -= max(0, len(found) - self.QUOTA)
            yield sender, found


class Presence:
    """Who shows a sign of life in a run, by name (``world``, ``netem``, ``agent-3``).

    A hint, no more: when the router is gone, everybody seems to be.
    """

    def __init__(self, session: zenoh.Session, keys: Keys) -> None:
        self.present: set[str] = set()
        self._source = session.liveliness().declare_subscriber(
            keys.every("alive"), RingChannel(4096), history=True
        )

    def gone(self) -> list[str]:
        """Take in what changed, and return who went since the last call."""
        gone = []
        while (sample := self._source.try_recv()) is not None:
            name = Keys.who(str(sample.key_expr))
            if sample.kind == zenoh.SampleKind.PUT:
                self.present.add(name)
            elif name in self.present:
                self.present.discard(name)
                gone.append(name)
        return gone


class Bus:
    """One process's way to send and receive in one run."""

    def __init__(self, session: zenoh.Session, keys: Keys) -> None:
        self._session = session
        self._keys = keys
        self._signs: list[zenoh.LivelinessToken] = []
        self._awaited: list[zenoh.Publisher] = []

    def putter(self, topic: str, who: int | None = None, *, lockstep: bool = False) -> Put:
        """Return what puts on a topic, with the quality of service that the table gives it.

        In lockstep every message is waited for: it blocks where it would else be dropped.
        """
        reliable = lockstep or TOPICS[topic].reliable
        control = zenoh.CongestionControl.BLOCK if reliable else zenoh.CongestionControl.DROP
        key = self._keys.of(topic, who)
        publisher = self._session.declare_publisher(key, congestion_control=control)
        if lockstep:
            self._awaited.append(publisher)
        return publisher.put

    @property
    def heard(self) -> bool:
        """Whether all that is put in lockstep has somebody who listens."""
        # Zenoh's stubs call a status a bool; it has one.
        found: list[Any] = [publisher.matching_status for publisher in self._awaited]
        return all(status.matching for status in found)

    def ring(self, topic: str, who: int | None = None, size: int = 1) -> Ring:
        """Return a ring of the newest messages on a topic."""
        return Ring(self._session, self._keys.of(topic, who), size)

    def rings(self, topic: str, agents: Iterable[int]) -> Rings:
        """Return the rings of what each of some agents says on a topic."""
        return Rings([self.ring(topic, agent, Rings.SIZE) for agent in agents])

    def presence(self) -> Presence:
        """Return the roll of those who are alive."""
        return Presence(self._session, self._keys)

    def show_life(self, name: str) -> None:
        """Show a sign of life under a name, until the session closes."""
        self._signs.append(self._session.liveliness().declare_token(self._keys.of("alive", name)))

    def questions(self, topic: str) -> Waiting[zenoh.Query]:
        """Return where the questions on a topic, of whomever, come in."""
        return self._session.declare_queryable(self._keys.every(topic), RingChannel(4096))

    def ask(self, topic: str, who: int | None, question: bytes, timeout_s: float) -> bytes | None:
        """Return the answer to a question, or None when there is nobody yet who answers it.

        Raises :class:`RefusedError` when the answer is a refusal.
        """
        key = self._keys.of(topic, who)
        for reply in self._session.get(key, payload=question, timeout=timeout_s):
            if reply.err is not None and reply.err.payload.to_string() != LATE:
                raise RefusedError(reply.err.payload.to_string())
            if reply.ok is not None:
                return reply.ok.payload.to_bytes()
        return None
