"""Receiving: fair shares of many senders' messages, and waits that lose nothing at a deadline."""

import json
import threading

import pytest
import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st
from zenoh.handlers import RingChannel

from netem.wire.bus import FairSubscriber, receive

QUOTA, RESERVE, SIZE = FairSubscriber.QUOTA, FairSubscriber.RESERVE, FairSubscriber.SIZE
ALONE = {
    "mode": "router",
    "listen": {"endpoints": []},
    "scouting": {"multicast": {"enabled": False}},
}


class FakeSubscriber:
    """A subscriber with a number of messages."""

    def __init__(self, waiting: int) -> None:
        self.waiting = waiting

    def drain(self, quota: int) -> list[bytes]:
        taken = min(quota, self.waiting)
        self.waiting -= taken
        return [b""] * taken


def counts(waiting: list[int]) -> list[int]:
    """The number of messages read of each sender, where so many wait."""
    read = FairSubscriber([FakeSubscriber(each) for each in waiting]).drain()
    return [len(payloads) for _, payloads in read]


@settings(derandomize=True, deadline=None)
@given(st.lists(st.integers(0, SIZE), min_size=1, max_size=40))
def test_each_sender_is_read_up_to_its_quota_and_all_up_to_a_bound(waiting: list[int]) -> None:
    read = counts(waiting)
    assert all(got >= min(each, QUOTA) for got, each in zip(read, waiting, strict=True))
    assert sum(read) <= RESERVE + QUOTA * len(waiting)
    if sum(max(0, each - QUOTA) for each in waiting) <= RESERVE:
        assert read == waiting


@pytest.mark.parametrize("flooder", [0, 5, 9])
def test_one_flooder_is_read_to_the_end_and_costs_no_other_sender_anything(flooder: int) -> None:
    waiting = [SIZE if at == flooder else 1 for at in range(10)]
    assert counts(waiting) == waiting


def test_a_message_that_arrives_at_the_deadline_is_not_lost() -> None:
    alone = json.dumps(ALONE)
    with zenoh.open(zenoh.Config.from_json5(alone)) as session:
        handler = session.declare_subscriber("some/key", RingChannel(64))
        pause = threading.Event()

        def put() -> None:
            for number in range(10):
                # The alarm at 30 ms is noticed after 100 ms: all of these arrive in between.
                pause.wait(0.06)
                session.put("some/key", str(number))

        sender = threading.Thread(target=put)
        sender.start()
        received: list[str] = []
        for _ in range(100):
            sample = receive(handler, 0.03)
            received += [sample.payload.to_string()] if sample is not None else []
            if len(received) == 10:
                break
        sender.join()
    assert received == [str(number) for number in range(10)]
