"""The witness takes what an agent would take, and rejects the rest for the same causes."""

import msgspec
import pytest
from msgspec.structs import replace

from agent.codec import add_checksum, decode_beacon, decode_gossip, encode
from agent.core import Agent
from agent.messages import Beacon, Datagram, Gossip
from netem.wire.channels import LOCAL, MULTIHOP, Channel
from netem.wire.frame import Outgoing
from tests.agent.test_core import observation
from tests.small_scenario import SMALL
from worldsim.fleet.frame_witness import FrameWitness
from worldsim.scenario.file import parse

SCENARIO = parse(SMALL)
NOW_S = observation(0).time_s


def said() -> tuple[Beacon, Gossip]:
    """Return what an agent of this project says of its first step."""
    own = Agent(SCENARIO.agent_setup(1, 0, 1))
    frames = own.step(observation(0)).frames
    while len(frames) < 2:
        frames += own.step(observation(len(frames) * 10)).frames
    payloads = dict(reversed(frames))
    return decode_beacon(payloads[LOCAL]), decode_gossip(payloads[MULTIHOP])


BEACON, GOSSIP = said()
PAYLOAD = add_checksum(encode(BEACON))


def heard(payload: bytes, channel: Channel = LOCAL, at_s: float = NOW_S) -> str | None:
    return FrameWitness(SCENARIO).refusal(1, Outgoing(channel, payload), at_s)


def beacon(**fields: object) -> bytes:
    return add_checksum(encode(replace(BEACON, **fields)))


@pytest.mark.parametrize(
    ("payload", "cause"),
    [
        (PAYLOAD, None),
        (beacon(id=0), "spoofed"),
        (beacon(stamp_s=NOW_S + 3.0), "future"),
        (beacon(velocity=(90.0, 0.0, 0.0)), "speed"),
        (PAYLOAD[:-1] + bytes([PAYLOAD[-1] ^ 1]), "corrupt"),
        (add_checksum(msgspec.msgpack.encode(msgspec.to_builtins(BEACON)[:-3])), "invalid"),
        (add_checksum(b"\xc1"), "garbage"),
        (b"", "corrupt"),
        (add_checksum(encode(Datagram(NOW_S, b"hello"))), None),
        (add_checksum(encode(Datagram(NOW_S + 3.0, b"hello"))), "future"),
    ],
)
def test_a_frame_of_the_local_channel(payload: bytes, cause: str | None) -> None:
    assert heard(payload) == cause


def test_a_frame_of_the_multihop_channel() -> None:
    at_s = GOSSIP.stamp_s
    assert heard(add_checksum(encode(GOSSIP)), MULTIHOP, at_s) is None
    assert heard(add_checksum(encode(GOSSIP)), MULTIHOP, at_s + 6.0) == "old"
    assert heard(add_checksum(encode(replace(GOSSIP, id=0))), MULTIHOP, at_s) == "spoofed"


def test_a_sequence_that_was_told_before_is_rejected_and_only_foreign_agents_are_watched() -> None:
    witness = FrameWitness(SCENARIO)
    assert witness.refusal(1, Outgoing(LOCAL, PAYLOAD), NOW_S) is None
    assert witness.refusal(1, Outgoing(LOCAL, PAYLOAD), NOW_S) == "replay"
    assert not witness.watches(1)
    foreign = parse(f"{SMALL}\n[[agent]]\nids = [1]\ncommand = ['/bin/sh']\n")
    assert FrameWitness(foreign).watches(1)
    assert not FrameWitness(foreign).watches(0)
