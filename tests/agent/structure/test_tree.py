"""The tree of a vertex: it spans who is connected, keeps still, and forgets a root that is gone."""

from collections import deque
from math import dist, inf
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.controller import Link
from agent.messages import ZERO, Branch, RootKey
from agent.structure.link_timing import Timing
from agent.structure.tree import (
    NEW_PARENT_STAYS_S,
    PARENT_STAYS_S,
    REVIVAL_S,
    Follower,
    Tree,
    version_at,
)
from tests.agent.structure.builders import BEACON_S, heard

REACH_M = 10.0
TIMING = Timing(Link(0.0, 0.0, REACH_M), BEACON_S)
LOW, HIGH = RootKey(100, 1), RootKey(200, 2)


class Team:
    """Agents with a tree each, that hear each other within REACH_M.

    Agent 0 leads from the start. loss: share of statements lost; margin: whether ranges count.
    """

    def __init__(self, points, seed=0, loss=0.0, leaders=(0,)):
        self.points, self._loss, self._random = points, loss, Random(seed)
        self.timing = Timing(Link(loss, 0.0, REACH_M), BEACON_S)
        self.trees = [Tree(own, 0.0) for own in range(len(points))]
        self.alive = set(range(len(points)))
        self.leading = {leader: RootKey(100 + leader, leader) for leader in leaders}
        for leader, key in self.leading.items():
            self.trees[leader].take_root(key, 0.0)
        self._known = [{} for _ in points]
        self.now_s = 0.0

    def step(self):
        """Let all speak and then all decide; return the agents that changed parent or tier."""
        self.now_s += BEACON_S
        before = {own: self.place(own) for own in self.alive}
        spoken = {own: self.trees[own].branch for own in self.alive}
        for own in self.alive:
            for other, branch in spoken.items():
                near = other != own and dist(self.points[own], self.points[other]) <= REACH_M
                if near and self._random.random() >= self._loss:
                    self._known[own][other] = (self.now_s, branch)
        for own in self.alive:
            self._decide(own)
        return {own for own in self.alive if self.place(own) != before[own]}

    def _decide(self, own):
        tree, lost_s = self.trees[own], self.timing.lost_s
        followers = [
            Follower(heard(other, self.points[other], age_s=self.now_s - at_s), branch)
            for other, (at_s, branch) in sorted(self._known[own].items())
            if branch is not None and self.now_s - at_s <= lost_s
        ]
        key = self.leading.get(own)
        if tree.follow_root(self.now_s, followers, key, self.timing.root_s):
            self.leading.pop(own, None)
        near = [each for each in followers if each.heard.age_s < self.timing.parent_s]
        tree.choose_parent(self.points[own], ZERO, near, REACH_M)

    def place(self, own):
        return self.trees[own].tier, self.trees[own].parent

    def run(self, seconds):
        flips = 0
        for _ in range(round(seconds / BEACON_S)):
            flips += len(self.step())
        return flips

    def hops(self, within_m, root=0):
        """Return the least number of hops of each living agent from the root, inf for none."""
        found, queue = dict.fromkeys(self.alive, inf), deque([root])
        found[root] = 0
        while queue:
            own = queue.popleft()
            for other in self.alive:
                apart_m = dist(self.points[own], self.points[other])
                if apart_m <= within_m and found[other] == inf:
                    found[other] = found[own] + 1
                    queue.append(other)
        return found


def scattered(random, agents, side_m):
    return [tuple(random.uniform(0.0, side_m) for _ in range(3)) for _ in range(agents)]


def check_spans(team, root=0):
    """Check that who is connected has the tier of the fewest hops, and a parent."""
    best = team.hops(REACH_M, root)
    for own in team.alive:
        tier, parent = team.place(own)
        if best[own] == inf:
            assert (tier, parent) == (-1, -1)
        elif own == root:
            assert (tier, parent) == (0, -1)
        else:
            assert tier == best[own]
            assert tier == team.trees[parent].tier + 1
            assert dist(team.points[own], team.points[parent]) <= REACH_M
    for own in team.alive:
        at, way = own, []
        while at not in way and at >= 0:
            way.append(at)
            at = team.trees[at].parent
        assert at == -1, "the chain of parents has a loop"


@settings(derandomize=True, deadline=None, max_examples=40)
@given(st.integers(0, 10**6), st.integers(2, 14), st.sampled_from([12.0, 20.0, 30.0]))
def test_all_connected_agents_have_the_fewest_hops_and_keep_still(seed, agents, side_m):
    team = Team(scattered(Random(seed), agents, side_m))
    team.run(3.0)
    check_spans(team)
    assert team.run(3.0) == 0


@settings(derandomize=True, deadline=None, max_examples=10)
@given(st.integers(0, 10**6), st.integers(2, 10))
def test_the_tree_spans_under_loss(seed, agents):
    team = Team(scattered(Random(seed), agents, 16.0), seed, loss=0.5)
    team.run(10.0)
    check_spans(team)
    assert team.run(10.0) <= 0.05 * agents * 200


@pytest.mark.parametrize("loss", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(6))
def test_a_dead_root_is_forgotten_by_all_and_stays_away(seed, loss):
    team = Team(scattered(Random(seed), 10, 18.0), seed, loss)
    team.run(5.0)
    team.alive.remove(0)
    team.run(2.0 * (team.timing.root_s + 1.0))
    for _ in range(200):
        team.step()
        assert all(team.trees[own].root is None for own in team.alive)
        assert all(team.place(own) == (-1, -1) for own in team.alive)


@pytest.mark.parametrize("seed", range(6))
def test_those_cut_off_together_do_not_lead_each_other_on(seed):
    """A line breaks: the far part hears itself only, and gives up the root it followed."""
    points = [(8.0 * k, 0.0, 0.0) for k in range(8)]
    team = Team(points, seed, loss=0.3)
    team.run(5.0)
    assert [tree.tier for tree in team.trees] == list(range(8))
    team.alive.remove(3)
    team.run(2.0 * team.timing.root_s)
    assert [team.trees[own].tier for own in sorted(team.alive)] == [0, 1, 2, -1, -1, -1, -1]
    team.alive.add(3)
    team.run(2.0 * team.timing.root_s)
    assert [tree.tier for tree in team.trees] == list(range(8)), "the root has gone on"


@pytest.mark.parametrize("loss", [0.0, 0.5])
def test_of_two_roots_the_lower_key_wins_and_the_other_steps_down(loss):
    points = [(8.0 * k, 0.0, 0.0) for k in range(6)]
    team = Team(points, loss=loss, leaders=(0, 5))
    team.run(8.0)
    assert team.leading == {0: RootKey(100, 0)}
    check_spans(team)


def branch(root=LOW, version=500, tier=0, parent=-1):
    return Branch(root, version, tier, parent)


def follow(tree, now_s, *followers, leading=None):
    tree.follow_root(now_s, followers, leading, TIMING.root_s)


def near(agent, at=(1.0, 0.0, 0.0), hears_me=True, velocity=ZERO, **fields):
    return Follower(heard(agent, at, hears_me=hears_me, velocity=velocity), branch(**fields))


def test_a_version_from_the_future_is_ignored():
    tree = Tree(9, 5.0)
    follow(tree, 5.0, near(1, version=version_at(6.0) + 1))
    assert tree.root is None
    follow(tree, 5.0, near(1, version=version_at(6.0)))
    assert tree.root == LOW


def test_nobody_follows_its_own_key_from_hearsay():
    tree = Tree(1, 5.0)
    follow(tree, 5.0, near(3, root=LOW, tier=1))
    assert tree.root is None


def test_an_older_version_does_not_keep_a_root_alive():
    tree = Tree(9, 5.0)
    follow(tree, 5.0, near(1, version=500))
    for version in (500, 499, 400):
        follow(tree, 5.0 + TIMING.root_s, near(1, version=version))
    assert tree.root == LOW
    follow(tree, 5.01 + TIMING.root_s, near(1, version=500))
    assert tree.root is None


def test_a_void_root_comes_back_when_it_has_gone_on_for_long_enough():
    tree = Tree(9, 5.0)
    follow(tree, 5.0, near(1, version=500))
    follow(tree, 10.0, near(1, version=500 + version_at(REVIVAL_S)))
    assert tree.root is None
    follow(tree, 10.0, near(1, version=501 + version_at(REVIVAL_S)))
    assert tree.root == LOW


def test_a_higher_key_does_not_win_by_a_later_version():
    tree = Tree(9, 5.0)
    follow(tree, 5.0, near(1, version=500))
    follow(tree, 5.1, near(2, root=HIGH, version=510))
    assert tree.root == LOW
    other = Tree(9, 5.0)
    follow(other, 5.0, near(2, root=HIGH, version=510))
    follow(other, 5.1, near(1, version=400))
    assert other.root == LOW


def test_a_leader_makes_way_for_a_lower_key_only():
    tree = Tree(2, 5.0)
    tree.take_root(HIGH, 5.0)
    assert not tree.follow_root(5.1, [near(3, root=RootKey(300, 3))], HIGH, TIMING.root_s)
    assert tree.version == version_at(5.1)
    assert tree.follow_root(5.2, [near(1)], HIGH, TIMING.root_s)


def chosen(tree, *followers, reach_m=REACH_M):
    follow(tree, 5.0, *followers)
    tree.choose_parent(ZERO, ZERO, list(followers), reach_m)
    return tree.parent


def test_the_parent_is_kept_while_it_is_as_good():
    tree = Tree(9, 5.0)
    assert chosen(tree, near(4, tier=2)) == 4
    assert chosen(tree, near(3, tier=2), near(4, tier=2)) == 4
    assert chosen(tree, near(3, tier=1), near(4, tier=2)) == 3
    assert tree.tier == 2


def leaving(stays_s):
    """Return an agent of tier 1 that flies out of range within a time [s]."""
    return near(4, (REACH_M - 0.5 * stays_s, 0.0, 0.0), velocity=(0.5, 0.0, 0.0), tier=1)


def test_an_agent_that_soon_leaves_the_range_is_kept_but_not_taken():
    other = near(5, tier=2, parent=1)
    soon = leaving(0.5 * (PARENT_STAYS_S + NEW_PARENT_STAYS_S))
    assert chosen(Tree(9, 5.0), soon, other) == 5
    kept = Tree(9, 5.0)
    assert chosen(kept, near(4, tier=1)) == 4
    assert chosen(kept, soon, other) == 4
    assert chosen(kept, leaving(0.5 * PARENT_STAYS_S), other) == 5, "lost at once"


def test_an_agent_at_the_edge_of_the_range_that_stays_there_is_as_good_as_any():
    edge = near(4, (REACH_M, 0.0, 0.0), tier=1)
    assert chosen(Tree(9, 5.0), edge, near(5, tier=2, parent=1)) == 4


def test_who_does_not_hear_the_agent_is_no_parent_if_another_is_as_near_to_the_root():
    tree = Tree(9, 5.0)
    assert chosen(tree, near(3, hears_me=False, tier=1), near(4, tier=1)) == 4
    assert chosen(Tree(9, 5.0), near(3, hears_me=False, tier=1)) == 3, "better than none"


def test_an_own_follower_is_no_parent():
    assert chosen(Tree(9, 5.0), near(3, tier=1, parent=9)) == -1


@settings(derandomize=True)
@given(
    st.lists(
        st.builds(
            Branch,
            st.builds(RootKey, st.integers(0, 2**31 - 1), st.integers(0, 12)),
            st.integers(0, 2**53 - 1),
            st.integers(-1, 2**15 - 1),
            st.integers(-1, 12),
        ),
        max_size=8,
    )
)
def test_hostile_branches_leave_a_tier_that_fits_its_message(branches):
    tree = Tree(9, 5.0)
    followers = [Follower(heard(k), each) for k, each in enumerate(branches)]
    follow(tree, 5.0, *followers)
    tree.choose_parent(ZERO, ZERO, followers, REACH_M)
    assert -1 <= tree.tier <= 1000
    assert tree.root is None or tree.root.id != 9
