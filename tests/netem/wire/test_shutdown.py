"""The end of a run: its own message ends a process, and nothing else that comes on its key."""

from typing import Any

from netem.wire.shutdown import RUN_OVER, RunEnd


class Received:
    """A subscriber, or a stop request, of which the test says what has come."""

    def __init__(self) -> None:
        self.waiting: list[bytes] = []
        self.requested = False

    def drain(self, quota: int) -> list[bytes]:
        taken, self.waiting = self.waiting[:quota], self.waiting[quota:]
        return taken


def test_only_the_message_of_the_end_ends_a_run() -> None:
    over: Any = Received()
    ending = RunEnd(over, over)
    assert not ending()
    over.waiting = [b"", b"an observation"]
    assert not ending()
    assert not ending()
    over.waiting = [RUN_OVER]
    assert ending()
    assert ending(), "it stays over"


def test_a_requested_stop_ends_a_run() -> None:
    over: Any = Received()
    ending = RunEnd(over, over)
    over.requested = True
    assert ending()
