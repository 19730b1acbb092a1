"""A wait with a deadline: what comes when the deadline does is not lost."""

import json
import threading

import pytest
import zenoh
from zenoh.handlers import RingChannel

from netem.wire.barrier import LockstepError, UnwantedError, answer, same_slot
from netem.wire.bus import receive

ALONE = {
    "mode": "router",
    "listen": {"endpoints": []},
    "scouting": {"multicast": {"enabled": False}},
}


def test_whatever_comes_round_a_deadline_is_received() -> None:
    alone = json.dumps(ALONE)
    with zenoh.open(zenoh.Config.from_json5(alone)) as session:
        ring = session.declare_subscriber("some/key", RingChannel(64))
        pause = threading.Event()

        def put() -> None:
            for number in range(10):
                # The alarm at 30 ms is looked at after 100 ms: all of these come in between.
                pause.wait(0.06)
                session.put("some/key", str(number))

        sender = threading.Thread(target=put)
        sender.start()
        got: list[str] = []
        for _ in range(100):
            sample = receive(ring, 0.03)
            got += [sample.payload.to_string()] if sample is not None else []
            if len(got) == 10:
                break
        sender.join()
    assert got == [str(number) for number in range(10)]


class Silent:
    """A ring on which something comes after some waits, or never."""

    def __init__(self, after: int) -> None:
        self.waits = 0
        self._after = after

    def wait(self, timeout_s: float) -> bytes | None:
        self.waits += 1
        return b"here" if self.waits > self._after else None


def test_an_answer_is_waited_for_and_no_longer_than_told() -> None:
    assert answer(Silent(3), "a word", lambda: False) == b"here"
    with pytest.raises(LockstepError, match=r"a word has not come within 20 s"):
        answer(Silent(1000), "a word", lambda: False)
    with pytest.raises(UnwantedError):
        answer(Silent(1000), "a word", lambda: True)


def test_what_is_of_another_slot_is_refused() -> None:
    same_slot("a word", 4, 4)
    with pytest.raises(LockstepError, match="a word is of slot 8, in slot 4"):
        same_slot("a word", 8, 4)
