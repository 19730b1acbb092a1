"""A small share of the ten million messages of ``python -m tests.fuzz_messages``."""

from tests.fuzz_messages import Fuzz


def test_no_message_brings_anything_down_or_leaves_a_number_that_is_none() -> None:
    fuzz = Fuzz(seed=1)
    fuzz.run(30_000)
    assert fuzz.counts.total() == 30_000
    assert fuzz.counts["refused"] > 10_000
    assert fuzz.counts["taken"] > 1_000
