"""Links under wrong clocks: the judge knows what agents accept of each other."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.agent.comms.builders import beacon, gossip
from tests.agent.test_core import TICK_S, agent, deliver
from worldsim.judge.clock_links import ClockLinks
from worldsim.judge.run_events import ClockChanged

SLACK_S = 2.0 * TICK_S
ALL = ~np.eye(4, dtype=np.bool_)
offsets = st.one_of(st.just(0.0), st.sampled_from([0.05, -0.05, 3.0, -3.0]), st.floats(-7, 7))


def links_of(offsets_s: list[float]) -> ClockLinks:
    links = ClockLinks(4, SLACK_S)
    for agent_id, offset_s in enumerate(offsets_s):
        event = ClockChanged(
            t_s=100.0, agent=agent_id, planned=True, number=agent_id, offset_s=offset_s
        )
        links.handle_event(event)
    return links


def accepted(sender_s: float, receiver_s: float, delay_s: float) -> bool:
    """Return whether a real agent takes a beacon and a frame of the slow channel."""
    core = agent(1)
    for message in (beacon(0, 1, 100.0 + sender_s), gossip(0, 100.0 + sender_s)):
        deliver(core, message, 100.0 + receiver_s + delay_s)
    assert core.rejected.total() in (0, 2)
    return core.rejected.total() == 0


@settings(derandomize=True, deadline=None, max_examples=200)
@given(offsets, offsets, st.floats(0, 0.5), st.floats(0, 1))
def test_what_passes_is_what_an_agent_accepts(sender_s, receiver_s, longest_s, share):
    links = links_of([sender_s, receiver_s])
    only = np.zeros((4, 4), dtype=np.bool_)
    only[0, 1] = True
    passes = links.passing(only, 100.0, longest_s)[0, 1]
    if sender_s == receiver_s or not links.unclear:
        assert passes == accepted(sender_s, receiver_s, share * longest_s)


def test_an_agent_behind_all_others_says_nothing_and_one_ahead_hears_only() -> None:
    behind = links_of([-3.0]).passing(ALL, 100.0, 0.1)
    assert not behind[0].any()
    assert not behind[1:, 0].any()
    ahead = links_of([3.0]).passing(ALL, 100.0, 0.1)
    assert not ahead[0, 1:].any()
    assert ahead[1:, 0].all()
    for found in (behind, ahead):
        assert found[1:, 1:].all()


def test_two_clocks_that_are_wrong_alike_hear_each_other() -> None:
    passes = links_of([30.0, 30.0]).passing(ALL, 100.0, 0.1)
    assert passes[0, 1]
    assert passes[1, 0]
    assert not passes[:2, 2:].any()
    assert not passes[2:, :2].any()


def test_a_drift_cuts_a_link_when_it_has_grown_beyond_the_slack() -> None:
    links = ClockLinks(4, SLACK_S)
    event = ClockChanged(t_s=100.0, agent=0, planned=True, number=0, drift_ppm=10_000.0)
    links.handle_event(event)
    assert links.passing(ALL, 109.0, 0.1)[0, 1:].all()
    assert not links.unclear
    assert links.passing(ALL, 115.0, 0.1)[0, 1:].all()
    assert links.unclear
    assert not links.passing(ALL, 121.0, 0.1)[0, 1:].any()
    assert not links.unclear
