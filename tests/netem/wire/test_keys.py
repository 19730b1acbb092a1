"""The table of keys: every topic has its key, no two share one, and keys tell whose they are."""

import pytest
import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.wire.keys import RUN_NAME, TOPICS, Keys

BAD_NAMES = [
    "",
    " ",
    "a b",
    "a/b",
    "*",
    "**",
    "a*",
    "$*",
    "a?b",
    "a#b",
    "@run",
    ".hidden",
    "-x",
    "_x",
    "a\n",
    "a\0",
    "é",
    "x" * 121,
]
names = st.from_regex(RUN_NAME, fullmatch=True)
ONE = {"id": 3, "name": "agent-3"}


def named(topic):
    """Return what completes a topic's key, or None where it needs nothing."""
    template = TOPICS[topic].template
    return next((value for field, value in ONE.items() if f"{{{field}}}" in template), None)


@pytest.mark.parametrize("name", BAD_NAMES)
def test_a_name_that_a_key_cannot_carry_is_refused(name):
    with pytest.raises(ValueError, match="run name"):
        Keys(name)


@settings(derandomize=True, deadline=None)
@given(names, st.sampled_from(sorted(TOPICS)), st.integers(0, 2**16 - 1))
def test_zenoh_takes_every_key_as_it_stands(run, topic, who):
    keys = Keys(run)
    key = keys.of(topic, who)
    assert str(zenoh.KeyExpr.autocanonize(key)) == key
    assert zenoh.KeyExpr(keys.every(topic)).includes(zenoh.KeyExpr(key))
    assert key.startswith(f"qswarm/{run}/")


@settings(derandomize=True, deadline=None)
@given(names, st.sampled_from(sorted(TOPICS)), st.integers(0, 2**16 - 1))
def test_a_key_tells_its_run_and_who(run, topic, who):
    key = Keys(run).of(topic, who)
    assert Keys.run_of(key) == run
    if named(topic) is not None:
        assert Keys.who(key) == str(who)


@pytest.mark.parametrize("topic", TOPICS)
def test_every_topic_has_a_key_and_says_who_puts_and_who_gets(topic):
    row, keys = TOPICS[topic], Keys("mine")
    key = keys.of(topic, named(topic))
    assert "{" not in key
    assert (keys.every(topic) == key) is (named(topic) is None)
    assert row.writer
    assert row.reader
    assert row.rate
    assert row.what


def test_no_two_topics_share_a_key():
    keys = Keys("mine")
    every = [zenoh.KeyExpr(keys.every(topic)) for topic in TOPICS]
    for index, one in enumerate(every):
        assert not any(one.intersects(other) for other in every[:index])


def test_runs_do_not_hear_each_other():
    mine, other = Keys("mine"), Keys("other")
    for topic in TOPICS:
        one, two = (zenoh.KeyExpr(keys.every(topic)) for keys in (mine, other))
        assert not one.intersects(two)


def test_the_medium_can_be_asked_for_by_any_run():
    anybody = zenoh.KeyExpr(Keys.any_run("medium"))
    assert anybody.includes(zenoh.KeyExpr(Keys("mine").of("medium")))
    assert not anybody.intersects(zenoh.KeyExpr(Keys("mine").of("tx", 1)))
