"""Datagrams: what controllers say to each other reaches them in order, checked and bounded."""

import pytest

from agent.codec import add_checksum, encode, holds_datagram
from agent.comms.datagrams import HEARD_S, MAX_INBOX, Datagrams
from agent.controller import Outgoing
from agent.messages import DATAGRAM_HEAD_B, MAX_DATAGRAM_B, Datagram
from agent.rejection import RejectedError
from netem.wire.channels import LOCAL, MAX_PAYLOAD_B, MULTIHOP

SLACK_S, ROUND_S, OFF = 0.1, 0.5, float("inf")


def said(stamp_s: float, data: bytes = b"") -> bytes:
    return add_checksum(encode(Datagram(stamp_s, data)))


def rejection(payload: bytes, now_s: float) -> str:
    with pytest.raises(RejectedError) as raised:
        Datagrams(SLACK_S, ROUND_S).receive(1, LOCAL, payload, now_s)
    return raised.value.cause


def test_the_inbox_is_sorted_by_source_channel_and_stamp_and_taken_once() -> None:
    datagrams = Datagrams(SLACK_S, ROUND_S)
    for source, channel, stamp_s in ((5, LOCAL, 1.0), (2, MULTIHOP, 0.9), (2, LOCAL, 1.1)):
        datagrams.receive(source, channel, said(stamp_s), 1.2)
    datagrams.receive(2, LOCAL, said(0.8, b"older"), 1.2)
    inbox = datagrams.take(1.25)
    assert [(each.source, each.channel, round(each.age_s, 6)) for each in inbox] == [
        (2, "local", 0.45),
        (2, "local", 0.15),
        (2, "multihop", 0.35),
        (5, "local", 0.25),
    ]
    assert inbox[0].data == b"older"
    assert datagrams.take(1.3) == ()


def test_a_datagram_that_the_clock_contradicts_or_that_is_damaged_is_rejected() -> None:
    assert rejection(said(2.0), now_s=1.0) == "future"
    assert rejection(said(1.0), now_s=6.1) == "old"
    assert rejection(said(1.0)[:-1] + b"x", now_s=1.0) == "corrupt"
    assert rejection(said(1.0, bytes(MAX_DATAGRAM_B)) + b"x", now_s=1.0) == "oversize"
    assert rejection(add_checksum(b"\x92\xc0\xc4\x00"), now_s=1.0) == "invalid"
    slack = Datagrams(SLACK_S, ROUND_S)
    slack.receive(1, LOCAL, said(1.09), 1.0)
    assert [each.age_s for each in slack.take(1.0)] == [0.0]


def test_who_says_too_much_in_one_step_is_cut_and_nobody_else() -> None:
    datagrams = Datagrams(SLACK_S, ROUND_S)
    for _ in range(MAX_INBOX):
        datagrams.receive(1, LOCAL, said(1.0), 1.0)
    with pytest.raises(RejectedError) as raised:
        datagrams.receive(1, LOCAL, said(1.0), 1.0)
    assert raised.value.cause == "overflow"
    datagrams.receive(2, LOCAL, said(1.0), 1.0)
    assert len(datagrams.take(1.0)) == MAX_INBOX + 1


def test_the_longest_datagram_fills_a_frame_and_no_beacon_looks_like_one() -> None:
    datagrams = Datagrams(SLACK_S, ROUND_S)
    longest = (Outgoing("local", bytes(MAX_DATAGRAM_B)), Outgoing("multihop", b"m"))
    frames = datagrams.frames(1.0, longest)
    assert [channel for channel, _ in frames] == [LOCAL, MULTIHOP]
    assert [len(payload) for _, payload in frames] == [MAX_PAYLOAD_B, DATAGRAM_HEAD_B]
    assert all(holds_datagram(payload) for _, payload in frames)
    assert not holds_datagram(b"")


def test_nothing_is_sent_on_a_multihop_channel_that_is_off() -> None:
    off = Datagrams(SLACK_S, OFF)
    frames = off.frames(1.0, (Outgoing("multihop", b"m"), Outgoing("local", b"l")))
    assert [channel for channel, _ in frames] == [LOCAL]


def test_who_sent_of_late_is_heard() -> None:
    datagrams = Datagrams(SLACK_S, ROUND_S)
    datagrams.receive(7, LOCAL, said(1.0), 1.0)
    datagrams.receive(2, MULTIHOP, said(2.0), 2.0)
    assert datagrams.senders(2.5) == (2, 7)
    assert datagrams.senders(1.0 + HEARD_S + 0.1) == (2,)
    assert datagrams.senders(2.0 + HEARD_S + 0.1) == ()
