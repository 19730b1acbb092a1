"""One agent's part in gathering: it flies to its line and with it; a leader makes the line."""

from itertools import pairwise, permutations
from math import dist

import pytest

from agent.codec import encode
from agent.messages import MAX_TEAM, ZERO, Line, LinePart, Lines, Place, RootKey
from agent.places.place_points import OwnTarget
from agent.qstructure.orientation import Attitude
from agent.qstructure.target_frame import Frame
from agent.structure.claim import Claim
from agent.structure.gathering import GATHER_S, GATHERED_M, HEAD_B, LONGEST_S, MOST_B, MOST_S
from agent.structure.line import displacement_of
from agent.structure.tree import VERSIONS_PER_S, Tree, version_at
from tests.agent.structure.builders import LINE, gathering, leader_summary, lines, rays, view

THREE = lines((0.0, -1.5, 0.0), ZERO, (0.0, 1.5, 0.0))
AWAY = (-8.0, 0.0, 0.0)
LEADER = RootKey(0, 9)
PLACE = Place(0, 2)


def tree(now_s=0.0, follows=True):
    made = Tree(1, now_s)
    made.root, made.tier, made.parent = (LEADER, 1, 9) if follows else (None, -1, -1)
    return made


def member(number=2, queue=0):
    claim = Claim(0.0)
    claim.take(queue, number, 0.0, 0.0)
    return claim


def said(*known, parts=()):
    return Lines(tuple(known), tuple(parts))


def line(way=AWAY, version=100, leaves_s=20.0, arrives_s=40.0, queue=0):
    cm = [round(100.0 * x) for x in way]
    return Line(queue, version, *cm, version_at(leaves_s), version_at(arrives_s))


def target(found, at, now_s=2.0, claim=None, follows=True):
    """Return where the agent flies from a point, once it has decided."""
    claim = claim or member()
    slot = LINE.slot(claim.queue, claim.number, claim.number)
    found.update(view(LINE, now_s, at=at), claim, [tree(now_s, follows)], 0.0)
    return found.displaced(OwnTarget(PLACE, slot, False), claim, now_s).slot.point


SLOT = (-2.0, 0.0, 0.0)
GATHERED = (-10.0, 0.0, 0.0)
NEAR = (-9.0, 2.0, 0.0)


def test_who_hears_of_no_line_flies_straight():
    assert target(gathering(), NEAR) == SLOT


def test_who_hears_of_a_line_flies_to_its_place_there_and_with_it():
    found = gathering()
    found.hear(9, said(line()), 1.0, 2.0)
    assert target(found, NEAR) == GATHERED
    for now_s in (25.0, 30.0, 35.0):
        flown = target(found, GATHERED, now_s)
        assert flown == tuple(
            a + b for a, b in zip(SLOT, displacement_of(line(), now_s), strict=True)
        )
    assert target(found, GATHERED, 40.0) == SLOT


def test_the_attitude_of_a_slot_is_free_until_the_line_arrives():
    found = gathering()
    found.hear(9, said(line()), 1.0, 2.0)
    target(found, NEAR)
    own = OwnTarget(PLACE, LINE.slot(0, 2, 2)._replace(attitude=Attitude(yaw=1.0)), False)
    assert found.displaced(own, member(), 39.0).slot.attitude == Attitude()
    assert found.displaced(own, member(), 40.0) == own


@pytest.mark.parametrize("order", [*permutations(range(3))])
def test_the_latest_version_holds_in_whatever_order_versions_come(order):
    versions = [line(version=100 + k, leaves_s=20.0 - k) for k in range(3)]
    found = gathering()
    for k in order:
        found.hear(9, said(versions[k]), 1.0, 3.0)
    assert found.lines == [versions[2]]


@pytest.mark.parametrize(
    "odd",
    [
        line(version=version_at(9.0)),
        line(queue=1),
        line(leaves_s=20.0, arrives_s=19.0),
        line(ZERO, leaves_s=0.0, arrives_s=1.1 + MOST_S),
    ],
    ids=["ahead of its time", "of no queue", "arrives before it leaves", "displaced for good"],
)
def test_an_impossible_line_is_ignored(odd):
    found = gathering()
    found.hear(9, said(odd), 1.0, 2.0)
    assert target(found, NEAR) == SLOT
    assert not found.queues(2.0)


@pytest.mark.parametrize("leaves_s", [20.0, 1.0], ids=["it waits", "it flies"])
def test_nobody_flies_to_a_line_that_is_farther_than_its_slot(leaves_s):
    found = gathering()
    found.hear(9, said(line()), 1.0, 2.0)
    assert target(found, NEAR) == GATHERED
    far = line((900.0, 0.0, 0.0), version=101, leaves_s=leaves_s, arrives_s=MOST_S)
    found.hear(9, said(far), 1.0, 2.0)
    assert target(found, NEAR, 2.1) == SLOT


def test_nobody_is_held_by_a_line_that_never_leaves():
    found = gathering()
    for second in range(200):
        now_s = 2.0 + second
        newest = line(version=version_at(now_s), leaves_s=now_s + 50.0, arrives_s=now_s + 90.0)
        found.hear(9, said(newest), now_s, now_s)
        if target(found, GATHERED, now_s) == SLOT:
            break
    assert LONGEST_S < now_s < LONGEST_S + 6.0 * 8.0 / 0.5 + 4.0


@pytest.mark.parametrize(
    ("at", "now_s", "options"),
    [
        (NEAR, 2.0, {"follows": False}),
        ((-2.1, 0.1, 0.0), 2.0, {}),
        (NEAR, 21.0, {}),
    ],
    ids=["in distress", "in its slot", "late"],
)
def test_who_flies_straight_goes_on_to_do_so(at, now_s, options):
    found = gathering()
    found.hear(9, said(line()), 1.0, 2.0)
    assert target(found, at, now_s, **options) == SLOT
    assert target(found, NEAR, now_s + 0.1) == SLOT


def test_a_member_that_is_ordered_to_another_queue_gathers_there_until_its_line_leaves():
    first, second = line((-8.0, 0.0, 0.0)), line((-8.0, 3.0, 0.0), leaves_s=10.0, queue=1)
    for now_s, gathers in ((5.0, True), (11.0, False)):
        found = gathering(THREE)
        found.hear(9, said(first, second), 1.0, 2.0)
        trees = [tree(), tree(), tree()]
        found.update(view(THREE, 2.0, at=NEAR), member(2, 0), trees, 0.0)
        found.update(view(THREE, now_s, at=NEAR), member(1, 1), trees, 0.0)
        own = OwnTarget(Place(1, 1), THREE.slot(1, 1, 1), False)
        moved = found.displaced(own, member(1, 1), now_s)
        assert (moved != own) == gathers


def test_a_member_reports_its_way_and_when_it_is_there():
    found = gathering()
    target(found, NEAR)
    assert found.wire(2.0, MOST_B)[0].parts == (LinePart(0, 9, 1, 0, -700, 200, 0),)
    found.hear(9, said(line()), 1.0, 2.0)
    target(found, (-10.0, 0.0, GATHERED_M - 0.01), 3.0)
    (part,) = found.wire(3.0, MOST_B)[0].parts
    assert (part.members, part.ready) == (1, 1)


def test_who_flies_straight_is_not_waited_for():
    found = gathering()
    found.hear(9, said(line()), 1.0, 2.0)
    target(found, NEAR, follows=False)
    target(found, NEAR, 2.1)
    (part,) = found.wire(2.1, MOST_B)[0].parts
    assert (part.members, part.ready) == (0, 1)


def test_followers_add_up_with_the_own_part_and_their_ways_in_the_mean():
    found = gathering()
    parts = [LinePart(0, 1, 3, 1, -800, 0, 0), LinePart(0, 5, 9, 9, 0, 0, 0)]
    for sender, part in enumerate(parts, 3):
        found.hear(sender, said(parts=[part]), 2.0, 2.0)
    target(found, (-6.0, 4.0, 0.0))
    assert found.wire(2.0, MOST_B)[0].parts == (LinePart(0, 9, 4, 1, -700, 100, 0),)


def test_nothing_is_said_once_the_line_has_arrived():
    found = gathering()
    found.hear(9, said(line()), 1.0, 2.0)
    target(found, GATHERED)
    assert found.wire(39.9, MOST_B) != (None, 0)
    target(found, SLOT, 40.0)
    assert found.wire(40.0, MOST_B) == (None, 0)


@pytest.mark.parametrize("room_b", [90, 200, 1000])
def test_what_is_said_fits_and_each_queue_has_its_turn(room_b):
    fan = rays(*((-1.0, 0.05 * j, 0.0) for j in range(20)))
    found, longest, now_s = gathering(fan), 2**31 - 1, 2**32 / VERSIONS_PER_S - MOST_S
    for j in range(20):
        latest = 2**32 - 1
        early = latest - round(MOST_S * VERSIONS_PER_S)
        greatest = Line(j, early, longest, longest, longest, latest, latest)
        part = LinePart(j, 1, MAX_TEAM, MAX_TEAM, longest, longest, longest)
        found.hear(3, said(greatest, parts=[part]), now_s, now_s)
    found.update(view(fan, now_s), Claim(0.0), [tree()], 0.0)
    told = set()
    for _ in range(40):
        frame, length_b = found.wire(now_s, room_b)
        assert len(encode(frame)) == length_b <= min(room_b, MOST_B)
        told |= {("line", each.queue) for each in frame.lines}
        told |= {("part", each.queue) for each in frame.parts}
    assert len(told) == 40


def test_the_head_of_lines_is_as_long_as_stated():
    entries = (line(),) * 16, (LinePart(0, 9, 1, 0, 0, 0, 0),) * 16
    bare_b = len(encode(Lines(*entries))) - sum(
        len(encode(Lines((each,), ()))) - len(encode(Lines((), ()))) for each in entries[0]
    )
    bare_b -= 16 * (len(encode(Lines((), entries[1][:1]))) - len(encode(Lines((), ()))))
    assert bare_b <= HEAD_B


def led(found, frame=Frame(), members=3, behind_m=8.0):  # noqa: B008
    """Return the line that a leader makes once its members have reported behind their slots."""
    way_cm = round(-100.0 * behind_m)
    found.hear(3, said(parts=[LinePart(0, 1, members, 0, way_cm, 0, 0)]), 2.0, 2.0)
    seen = view(LINE, 2.0)
    seen.frame = frame
    summary = leader_summary(total=members + 1, counts=(members,), highest=(0,))
    seen.summaries = [summary]
    found.update(seen, Claim(0.0), [tree()], 0.0)
    found.lead(seen, 0, summary)
    return found.lines[0]


def test_a_leader_displaces_its_queue_by_its_members_mean_way():
    made = led(gathering())
    assert (made.x, made.y, made.z) == (-800, 0, 0)
    assert made.leaves == version_at(2.0 + GATHER_S + 8.0 / 0.5)


def test_a_leader_lets_the_line_leave_once_all_are_ready_and_not_before():
    found = gathering()
    before = led(found)
    for now_s, ready in ((3.0, 2), (4.0, 3), (4.1, 2), (4.5, 3), (4.6, 3), (5.0, 3)):
        assert found.lines == [before], "not yet, or not for long enough"
        found.hear(3, said(parts=[LinePart(0, 1, 3, ready, -800, 0, 0)]), now_s, now_s)
        seen = view(LINE, now_s)
        seen.summaries = [leader_summary(total=4, counts=(3,), highest=(0,))]
        found.update(seen, Claim(0.0), [tree()], 0.0)
        found.lead(seen, 0, seen.summaries[0])
    assert found.lines[0].leaves == version_at(5.0 + seen.timing.answer_s)
    assert found.lines[0].version > before.version


@pytest.mark.parametrize(("behind_m", "gathers"), [(1.9, False), (2.5, True), (300.0, False)])
def test_a_queue_that_is_nearly_there_or_very_far_away_does_not_gather(behind_m, gathers):
    assert (led(gathering(), behind_m=behind_m) is not None) == gathers


@pytest.mark.parametrize("members", [0, 1])
def test_a_queue_of_less_than_two_members_does_not_gather(members):
    assert led(gathering(), members=members) is None


def test_a_line_in_a_moving_frame_leaves_its_members_the_speed_for_it():
    """In a frame at 0.3 m/s, 0.2 m/s are left to a vehicle of 0.5 m/s."""
    for frame, left_mps in ((Frame(), 0.5), (Frame(velocity=(0.3, 0.0, 0.0)), 0.2)):
        made = led(gathering(), frame)
        moved = [displacement_of(made, 0.1 * k) for k in range(1000)]
        fastest_mps = max(dist(a, b) / 0.1 for a, b in pairwise(moved))
        assert 0.8 * left_mps < fastest_mps < left_mps
