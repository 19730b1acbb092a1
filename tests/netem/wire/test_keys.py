"""The table of topics: each has a key of its own, and a key tells its run and its owner."""

import pytest
import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.wire.keys import PROCESSES, RUN_NAME, TOPICS, Keys

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
    """Return an owner that completes a topic's key, or None where it needs none."""
    template = TOPICS[topic].template
    return next((value for field, value in ONE.items() if f"{{{field}}}" in template), None)


@pytest.mark.parametrize("name", BAD_NAMES)
def test_a_run_name_that_cannot_be_part_of_a_key_is_refused(name):
    with pytest.raises(ValueError, match="run name"):
        Keys(name)


@settings(derandomize=True, deadline=None)
@given(names, st.sampled_from(sorted(TOPICS)), st.integers(0, 2**16 - 1))
def test_every_key_is_canonical(run, topic, owner):
    keys = Keys(run)
    key = keys.of(topic, owner)
    assert str(zenoh.KeyExpr.autocanonize(key)) == key
    assert zenoh.KeyExpr(keys.all_of(topic)).includes(zenoh.KeyExpr(key))
    assert key.startswith(f"qswarm/{run}/")


@settings(derandomize=True, deadline=None)
@given(names, st.sampled_from(sorted(TOPICS)), st.integers(0, 2**16 - 1))
def test_a_key_tells_its_run_and_owner(run, topic, owner):
    key = Keys(run).of(topic, owner)
    assert Keys.run_of(key) == run
    if named(topic) is not None:
        assert Keys.owner_of(key) == str(owner)


@pytest.mark.parametrize("topic", TOPICS)
def test_every_topic_has_a_key_a_publisher_and_a_subscriber(topic):
    row, keys = TOPICS[topic], Keys("mine")
    key = keys.of(topic, named(topic))
    assert "{" not in key
    assert (keys.all_of(topic) == key) is (named(topic) is None)
    assert {row.publisher, row.subscriber} <= set(PROCESSES)
    assert row.publisher != row.subscriber or row.publisher == "all"


def test_no_two_topics_share_a_key():
    keys = Keys("mine")
    expressions = [zenoh.KeyExpr(keys.all_of(topic)) for topic in TOPICS]
    for index, one in enumerate(expressions):
        assert not any(one.intersects(other) for other in expressions[:index])


def test_keys_of_two_runs_never_match():
    mine, other = Keys("mine"), Keys("other")
    for topic in TOPICS:
        one, two = (zenoh.KeyExpr(keys.all_of(topic)) for keys in (mine, other))
        assert not one.intersects(two)


def test_a_medium_gets_the_queries_of_all_runs():
    any_run = zenoh.KeyExpr(Keys.any_run("medium"))
    assert any_run.includes(zenoh.KeyExpr(Keys("mine").of("medium")))
    assert not any_run.intersects(zenoh.KeyExpr(Keys("mine").of("tx", 1)))
