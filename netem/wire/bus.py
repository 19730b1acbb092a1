"""Messaging by topic: publishers, subscribers, queries and liveliness of one process in one run.

Received messages wait in ring buffers, where the newest replace the oldest. Nothing here starts a
thread of ours or blocks a sender.
"""

import signal

# signal.signal without its conversions to and from enums, which cost more than the rest of a wait.
from _signal import signal as _set_handler  # type: ignore[import-not-found]
from collections.abc import Callable, Iterable, Iterator, Sequence
from operator import call
from types import FrameType
from typing import Any, Protocol, TypeVar

import zenoh
from zenoh.handlers import RingChannel

from netem.wire.keys import TOPICS, Keys

Put = Callable[[bytes], None]
QUERY_TIMEOUT = "Timeout"
"""Zenoh's error reply in place of a process that received a query and did not reply in time."""
LIVELINESS_RING = 4096
QUERY_RING = 4096
_ALARM = int(signal.SIGALRM)

_T = TypeVar("_T")
_T_co = TypeVar("_T_co", covariant=True)


class RefusedError(RuntimeError):
    """A query was refused; the text is the other side's reason."""


class Handler(Protocol[_T_co]):
    """The reading end of a Zenoh ring buffer: a subscriber's or a queryable's."""

    def recv(self) -> _T_co:
        """Wait for an item, without a limit."""

    def try_recv(self) -> _T_co | None:
        """Return the next item, or None where there is none."""


class _DeadlineError(Exception):
    """Raised by the alarm within a wait, and nowhere else."""


class _Alarm:
    """A deadline for a wait that has none of its own: SIGALRM, so for the main thread only.

    Zenoh checks for signals about every 100 ms while it waits, so a deadline is that coarse.
    """

    def __init__(self) -> None:
        self._waiting = False

    def within(self, timeout_s: float, wait: Callable[[], _T]) -> _T | None:
        """Return the result of ``wait``, or None when it has none by ``timeout_s`` [s]."""
        items: list[_T] = []
        before = _set_handler(_ALARM, self._ring)
        try:
            self._waiting = True
            signal.setitimer(signal.ITIMER_REAL, timeout_s)
            # All in C: an alarm that rings while an item is handed over finds it in the list.
            items.extend(map(call, (wait,)))
            self._waiting = False
        except _DeadlineError:
            self._waiting = False
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            _set_handler(_ALARM, before)
        return items[0] if items else None

    def _ring(self, _number: int, _frame: FrameType | None) -> None:
        if self._waiting:
            raise _DeadlineError


_alarm = _Alarm()


def receive(handler: Handler[_T], timeout_s: float) -> _T | None:
    """Return the next item, or None when none arrives by ``timeout_s`` [s] (coarse: 0.1 s)."""
    item = handler.try_recv()
    return item if item is not None else _alarm.within(timeout_s, handler.recv)


def drain(handler: Handler[_T], quota: int) -> list[_T]:
    """Return the items that have arrived, oldest first, at most ``quota``; never waits."""
    items: list[_T] = []
    while len(items) < quota and (item := handler.try_recv()) is not None:
        items.append(item)
    return items


class Subscriber:
    """The newest payloads on one key; with size 1, the latest replaces the one before."""

    def __init__(self, session: zenoh.Session, key: str, size: int) -> None:
        self._handler = session.declare_subscriber(key, RingChannel(size))
        self._try_recv = self._handler.try_recv

    def wait(self, timeout_s: float) -> bytes | None:
        """Return the next payload, or None when none arrives by ``timeout_s`` [s]."""
        sample = self._try_recv()
        if sample is None:
            sample = _alarm.within(timeout_s, self._handler.recv)
        return sample.payload.to_bytes() if sample is not None else None

    def drain(self, quota: int) -> list[bytes]:
        """Return the payloads that have arrived, oldest first, at most ``quota``."""
        payloads: list[bytes] = []
        while len(payloads) < quota and (sample := self._try_recv()) is not None:
            payloads.append(sample.payload.to_bytes())
        return payloads


class FairSubscriber:
    """One subscriber for each sender of a topic, each read up to a quota at a time.

    Beyond the quota all senders share a reserve. So a sender's own messages are found among many
    forged in its name, other senders lose nothing by a flood, and the time it costs is bounded.
    """

    SIZE = 256
    """Ring size for each sender."""
    QUOTA = 2
    """Messages that are read of each sender at a time."""
    RESERVE = 256
    """Messages that are read at a time in addition, of all senders together."""

    def __init__(self, subscribers: Sequence[Subscriber]) -> None:
        self._subscribers = subscribers

    def drain(self) -> Iterator[tuple[int, list[bytes]]]:
        """Yield each sender's index and its payloads, oldest first."""
        left = self.RESERVE
        for sender, subscriber in enumerate(self._subscribers):
            payloads = subscriber.drain(self.QUOTA + left)
            left -= max(0, len(payloads) - self.QUOTA)
            yield sender, payloads


class Liveliness:
    """The processes of a run that are alive, by name (``world``, ``netem``, ``agent-3``).

    Only a hint: when the router dies, all processes seem to be gone.
    """

    def __init__(self, session: zenoh.Session, keys: Keys) -> None:
        self.alive: set[str] = set()
        """Up to date as of the last call of ``departed``."""
        self._handler = session.liveliness().declare_subscriber(
            keys.all_of("alive"), RingChannel(LIVELINESS_RING), history=True
        )

    def departed(self) -> list[str]:
        """Update ``alive``, and return the names that have gone since the last call."""
        departed = []
        while (sample := self._handler.try_recv()) is not None:
            name = Keys.owner_of(str(sample.key_expr))
            if sample.kind == zenoh.SampleKind.PUT:
                self.alive.add(name)
            elif name in self.alive:
                self.alive.discard(name)
                departed.append(name)
        return departed


class PendingQuery:
    """A query on its way; asking for its reply never waits."""

    def __init__(self, replies: Handler[zenoh.Reply]) -> None:
        self._replies = replies

    def answered(self) -> bool | None:
        """Return whether a process has accepted the query; None while that is open.

        Raises :class:`RefusedError` when the reply is an error.
        """
        try:
            reply = self._replies.try_recv()
        except zenoh.ZError:  # no process has received it
            return False
        if reply is None or reply.ok is not None:
            return None if reply is None else True
        return _refuse_unless_timeout(reply)


class Bus:
    """One process's access to the topics of one run.

    owner: the agent's id, the shard or the process's name where a topic has one key for each.
    """

    def __init__(self, session: zenoh.Session, keys: Keys) -> None:
        self.run = keys.run
        """The run's name."""
        self._session = session
        self._keys = keys
        self._tokens: list[zenoh.LivelinessToken] = []
        self._lockstep_publishers: list[zenoh.Publisher] = []

    def publisher(self, topic: str, owner: int | None = None, *, lockstep: bool = False) -> Put:
        """Return the function that puts on a topic, with the quality of service of TOPICS.

        lockstep: block instead of dropping, whatever TOPICS says.
        """
        blocking = lockstep or TOPICS[topic].blocking
        control = zenoh.CongestionControl.BLOCK if blocking else zenoh.CongestionControl.DROP
        key = self._keys.of(topic, owner)
        publisher = self._session.declare_publisher(key, congestion_control=control)
        if lockstep:
            self._lockstep_publishers.append(publisher)
        return publisher.put

    @property
    def matched(self) -> bool:
        """Whether every lockstep publisher has a subscriber."""
        # Zenoh's stubs declare matching_status as a bool; it is an object with a field.
        found: list[Any] = [publisher.matching_status for publisher in self._lockstep_publishers]
        return all(status.matching for status in found)

    def subscriber(self, topic: str, owner: int | None = None, size: int = 1) -> Subscriber:
        """Return a subscriber that keeps the newest ``size`` messages on a topic."""
        return Subscriber(self._session, self._keys.of(topic, owner), size)

    def fair_subscriber(self, topic: str, agents: Iterable[int]) -> FairSubscriber:
        """Return a subscriber to a topic of several agents."""
        size = FairSubscriber.SIZE
        return FairSubscriber([self.subscriber(topic, agent, size) for agent in agents])

    def liveliness(self) -> Liveliness:
        """Return a view of the processes that are alive."""
        return Liveliness(self._session, self._keys)

    def declare_alive(self, name: str) -> None:
        """Show a process as alive under a name, until the session closes."""
        key = self._keys.of("alive", name)
        self._tokens.append(self._session.liveliness().declare_token(key))

    def queryable(self, topic: str) -> Handler[zenoh.Query]:
        """Return the queries on a topic, of any owner, as they arrive."""
        return self._session.declare_queryable(self._keys.all_of(topic), RingChannel(QUERY_RING))

    def query(
        self, topic: str, owner: int | None, payload: bytes, timeout_s: float
    ) -> bytes | None:
        """Return the reply to a query, or None when no process replies in time.

        Raises :class:`RefusedError` when the reply is an error.
        """
        key = self._keys.of(topic, owner)
        for reply in self._session.get(key, payload=payload, timeout=timeout_s):
            if reply.ok is not None:
                return reply.ok.payload.to_bytes()
            _refuse_unless_timeout(reply)
        return None

    def begin_query(self, topic: str, payload: bytes, timeout_s: float) -> PendingQuery:
        """Send a query; its reply is awaited by :meth:`PendingQuery.answered`."""
        return PendingQuery(
            self._session.get(self._keys.of(topic), payload=payload, timeout=timeout_s)
        )


def _refuse_unless_timeout(reply: zenoh.Reply) -> bool:
    """Return False for a query without a reply in time; raise RefusedError for another error."""
    if reply.err is not None and reply.err.payload.to_string() != QUERY_TIMEOUT:
        raise RefusedError(reply.err.payload.to_string())
    return False
