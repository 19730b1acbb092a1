"""Summaries fit their frames, whatever they hold; what has no room comes later, not never."""

from itertools import pairwise
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.codec import CHECKSUM_B, add_checksum, decode_gossip, encode
from agent.comms.gossip import MAX_FRAME_B
from agent.controller import HeardSummary, Link
from agent.messages import (
    AGENT_IDS,
    MAX_CANDIDATES,
    MAX_ORDERS,
    MAX_PLACES,
    MAX_TEAM,
    MAX_VERTICES,
    Candidate,
    Gossip,
    Line,
    Lines,
    Order,
    Place,
    RootKey,
    Summary,
    TreeReport,
)
from agent.qstructure.formation import Formation, FormationSpec, QueueSpec
from agent.qstructure.shape import Ray
from agent.structure.census import NEWS, Census
from agent.structure.convergecast import ROUNDS
from agent.structure.gathering import MOST_S
from agent.structure.label_code import FIRST_QUEUE
from agent.structure.link_timing import Timing
from agent.structure.queue_map import QueueMap
from agent.structure.slow_layer import VERTICES_A_ROUND, SlowLayer
from agent.structure.summary_frame import SUMMARY_HEAD_B, ReportTurns
from agent.structure.tree import Tree, version_at
from netem.wire.channels import MAX_PAYLOAD_B
from tests.agent.structure.builders import (
    BEACON_S,
    gathering,
    leader_summary,
    rays,
    replace,
    subtree,
)
from tests.agent.structure.team import Team

GREATEST = 2**53 - 1
LAST_ID = AGENT_IDS - 1
FARTHEST = tuple(Place(2**15 - 1, 2**15 - 1 - k) for k in reversed(range(MAX_PLACES)))
MOST_QUEUES = 64
ROUND_S, START_S = 0.5, 1002.0
CLEAN = Timing(Link(0.0, 0.0, 100.0), BEACON_S)


def greatest(queues, vertex=0, candidates=MAX_CANDIDATES):
    """Return a report of the longest numbers on a vertex at which so many queues begin."""
    offered = [Candidate(2**31 - 1, LAST_ID - k, 2**15 - 2 + k % 2) for k in range(candidates)]
    down = leader_summary(
        root=RootKey(2**31 - 1, LAST_ID),
        version=GREATEST,
        total=MAX_TEAM,
        counts=(MAX_TEAM,) * queues,
        highest=(MAX_TEAM,) * queues,
        histogram=b"\xff" * 16,
        order=GREATEST,
        orders=(Order(LAST_ID, 2**15 - 1, 2**15 - 1),) * MAX_ORDERS,
        blocked=FARTHEST,
    )
    up = subtree(
        highest=(MAX_TEAM,) * queues,
        histogram=b"\xff" * 16,
        candidates=(tuple(sorted(offered)),) * queues,
        blocked=FARTHEST,
    )
    return TreeReport(vertex, 2**15 - 1, LAST_ID, down, up)


def fans(vertices, queues):
    """Return a map of so many vertices, with so many queues at each."""
    specs = tuple(
        QueueSpec(f"Q{v}-{j}", (f"V{v}",), Ray((-1.0, 0.01 * j, 0.0)), 1.0 / vertices / queues)
        for v in range(vertices)
        for j in range(queues)
    )
    points = {f"V{v}": (0.0, 3.0 * v, 0.0) for v in range(vertices)}
    return QueueMap(Formation(FormationSpec("fans", points, specs), 1.0))


def layer(report, vertices, members, changed, gathering=None):
    """Return the slow layer of an agent that has so much to say. changed: members with news."""
    census = Census(0, MAX_TEAM + 1)
    for member in range(members):
        census.hear(member, 1000.0, FIRST_QUEUE)
    while census.has_news:
        census.news(1000.0)
    for member in range(members - changed, members):
        census.hear(member, 1001.0, FIRST_QUEUE + 1)
    formation = fans(vertices, len(report.up.highest))
    made = SlowLayer(LAST_ID, GREATEST, formation, census, ROUND_S, gathering=gathering)
    for v in range(vertices):
        made.publish(v, report.down)
        made.collect(v, report.up, (), START_S, CLEAN)
    return made


def trees(report, vertices):
    found = [Tree(LAST_ID, 0.0) for _ in range(vertices)]
    for tree in found:
        tree.root, tree.tier, tree.parent = report.down.root, report.tier, report.parent
    return found


def timed(report, vertices, members, changed, seconds, gathering=None):
    """Return the summaries of an agent in so many seconds, with the time of each [s]."""
    slow = layer(report, vertices, members, changed, gathering)
    known = trees(report, vertices)
    times = [START_S + BEACON_S * tick for tick in range(round(seconds / BEACON_S))]
    due = [(now_s, slow.due(known, CLEAN, now_s)) for now_s in times]
    return [(now_s, summary) for now_s, summary in due if summary is not None]


def said(*case):
    return [summary for _, summary in timed(*case)]


def frame_b(summary):
    return len(add_checksum(encode(Gossip(LAST_ID, 1e9, (), None, summary))))


def test_the_head_of_a_summary_is_as_long_as_stated():
    empty = Summary(GREATEST, LAST_ID, bytes(512), ((0, 0),) * 48, (greatest(1),) * 16)
    length_b = sum(len(encode(each)) for each in empty.trees) + 3 * 48 + 512
    assert len(encode(empty)) - length_b == SUMMARY_HEAD_B


@pytest.mark.parametrize(
    ("queues", "vertices", "members"),
    [(1, 6, 60), (10, 1, 60), (4, 1, 200), (1, 16, 1024), (4, 16, 300), (MOST_QUEUES, 1, 1024)],
)
def test_the_greatest_summaries_fit_and_everything_is_said(queues, vertices, members):
    report = greatest(queues)
    found = said(report, vertices, members, min(members, 100), 12.0)
    assert max(map(frame_b, found)) <= MAX_PAYLOAD_B
    parts = [each for summary in found for each in summary.trees]
    assert {each.vertex for each in parts if each.down == report.down} == {*range(vertices)}
    ups = [each for each in parts if each.up is not None]
    assert {each.vertex for each in ups} == {*range(vertices)}
    assert all(len(each.up.candidates) == queues and all(each.up.candidates) for each in ups)
    told = [member for summary in found for member, _ in summary.news]
    assert sorted(told) == list(range(members - min(members, 100), members))
    runs = [range(each.first, each.first + len(each.labels) // 2) for each in found]
    assert {member for run in runs for member in run} == set(range(members))


@pytest.mark.parametrize(("queues", "vertices"), [(1, 1), (1, 6), (1, 16), (4, 16), (10, 1)])
def test_each_vertex_has_its_turn_before_a_report_expires(queues, vertices):
    found = timed(greatest(queues), vertices, 100, 0, 12.0)
    for v in range(vertices):
        turns = [s for s, each in found if any(part.vertex == v and part.up for part in each.trees)]
        held_s = ROUNDS * ROUND_S * max(1.0, vertices / VERTICES_A_ROUND)
        assert max(b - a for a, b in pairwise(turns)) <= held_s


reports = st.builds(
    greatest,
    queues=st.integers(1, 12),
    vertex=st.integers(0, MAX_VERTICES - 1),
    candidates=st.integers(0, MAX_CANDIDATES),
)


@settings(derandomize=True)
@given(st.lists(reports, max_size=MAX_VERTICES, unique_by=lambda each: each.vertex), st.data())
def test_reports_take_turns_and_leave_room(known, data):
    turns, sent = ReportTurns(), []
    for _ in range(2 * MAX_VERTICES):
        waiting_b = data.draw(st.sampled_from([0, 300, 1000]))
        taken = turns.take(known, waiting_b)
        assert len(taken) <= MAX_VERTICES
        assert sum(len(encode(each)) for each in taken) <= MAX_FRAME_B - 40
        sent += taken
        if not turns.has_rest:
            break
    assert {each.vertex for each in sent if each.down} == {each.vertex for each in known}
    assert {each.vertex for each in sent if each.up} == {each.vertex for each in known}
    assert len({(each.vertex, each.down is None) for each in sent}) == len(sent)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.integers(1, 16), st.integers(1, 1024), st.integers(0, 300), reports)
def test_summaries_of_any_agent_fit_their_frames(vertices, members, changed, report):
    for summary in said(report, vertices, members, min(changed, members), 3.0):
        assert frame_b(summary) <= MAX_PAYLOAD_B
        assert len(summary.news) <= NEWS
        payload = add_checksum(encode(Gossip(LAST_ID, 1e9, (), None, summary)))
        assert decode_gossip(payload).summary == summary


@pytest.mark.parametrize(("queues", "vertices"), [(1, 3), (4, 3), (10, 1), (MOST_QUEUES, 1)])
def test_what_is_said_of_lines_fits_beside_the_rest_and_each_line_is_said(queues, vertices):
    report = greatest(queues)
    gathers, longest = gathering(fans(vertices, queues)), 2**31 - 1
    arrives = version_at(START_S + MOST_S)
    every = [
        Line(j, version_at(START_S), longest, longest, longest, arrives, arrives)
        for j in range(queues * vertices)
    ]
    for line in every:
        gathers.hear(1, Lines((line,), ()), START_S, START_S)
    found = [said for _, said in timed(report, vertices, 300, 100, 30.0, gathers)]
    assert max(map(frame_b, found)) <= MAX_PAYLOAD_B
    assert {line for each in found if each.lines for line in each.lines.lines} == {*every}
    parts = [each for summary in found for each in summary.trees]
    assert {each.vertex for each in parts if each.down == report.down} == {*range(vertices)}
    assert {each.vertex for each in parts if each.up} == {*range(vertices)}
    assert {each for summary in found for each, _ in summary.news} == {*range(200, 300)}
    runs = [range(each.first, each.first + len(each.labels) // 2) for each in found]
    assert {member for run in runs for member in run} == {*range(300)}


def test_summaries_of_an_uneven_team_fit_their_frames():
    """Uneven teams at one vertex of ten queues: many candidates, orders and news at once."""
    random = Random(0)
    fan = rays(*((-1.0, -2.0 + 0.4 * j, 0.0) for j in range(10)))
    points = [(random.uniform(-9, -1), random.uniform(2, 9), 0.0) for _ in range(24)]
    flown, longest_b = Team(fan, points, 0, loss=0.3, range_m=8.0), 0
    for _ in range(60):
        flown.step()
        words = [member.words.summary for member in flown.members.values()]
        longest_b = max([longest_b, *(frame_b(each) for each in words if each is not None)])
    assert CHECKSUM_B < longest_b <= MAX_PAYLOAD_B


def test_a_summary_in_parts_tells_the_same_as_a_whole_one():
    """The receiver takes what comes down and what goes up from different frames."""
    report = greatest(MOST_QUEUES)
    counts, version = (MAX_TEAM // MOST_QUEUES,) * MOST_QUEUES, version_at(START_S)
    down = replace(report.down, version=version, order=version, counts=counts)
    report = replace(report, down=down)
    sender = layer(report, 1, 10, 0)
    hearer = SlowLayer(LAST_ID, GREATEST, fans(1, MOST_QUEUES), Census(1, MAX_TEAM), ROUND_S)
    known = trees(report, 1)
    own = trees(replace(report, parent=-1), 1)
    known[0].tier -= 1
    for tick in range(40):
        now_s = START_S + BEACON_S * tick
        summary = sender.due(known, CLEAN, now_s)
        if summary is not None:
            hearer.hear([HeardSummary(7, now_s, summary)], own, now_s)
    assert hearer.summaries == [report.down]
    found = hearer.collect(0, None, (), START_S + 2.0, CLEAN)
    assert found.highest == report.up.highest
    assert len(found.candidates) == MOST_QUEUES
    assert all(found.candidates)
