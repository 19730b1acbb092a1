"""The lockstep barrier: a wait has an end, and a message belongs to its slot."""

import pytest

from netem.wire.barrier import LockstepError, RunOverError, await_message, check_slot


class SlowSubscriber:
    """A subscriber that receives a message after some polls."""

    def __init__(self, polls: int) -> None:
        self.polls = 0
        self._polls = polls

    def wait(self, timeout_s: float) -> bytes | None:
        self.polls += 1
        return b"here" if self.polls > self._polls else None


def test_a_message_is_awaited_for_a_limited_time() -> None:
    assert await_message(SlowSubscriber(3), "the batch", lambda: False) == b"here"
    with pytest.raises(LockstepError, match=r"^the batch has not arrived within 20 s$"):
        await_message(SlowSubscriber(1000), "the batch", lambda: False)


def test_a_wait_ends_with_the_run() -> None:
    subscriber = SlowSubscriber(1000)
    with pytest.raises(RunOverError):
        await_message(subscriber, "the batch", lambda: subscriber.polls == 3)
    assert subscriber.polls == 3


def test_a_message_of_another_slot_is_refused() -> None:
    check_slot("the batch", 4, 4)
    with pytest.raises(LockstepError, match=r"^the batch is of slot 8; expected slot 4$"):
        check_slot("the batch", 8, 4)
