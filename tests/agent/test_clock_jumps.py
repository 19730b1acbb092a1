"""A jump of the own clock: nothing that an agent kept with a time counts after it.

The law is stronger than a list of timers: an agent whose clock has jumped does what a new agent in
its place does, but for the numbers of its beacons and what it has counted.
"""

import msgspec
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from agent.codec import decode_beacon, decode_gossip
from agent.messages import Beacon
from netem.wire.channels import LOCAL
from tests.agent.comms.builders import beacon, gossip, record
from tests.agent.test_core import TICK_S, agent, deliver, observation

PERIOD_TICKS = 10
"""Of the multihop channel."""
JUMPS_S = [-3.0, -0.2, 0.2, 3.0, 100.0]


def flown_among_others(core, ticks):
    """Let an agent fly among three others from 200 s on; return the next tick."""
    for tick in range(ticks):
        now_s = 200.0 + tick * TICK_S
        for other in (1, 2, 3):
            said = beacon(other, tick + 1, now_s, at=(other, 1.0, 0.0), queue=other, rank=0)
            deliver(core, said, now_s)
        if tick % PERIOD_TICKS == 0:
            deliver(core, gossip(1, now_s, [record(7, tick + 1, now_s, queue=0, rank=2)]), now_s)
        core.step(observation(tick, start_s=200.0))
    return ticks


def said(outbox):
    """Return what an agent says and commands, without its counts."""
    frames = []
    for channel, payload in outbox.frames:
        message = decode_beacon(payload) if channel == LOCAL else decode_gossip(payload)
        if isinstance(message, Beacon):
            message = msgspec.structs.replace(message, sequence=0)
        else:
            records = [msgspec.structs.replace(each, version=0) for each in message.records]
            message = msgspec.structs.replace(message, records=tuple(records))
        frames.append(message)
    telemetry = msgspec.structs.replace(outbox.command.telemetry, rejected=())
    return frames, msgspec.structs.replace(outbox.command, telemetry=telemetry)


@pytest.mark.parametrize("allocation", ["structure", "assignment"])
@settings(derandomize=True, deadline=None, max_examples=25)
@given(jump_s=st.floats(-150, 150).filter(lambda s: abs(s) > 0.11), ticks=st.integers(5, 60))
@example(jump_s=-3.0, ticks=60)
@example(jump_s=3.0, ticks=60)
def test_after_a_jump_an_agent_does_what_a_new_one_does(allocation, jump_s, ticks):
    core, new = agent(allocation=allocation), agent(allocation=allocation)
    first = flown_among_others(core, ticks)
    for tick in range(first, first + 30):
        seen = observation(tick, start_s=200.0 + jump_s)
        assert said(core.step(seen)) == said(new.step(seen))
        for other in (1, 2):
            heard = beacon(other, 1000 + tick, seen.time_s, at=(other, 1.0, 0.0))
            for each in (core, new):
                deliver(each, heard, seen.time_s)


@pytest.mark.parametrize("jump_s", JUMPS_S)
def test_an_agent_speaks_at_its_rates_on_both_sides_of_a_jump(jump_s):
    core = agent()
    first = flown_among_others(core, 40)
    for tick in range(first, first + 40):
        frames, _ = said(core.step(observation(tick, start_s=200.0 + jump_s)))
        beacons = [each for each in frames if isinstance(each, Beacon)]
        assert [each.stamp_s for each in beacons] == [200.0 + jump_s + tick * TICK_S]


@pytest.mark.parametrize("jump_s", [-0.1, -0.06, 0.06, 0.1])
def test_a_jump_within_two_ticks_costs_no_knowledge(jump_s):
    core = agent()
    first = flown_among_others(core, 40)
    outbox = core.step(observation(first, start_s=200.0 + jump_s))
    assert outbox.command.telemetry.heard == (1, 2, 3)


def test_the_numbers_of_beacons_go_on_and_the_mission_stays():
    core = agent()
    first = flown_among_others(core, 40)
    before = decode_beacon(core.step(observation(first, start_s=200.0)).frames[0][1])
    after = decode_beacon(core.step(observation(first + 1, start_s=197.0)).frames[0][1])
    assert (after.sequence, after.mission) == (before.sequence + 1, before.mission)


def test_an_agent_whose_clock_is_behind_all_others_stands_still_and_says_nothing():
    core = agent()
    first = flown_among_others(core, 40)
    for tick in range(first, first + 60):
        true_s = 200.0 + tick * TICK_S
        for other in (1, 2, 3):
            deliver(core, beacon(other, 1000 + tick, true_s, at=(other, 1.0, 0.0)), true_s - 3.0)
        outbox = core.step(observation(tick, start_s=197.0))
        if tick > first + 1:
            assert outbox.frames == ()
            assert outbox.command.velocity == (0.0, 0.0, 0.0)
    assert core.rejected["future"] == 3 * 60


def test_an_old_frame_of_the_slow_channel_is_rejected_by_its_age():
    core = agent()
    deliver(core, gossip(2, 10.0, [record(2, 1, 10.0)]), 15.1)
    assert core.rejected == {"old": 1}
