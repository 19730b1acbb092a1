"""The slow layer: what goes out sooner than in its turn."""

from agent.controller import Link
from agent.messages import LeaderSummary, RootKey
from agent.structure.census import Census
from agent.structure.convergecast import own_part
from agent.structure.link_timing import Timing
from agent.structure.slow_layer import SlowLayer
from agent.structure.tree import Tree
from tests.agent.structure.builders import BEACON_S, LINE

TIMING = Timing(Link(0.0, 0.0, 5.0), BEACON_S)
ROUND_S = 0.5
ROOT = RootKey(0, 7)


def leader_summary(version, *, counts=(3,), highest=(3,), go=True):
    return LeaderSummary(
        root=ROOT,
        version=version,
        total=4,
        counts=counts,
        highest=highest,
        histogram=b"",
        go=go,
        order=0,
        orders=(),
        blocked=(),
    )


def layer(summary):
    """Return a layer that has sent all that it has to say."""
    made = SlowLayer(0, 1, LINE, Census(0, 10), ROUND_S)
    made.publish(0, summary)
    collect(made, 3)
    for k in range(10):
        sent(made, 10.0 + k)
    return made


def collect(made, number):
    made.collect(0, own_part((0,), 0, number, 1.0, ()), (), 10.0, TIMING)


def sent(made, now_s):
    return made.due([Tree(0, now_s)], TIMING, now_s) is not None


def goes_out_soon(made):
    """Whether a summary goes out before its turn."""
    return sent(made, 19.0 + 0.2 * ROUND_S)


def test_a_summary_without_news_waits_for_its_turn():
    made = layer(leader_summary(1))
    made.publish(0, leader_summary(2))
    collect(made, 2)
    assert not goes_out_soon(made)
    assert sent(made, 19.0 + ROUND_S)


def test_a_number_above_the_count_goes_up_at_once():
    made = layer(leader_summary(1))
    collect(made, 4)
    assert goes_out_soon(made)


def test_a_gap_goes_down_at_once_and_so_does_its_end():
    made = layer(leader_summary(1))
    made.publish(0, leader_summary(2, highest=(4,)))
    assert goes_out_soon(made)
    closed = layer(leader_summary(1, highest=(4,)))
    closed.publish(0, leader_summary(2))
    assert goes_out_soon(closed)


def test_before_the_leader_says_go_no_number_is_a_gap():
    made = layer(leader_summary(1, go=False))
    collect(made, 4)
    assert not goes_out_soon(made)
