"""Gossip: merging is a maximum, departed agents stay away, and every frame has its limit."""

from itertools import permutations
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.codec import decode_gossip, encode
from agent.comms.gossip import FRAME_HEAD_B, RecordTable
from agent.messages import MAX_TEAM, Place
from netem.wire.channels import MAX_PAYLOAD_B
from netem.wire.frame import MAX_OUTGOING
from tests.agent.comms.builders import (
    LATE_S,
    gossip,
    greatest_record,
    heard_beacon,
    peer,
    record,
)

OWN = 0
SLACK_S = 0.1
ROUND_S = 0.5
RELAYED_SILENCE_S = 6.0
"""12 rounds at 2 Hz, for a subject whose records arrive at once."""
OLDEST_S = 2.0 * RELAYED_SILENCE_S

numbers = st.tuples(st.integers(1, 4), st.integers(0, 2), st.integers(0, 5))
gossips = st.lists(numbers, max_size=6)


def table(own=OWN):
    return RecordTable(own, 1.0 / ROUND_S)


def adopted(known, *records, now_s=1.0):
    known.adopt(gossip(9, 1.0, records), now_s, SLACK_S)
    return known


def content(known, now_s=1.0):
    """Return what a table passes on, without the own record, by subject."""
    payloads = known.frames(now_s, record(OWN, 1, now_s))
    records = [each for payload in payloads for each in decode_gossip(payload).records]
    assert records[0].id == OWN
    return {each.id: each for each in records[1:]}


def merged(sequence):
    """Return the content of a table after lists of (subject, incarnation, version) in turn."""
    known = table()
    for frame in sequence:
        adopted(known, *(record(subject, v, 1.0, incarnation=i) for subject, i, v in frame))
    return content(known)


@settings(derandomize=True, deadline=None)
@given(st.lists(gossips, max_size=4))
def test_merging_is_the_maximum_of_incarnation_and_version(sequence):
    newest = {}
    for subject, incarnation, version in (each for frame in sequence for each in frame):
        newest[subject] = max(newest.get(subject, (-1, -1)), (incarnation, version))
    found = {key: (each.incarnation, each.version) for key, each in merged(sequence).items()}
    assert found == newest


@settings(derandomize=True, deadline=None)
@given(st.lists(gossips, max_size=4))
def test_merging_twice_changes_nothing(sequence):
    assert merged(sequence) == merged([*sequence, *sequence])


@settings(derandomize=True, deadline=None)
@given(st.lists(gossips, max_size=4))
def test_the_order_of_merging_does_not_matter(sequence):
    results = [merged(each) for each in permutations(sequence)]
    assert all(each == results[0] for each in results)


def test_a_version_never_decreases():
    random, known, last = Random(2), table(), {}
    for _ in range(3000):
        index, incarnation, version = (random.randrange(n) for n in (5, 3, 50))
        adopted(known, record(index + 1, version, 1.0, incarnation=incarnation))
        for subject, each in content(known).items():
            now = (each.incarnation, each.version)
            assert now >= last.get(subject, (-1, -1))
            last[subject] = now


def test_an_agent_ignores_records_about_itself():
    known = adopted(table(), record(OWN, 99, incarnation=5, at=(9.0, 9.0, 9.0)))
    assert known.team(peer(OWN)) == (peer(OWN),)


@pytest.mark.parametrize(
    ("stamp_s", "taken"),
    [
        (100.0 + SLACK_S - 1e-6, True),
        (100.0 + SLACK_S + 1e-6, False),
        (1e9, False),
        (100.0 - OLDEST_S + 1e-6, True),
        (100.0 - OLDEST_S - 1e-6, False),
        (0.0, False),
    ],
)
def test_a_record_with_a_future_or_too_old_stamp_is_not_adopted(stamp_s, taken):
    known = adopted(table(), record(3, 1, stamp_s), now_s=100.0)
    assert (3 in content(known)) is taken


def test_a_rejected_record_does_not_block_a_later_one():
    known = adopted(table(), record(3, 2**53 - 1, 500.0), now_s=100.0)
    adopted(known, record(3, 5, 100.0), now_s=100.0)
    assert content(known)[3].version == 5


def test_a_beacon_counts_as_a_record():
    known = table()
    known.adopt_beacon(heard_beacon(3, 7, 1.0, at=(1.0, 2.0, 3.0)))
    assert content(known)[3] == record(3, 7, 1.0, at=(1.0, 2.0, 3.0))
    adopted(known, record(3, 6, 0.9))
    assert content(known)[3].version == 7
    adopted(known, record(3, 8, 1.1))
    assert content(known)[3].version == 8


def test_the_team_is_all_known_members_in_order_of_ids():
    known = adopted(
        table(own=4), record(7, 1, queue=1, rank=2), record(2, 1, at=(1.0, 0.0, 0.0), queue=0)
    )
    known.adopt_beacon(heard_beacon(5, 1, 1.0))
    team = known.team(peer(4))
    assert [each.id for each in team] == [2, 4, 5, 7]
    assert team[0].position == (1.0, 0.0, 0.0)
    assert team[2].place is None
    assert team[3].place == Place(1, 2)


def test_a_neighbour_that_fell_silent_is_dropped():
    known = table()
    known.adopt_beacon(heard_beacon(3, 7, 10.0))
    known.forget_silent(20.0, {3})
    assert 3 in content(known), "a neighbour's silence is judged by Neighbours"
    known.forget_silent(20.0, {4})
    assert content(known) == {}


def test_a_lost_neighbour_is_dropped_unless_a_later_record_is_relayed():
    known = adopted(table(), record(3, 7, 10.0), record(4, 7, 10.5), now_s=11.0)
    departed = known.forget_silent(12.0, (), {3: 10.2, 4: 10.2})
    assert set(content(known)) == {4}
    assert [gone.stamp_s for gone in departed] == [10.0]


def test_a_subject_known_by_relay_may_be_silent_for_as_long_as_relays_take():
    known = adopted(table(), record(3, 7, 10.0), now_s=10.0)
    known.forget_silent(10.0 + RELAYED_SILENCE_S - 0.01, ())
    assert 3 in content(known)
    known.forget_silent(10.0 + RELAYED_SILENCE_S + 0.01, ())
    assert content(known) == {}


def test_old_records_do_not_bring_back_a_departed_agent():
    known = table()
    known.adopt_beacon(heard_beacon(3, 7, 10.0))
    known.forget_silent(12.0, ())
    for version in (1, 6, 7):
        adopted(known, record(3, version, 10.0), now_s=12.0)
    assert content(known) == {}
    adopted(known, record(3, 8, 11.9), now_s=12.0)
    assert 3 in content(known), "a newer record brings it back"


def test_a_team_that_relays_records_forgets_a_departed_agent():
    """All relay to all, with loss: after the relayed silence no agent knows the departed one."""
    random, team = Random(11), [table(own) for own in range(1, 8)]
    team[0].adopt_beacon(heard_beacon(99, 500, 0.0))
    for index in range(1, 60):
        now_s = index * ROUND_S
        for own, known in enumerate(team, start=1):
            known.forget_silent(now_s, range(1, 8))
            for payload in known.frames(now_s, record(own, index, now_s)):
                for other in team:
                    if other is not known and random.random() < 0.5:
                        other.adopt(decode_gossip(payload), now_s, SLACK_S)
        knowing = sum(99 in content(known) for known in team)
        assert knowing == 0 or now_s <= OLDEST_S
    newcomer = table(own=50)
    for own, known in enumerate(team, start=1):
        for payload in known.frames(30.0, record(own, 99, 30.0)):
            newcomer.adopt(decode_gossip(payload), 30.0, SLACK_S)
    assert [each.id for each in newcomer.team(peer(50))] == [*range(1, 8), 50]


def test_the_head_has_its_longest_encoding():
    many = (record(1, 1),) * 20
    whole = len(encode(gossip(2**16 - 1, LATE_S, many)))
    assert whole == FRAME_HEAD_B + 20 * len(encode(record(1, 1)))


@pytest.mark.parametrize("known", [0, 1, 17, 18, 19, 200, MAX_TEAM])
def test_the_whole_table_fits_with_the_greatest_numbers(known):
    records = [greatest_record(2**16 - 1 - k) for k in range(known)]
    full = adopted(table(), *records, now_s=LATE_S)
    payloads = full.frames(LATE_S, greatest_record(OWN))
    assert max(map(len, payloads)) <= MAX_PAYLOAD_B
    assert len(payloads) < MAX_OUTGOING
    sent = [each for payload in payloads for each in decode_gossip(payload).records]
    assert sent == [greatest_record(OWN), *reversed(records)]


def test_a_table_has_a_greatest_size():
    known = table()
    for first in range(1, 4000, 16):
        adopted(known, *(record(subject, 1, 1.0) for subject in range(first, first + 16)))
    assert len(content(known)) == MAX_TEAM
    adopted(known, record(1, 2, 1.0))
    assert content(known)[1].version == 2, "a known subject is still updated"
    known.forget_silent(60.0, ())
    assert len(content(adopted(known, record(5000, 1, 60.0), now_s=60.0))) == 1


def play_line(line, rounds, loss, seed=3):
    """Pass tables along a line of agents that hear only their neighbours in it.

    Yields after each round the size of the team that each agent knows.
    """
    random, end = Random(seed), len(line) - 1
    for index in range(1, rounds + 1):
        now_s = index * ROUND_S
        for known in line:
            known.forget_silent(now_s, ())
        sent = [known.frames(now_s, record(own, index, now_s)) for own, known in enumerate(line)]
        for own, payloads in enumerate(sent):
            for neighbour in sorted({max(own - 1, 0), min(own + 1, end)} - {own}):
                if random.random() >= loss:
                    for payload in payloads:
                        line[neighbour].adopt(decode_gossip(payload), now_s, SLACK_S)
        yield [len(known.team(peer(own))) for own, known in enumerate(line)]


@pytest.mark.parametrize("agents", [2, 9, 20])
def test_a_record_travels_one_hop_a_round(agents):
    line = [table(own) for own in range(agents)]
    for index, teams in enumerate(play_line(line, agents - 1, 0.0), start=1):
        assert teams[0] == teams[-1] == index + 1
    assert teams == [agents] * agents


@pytest.mark.parametrize(
    ("agents", "loss", "missing"),
    [(20, 0.0, 0.0), (9, 0.2, 0.0), (20, 0.2, 0.0), (3, 0.5, 1e-3), (5, 0.5, 1e-3), (9, 0.5, 1e-2)],
)
def test_the_far_end_stays_known_with_old_records(agents, loss, missing):
    """T_d = (2 D + 10) / (1 - loss) rounds: a distant agent does not count as departed."""
    line = [table(own) for own in range(agents)]
    teams = list(play_line(line, 300, loss))[80:]
    known = sum(map(sum, teams)) / (len(teams) * agents * agents)
    assert 1.0 - known <= missing


def test_the_far_end_is_dropped_when_it_is_gone():
    line = [table(own) for own in range(9)]
    assert list(play_line(line, 30, 0.0))[-1] == [9] * 9
    for known in line:
        known.forget_silent(15.0 + RELAYED_SILENCE_S + 2.0 * 8 * ROUND_S, ())
    assert [len(known.team(peer(own))) for own, known in enumerate(line)] == [1] * 9
