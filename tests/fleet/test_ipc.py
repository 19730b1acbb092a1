"""The messages between launcher, zygote and world: typed, whole, bounded, and refused otherwise."""

import socket
from collections.abc import Iterator
from typing import Any, get_args

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from worldsim.fleet.fork import ProcessExit
from worldsim.fleet.ipc import (
    MAX_MESSAGE_B,
    ActionDone,
    ActionRequest,
    AgentExited,
    AgentProcess,
    AgentStarted,
    EndRequest,
    FromWorld,
    FromZygote,
    IntruderEndRequest,
    IntruderExited,
    IntruderRequest,
    IntruderStarted,
    LauncherToWorld,
    Message,
    MessageError,
    MessageSocket,
    Notice,
    OtherProcessRequest,
    ProcessesMissing,
    Progress,
    RunFailed,
    RunOver,
    Stalled,
    ToWorld,
    ToZygote,
    WorldWoken,
    world_sockets,
    zygote_sockets,
)

AGENTS = (AgentProcess(3, 1), AgentProcess(7, 0))
PROGRESS = Progress(1.5, 20.0, 9, 4, 0.1 + 0.2, 0.01)
EXAMPLES: tuple[Message, ...] = (
    ActionRequest("start", AGENTS, after_s=2.5),
    ActionRequest("kill", AGENTS, by="operator"),
    ActionRequest("pause", ()),
    ActionDone("resume", AGENTS),
    OtherProcessRequest("world", "pause", for_s=2.5),
    OtherProcessRequest("netem", "kill", by="operator"),
    WorldWoken(),
    EndRequest(),
    IntruderRequest(3, (1, 2), 1e4),
    IntruderRequest(4, (), 200.0),
    IntruderEndRequest(3),
    IntruderStarted(3, pid=4711),
    IntruderExited(3, ProcessExit(None, 1)),
    AgentStarted(AGENTS[0], pid=4711),
    AgentExited(AGENTS[0], pid=4711, exit=ProcessExit(9, None)),
    AgentExited(AGENTS[1], pid=4711, exit=ProcessExit(None, 1)),
    RunFailed("netem was killed by signal 9"),
    ProcessesMissing(("netem", "agent-2")),
    ProcessesMissing(()),
    PROGRESS,
    Progress(0.0, 20.0, 9, 0, None, None),
    Stalled("agent-2's command of slot 5"),
    Notice("agent-1 is blocked"),
    RunOver(),
)
DIRECTIONS = {"ToZygote": ToZygote, "FromZygote": FromZygote, "ToWorld": ToWorld}
DIRECTIONS |= {"FromWorld": FromWorld}


def sockets(direction: str) -> tuple[Any, Any]:
    """Return the sending and the receiving end of a direction."""
    ends = zygote_sockets() if "Zygote" in direction else world_sockets()
    return ends if direction.startswith("To") else ends[::-1]


class Raw:
    """The launcher's end of a socket to the world, and the bytes that the world sends."""

    def __init__(self) -> None:
        near, self._world = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.launcher: LauncherToWorld = MessageSocket(
            near, "world", msgspec.msgpack.Decoder(FromWorld)
        )

    def receive(self, data: bytes) -> list[FromWorld]:
        self._world.send(data)
        return self.launcher.receive()

    def close(self) -> None:
        self._world.close()
        self.launcher.close()


@pytest.fixture
def raw() -> Iterator[Raw]:
    ends = Raw()
    yield ends
    ends.close()


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_every_kind_of_a_direction_crosses_unchanged_and_in_order(direction: str) -> None:
    kinds = get_args(DIRECTIONS[direction])
    messages = [message for message in EXAMPLES if isinstance(message, kinds)]
    assert {type(message) for message in messages} == set(kinds)
    sender, receiver = sockets(direction)
    assert receiver.receive() == []
    for message in messages:
        sender.send(message)
    assert receiver.receive() == messages
    sender.close()
    receiver.close()


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_kind_of_another_direction_is_refused(direction: str) -> None:
    kinds = get_args(DIRECTIONS[direction])
    sender, receiver = sockets(direction)
    for message in EXAMPLES:
        if not isinstance(message, kinds):
            sender.send(message)
            with pytest.raises(MessageError, match="sent a message that cannot be decoded"):
                receiver.receive()
    sender.close()
    receiver.close()


@pytest.mark.parametrize(
    ("sockets_of", "peers"),
    [(zygote_sockets, ("zygote", "launcher")), (world_sockets, ("world", "launcher"))],
)
def test_an_undecodable_message_names_its_sender(sockets_of: Any, peers: tuple[str, str]) -> None:
    ends = sockets_of()
    for receiver, sender, peer in zip(ends, ends[::-1], peers, strict=True):
        sender.send(Message())
        with pytest.raises(MessageError, match=f"^{peer} sent a message that cannot be decoded: "):
            receiver.receive()
    for end in ends:
        end.close()


def encoded(**fields: Any) -> bytes:
    return msgspec.msgpack.encode(fields)


GARBAGE = {
    "text": b"progress",
    "invalid UTF-8": encoded(kind="Stalled", waiting_for="x").replace(b"x", b"\xff"),
    "JSON": b'{"kind": "RunOver"}',
    "deep nesting": b"\x91" * 10_000,
    "no kind": encoded(waiting_for="netem"),
    "unknown kind": encoded(kind="Landing"),
    "unknown field": encoded(kind="RunOver", time_s=1.0),
    "missing field": encoded(kind="Stalled"),
    "wrong type": encoded(kind="ProcessesMissing", names="netem"),
    "unknown action": encoded(kind="ActionRequest", action="leave", processes=[]),
    "incomplete process": encoded(kind="ActionRequest", action="kill", processes=[[3]]),
    "negative agent": encoded(kind="ActionRequest", action="kill", processes=[[-1, 0]]),
}


@pytest.mark.parametrize("data", GARBAGE.values(), ids=GARBAGE.keys())
def test_garbage_is_refused_and_the_next_message_is_received(raw: Raw, data: bytes) -> None:
    with pytest.raises(MessageError, match=r"^world sent a message that cannot be decoded: "):
        raw.receive(data)
    assert raw.receive(msgspec.msgpack.encode(RunOver())) == [RunOver()]


def test_every_truncated_message_is_refused(raw: Raw) -> None:
    for message in (message for message in EXAMPLES if isinstance(message, get_args(FromWorld))):
        data = msgspec.msgpack.encode(message)
        for length in range(1, len(data)):
            with pytest.raises(MessageError):
                raw.receive(data[:length])


@settings(derandomize=True, deadline=None, max_examples=300)
@given(st.binary(min_size=1, max_size=200))
def test_random_bytes_are_refused(data: bytes) -> None:
    ends = Raw()
    with pytest.raises(MessageError):
        ends.receive(data)
    ends.close()


def test_an_oversize_message_is_not_sent() -> None:
    launcher, world = world_sockets()
    for send in (world.send, world.offer):
        with pytest.raises(MessageError, match=rf"to launcher not sent: .*{MAX_MESSAGE_B} B$"):
            send(Stalled("x" * MAX_MESSAGE_B))
    world.send(RunOver())
    assert launcher.receive() == [RunOver()]
    launcher.close()
    world.close()


def test_an_oversize_message_is_refused_and_the_longest_allowed_is_received(raw: Raw) -> None:
    room = MAX_MESSAGE_B - len(msgspec.msgpack.encode(Stalled("x" * 1000))) + 1000
    longest = Stalled("x" * room)
    data = msgspec.msgpack.encode(longest)
    assert len(data) == MAX_MESSAGE_B
    assert raw.receive(data) == [longest]
    for length in (MAX_MESSAGE_B + 1, 2 * MAX_MESSAGE_B):
        with pytest.raises(MessageError, match=rf"^world sent a message of over {MAX_MESSAGE_B} B"):
            raw.receive(data.ljust(length, b"\0"))


def test_messages_sent_before_an_end_closes_are_received() -> None:
    launcher, world = world_sockets()
    world.send(RunOver())
    world.close()
    assert launcher.receive() == [RunOver()]
    assert launcher.closed
    launcher.send(RunFailed("lost, for the world is gone"))
    launcher.close()


def test_sending_to_an_end_that_is_gone_sets_closed() -> None:
    launcher, world = world_sockets()
    world.close()
    assert not launcher.closed
    launcher.send(RunFailed("lost"))
    assert launcher.closed
    launcher.close()


def test_an_offer_to_an_end_that_does_not_read_does_not_block() -> None:
    launcher, world = world_sockets()
    for _ in range(20_000):
        world.offer(PROGRESS)
    received = launcher.receive()
    assert 0 < len(received) < 20_000
    assert set(received) == {PROGRESS}
    world.close()
    launcher.close()
