"""The Q-structure of one agent: what it says of itself, what it makes of what others say.

At 10 Hz it decides on its queue, its number and the lead of a vertex, and follows the trees of all
vertices; at first these each tick. What is urgent goes into its beacons
(:class:`~agent.messages.Standing`). What is slow goes into summaries on the multihop channel,
sooner while there is news.
"""

from collections.abc import Sequence
from math import inf
from typing import Final

from agent.config import AgentSetup
from agent.controller import Flown, Heard, Senses
from agent.heard_beacon import HeardBranch
from agent.messages import (
    DISTRESS,
    MAX_TEAM,
    MEMBER,
    SUB_VERTEX,
    VERTEX,
    Place,
    Standing,
    Subtree,
    Summary,
)
from agent.places.occupied_slots import Holder, OccupiedSlots
from agent.places.place_points import OwnTarget
from agent.qstructure.formation import NO_PLACES
from agent.structure.claim import NO_QUEUE, Claim
from agent.structure.convergecast import OwnPart
from agent.structure.destination import Destination
from agent.structure.direct_rule import DirectRule
from agent.structure.election import Election
from agent.structure.gathering import Gathering
from agent.structure.head_count import HeadCount
from agent.structure.leader import Leader
from agent.structure.leader_place import LeaderPlace
from agent.structure.link_timing import LinkTiming
from agent.structure.numbers import Numbers
from agent.structure.queue_choice import QueueChoice
from agent.structure.queue_map import map_of
from agent.structure.relocation import Held, Relocated
from agent.structure.slow_layer import SlowLayer
from agent.structure.swaps import Swaps
from agent.structure.tree import Follower, Tree
from agent.structure.view import View

DECISION_HZ: Final = 10.0
SETTLED_S: Final = 1.0
"""So long an agent without a number looks each tick, for much is new to it."""


class Structure:
    """One agent's part in the structure of one mission.

    occupied: it stays from mission to mission. before: what follows from the mission before;
    ``held`` is the same for the next mission.
    """

    def __init__(
        self,
        setup: AgentSetup,
        mission: Flown,
        now_s: float,
        occupied: OccupiedSlots,
        before: Relocated | None = None,
    ) -> None:
        own_id, formation = setup.id, map_of(mission.formation)
        self._own_id, self._map, self._occupied = own_id, formation, occupied
        self._timing = LinkTiming(1.0 / setup.comms.local_hz)
        self._round_s = 1.0 / setup.comms.multihop_hz if setup.comms.multihop_hz > 0.0 else inf
        self.claim = Claim(now_s)
        self.trees = [Tree(own_id, now_s) for _ in range(formation.vertices)]
        self._head_count = HeadCount(own_id, formation, setup.ids)
        self._order: Sequence[int] = ()
        """The known members of the own queue, in their order along it, until the agent has a number
        there."""
        self._gathering = Gathering(setup, formation) if setup.control.gather else None
        census = self._head_count.census
        self._slow = SlowLayer(
            own_id, mission.key, formation, census, self._round_s, gathering=self._gathering
        )
        self._own_parts = [OwnPart(homed) for homed in formation.homed]
        self._queue_choice = QueueChoice(own_id)
        self._election = Election(own_id, now_s)
        self._numbers = Numbers(own_id, now_s)
        self._swaps = Swaps(own_id)
        self._direct = DirectRule(own_id, now_s)
        most_members = min(setup.ids, MAX_TEAM)
        self._destination = Destination(own_id, self._direct, most_members, now_s)
        self._leader_place = LeaderPlace(self._numbers, self._direct)
        self._leader: Leader | None = None
        self._followed = False
        self._started_s = now_s
        self._next_decision_s = now_s
        self._blocked: frozenset[Place] = frozenset()
        self._view: View | None = None
        self._own: OwnTarget | None = None
        self._standing: Standing | None = None
        """What the beacon says, until the next look at the neighbours."""
        self._place_given = before.place if before is not None else None
        self._expected = before.members if before is not None else 0
        """Size of the team that takes its places over, until a leader's count of it is steady."""
        self.held: Held | None = None
        """The own place, with the frame in which the team stands in its places."""

    def update(self, senses: Senses, mission: Flown) -> OwnTarget | None:
        """Return the own target now; None for an agent without a place."""
        self._slow.hear(senses.summaries, self.trees, senses.now_s)
        decides = senses.now_s >= self._next_decision_s
        settled = self.claim.ranked or senses.now_s - self._started_s > SETTLED_S
        if not decides and settled and self._own is not None:
            return self._flown(senses.now_s)
        self._standing = None
        view = self._view = self._look(senses, mission)
        view.summaries, view.order = self._slow.summaries, self._order
        view.expected = self._expected
        self.follow_trees(view, senses)
        if self._expected and view.latest is not None:
            self._expected = 0
        if decides:
            self._next_decision_s = senses.now_s + 1.0 / DECISION_HZ - 1e-9
            self._decide(view, senses, mission)
        self._own = self._destination.choose(view, self.claim)
        self._note_held(view, mission)
        return self._flown(senses.now_s)

    def _note_held(self, view: View, mission: Flown) -> None:
        """Remember the own place for the next mission, whose frame may come before it."""
        own = view.target(self.claim)
        if own is None or own.place is None or not view.total:
            self.held = None
        elif mission.frame_key == mission.key:
            self.held = Held(own.place, view.total, view.blocked, mission, view.now_s)
        elif self.held is not None and view.blocked == self.held.blocked:
            # Where others are blocked, the team changes to other places, one member after another.
            held = self.held
            self.held = Held(own.place, view.total, held.blocked, held.mission, held.at_s)

    def _flown(self, now_s: float) -> OwnTarget | None:
        """Return the own target, displaced while the members of the own queue gather."""
        if self._own is None or self._gathering is None:
            return self._own
        return self._gathering.displaced(self._own, self.claim, now_s)

    def _look(self, senses: Senses, mission: Flown) -> View:
        around, frame = senses.neighbours, mission.frame
        view = View(senses.now_s, senses.position, around, mission.key, self._map, frame)
        view.timing = self._timing.of(senses.link)
        view.blocked = self._blocked
        if self._gathering is not None:
            view.gathering = self._gathering.queues(senses.now_s)
        return view

    def follow_trees(self, view: View, senses: Senses) -> None:
        """Find the root of each tree, and the own parent and tier."""
        # Where all hear the root and each other, a statement of it comes to all on many ways.
        root_s = view.timing.lost_s if self._direct.applies else view.timing.root_s
        for v, tree in enumerate(self.trees):
            followers = [
                Follower(h, branch) for h in view.heard if (branch := _branch(h, v)) is not None
            ]
            leading = self._election.key if self.claim.vertex == v else None
            deposed = tree.follow_root(view.now_s, followers, leading, root_s)
            reach_m, parent_s = senses.link.reach_m, view.timing.parent_s
            if not tree.stands_still(view.now_s, parent_s):
                tree.choose_parent(view.here, senses.velocity, followers, reach_m, parent_s)
            self._slow.keep_to(v, tree)
            if leading is not None and deposed:
                self._step_down(view, v)

    def _step_down(self, view: View, vertex: int) -> None:
        """Make way for a leader that is nearer."""
        self._lead_no_more(view, NO_QUEUE if self._map.is_common(vertex) else self.claim.queue)

    def _lead_no_more(self, view: View, queue: int) -> None:
        self.claim.give_up(queue, view.now_s)
        self._election.key, self._leader, self._slow.news = None, None, True

    def _decide(self, view: View, senses: Senses, mission: Flown) -> None:
        self._head_count.note(view, self.claim)
        self._election.note(view)
        self._update_blocked(view, senses, mission)
        self._direct.update(view, self.claim)
        if self._place_given is not None:
            self._relocate(view, self._place_given)
        if self.claim.queue == NO_QUEUE and not self.claim.leads:
            self._queue_choice.choose(view, self.claim)
            self._head_count.note_own(view, self.claim)  # the first beacon tells the queue
        waits = self.claim.number < 1 and not self.claim.leads
        view.order = self._order = self._head_count.order(view, self.claim.queue) if waits else ()
        if not self.claim.leads:
            self._decide_as_member(view)
        else:
            self._decide_as_leader(view)
        self._followed = any(_follows(h, self._own_id) for h in view.heard)
        self._report(view, mission)

    def _relocate(self, view: View, place: Place) -> None:
        """Take the place that follows from the mission before."""
        self._place_given = None
        vertex, queue = self._map.vertex_of.get(place), place.queue
        if vertex is not None:
            self.claim.give_up(queue, view.now_s)  # there it stands while the vertex is taken
            self._election.lead(view, self.claim, self.trees[vertex], vertex)
            self._begin_to_lead(view)
        else:
            number = self._map.number(place)
            self.claim.take(queue, number, view.distance(queue, number), view.now_s)
        self._head_count.note_own(view, self.claim)

    def _begin_to_lead(self, view: View) -> None:
        key, claim = self._election.key, self.claim
        if key is not None:
            self._leader = Leader(claim.vertex, key, view.now_s, self._round_s, view.expected)
            self._head_count.note_own(view, claim)
        self._slow.news = True

    def _decide_as_leader(self, view: View) -> None:
        """Choose the place, or make way where the team is too small for all vertices."""
        if self._leader_place.is_spare(view, self.claim):
            vacant = min(view.vacant, key=view.to_vertex, default=self.claim.vertex)
            self._lead_no_more(view, self._map.queues_through(vacant)[0])
        else:
            self._leader_place.choose(view, self.claim)

    def _decide_as_member(self, view: View) -> None:
        claim = self.claim
        direct = self._direct if self._direct.applies else None
        first = claim.number < 1 and self._map.vertices > 1
        likely = self._direct.likely(view) if first else None
        if self._election.stand(view, claim, self.trees, direct, likely):
            self._begin_to_lead(view)
        elif self._direct.applies:
            self._direct.choose(view, claim)
        elif self._queue_choice.obey(view, claim):
            self._slow.news = True
        elif claim.number < 1:
            if not self._direct.is_near:
                self._numbers.take_first(view, claim)
        elif (
            not self._swaps.proceed(view, claim)
            and not self._numbers.keep_up(view, claim)
            and not self._direct.is_near  # else partners that decide directly would not answer
        ):
            self._swaps.propose(view, claim)

    @property
    def agents(self) -> int:
        """Size of the team, as far as the agent knows."""
        view = self._view
        return (view.total or len(view.heard) + 1) if view is not None else 0

    def _update_blocked(self, view: View, senses: Senses, mission: Flown) -> None:
        reported = {*senses.blocked}
        for summary in view.summaries:
            if summary is not None:
                reported.update(Place(*place) for place in summary.blocked)
        peers: list[Holder] = []
        if reported or senses.silent or self._blocked or self._occupied.remembers:
            peers = self._holders(view)
        self._blocked = view.blocked = self._occupied.update(
            senses, mission, peers, self.agents, frozenset(reported)
        )

    def _holders(self, view: View) -> list[Holder]:
        """Return the members heard and the own agent, with their places."""
        own = view.target(self.claim)
        peers: list[Holder] = [(h.place, h.position) for h in view.heard]
        return [*peers, (own.place if own is not None else None, view.here)]

    def _taken_from_team(
        self, view: View, mission: Flown, reported: Sequence[tuple[int, int]]
    ) -> frozenset[Place]:
        """Return the places that members see taken, less those in which the leader hears a member.

        Who sees a member but does not hear it takes it for unidentified. A place that is counted as
        taken and as held by a member too would be missing in the shares of the team.
        """
        if not reported:
            return NO_PLACES
        places = frozenset([Place(*place) for place in reported])
        return places - self._occupied.held(mission, self._holders(view), self.agents)

    def _report(self, view: View, mission: Flown) -> None:
        """Bring up to date what goes up each tree; as a leader, the own summary."""
        if self._gathering is not None:
            oldest_s = self._slow.oldest_s(view.now_s, view.timing)
            self._gathering.update(view, self.claim, self.trees, oldest_s)
        for v, tree in enumerate(self.trees):
            leads = self._leader is not None and self._leader.vertex == v
            if tree.parent < 0 and not leads:
                continue
            own = self._own_part(view, v)
            subtree = self._slow.collect(v, own, self._occupied.seen, view.now_s, view.timing)
            if leads and self._leader is not None:
                # Only what is seen goes down, not what came down before: that would never end.
                blocked = self._taken_from_team(view, mission, subtree.blocked)
                population = self._head_count.population(
                    view,
                    self._direct.heard,
                    all_hear_the_same=self._direct.all_hear_the_same(view),
                )
                summary = self._leader.summary(view, population, subtree, blocked)
                self._slow.publish(v, summary)
                if self._gathering is not None:
                    self._gathering.lead(view, v, summary)

    def _own_part(self, view: View, vertex: int) -> Subtree | None:
        """Return the own part of what goes up a tree; None for a queue of another vertex."""
        homed, claim = self._map.homed[vertex], self.claim
        if claim.queue not in homed or (claim.leads and claim.number < 1):
            return None
        offers = () if self._direct.applies else self._queue_choice.candidates(view, claim)
        away_m = view.to_vertex(vertex)
        return self._own_parts[vertex].of(claim.queue, claim.number, away_m, offers)

    def summary(self, now_s: float) -> Summary | None:
        """Return what is due on the multihop channel, None where nothing is."""
        if self._view is None:
            return None
        return self._slow.due(self.trees, self._view.timing, now_s)

    @property
    def tier(self) -> int:
        """Tier in the tree of the own queue, -1 in distress."""
        return self._own_tree.tier if self._own_tree is not None else -1

    @property
    def parent(self) -> int:
        """The agent that it follows in the tree of its own queue, -1 for none."""
        return self._own_tree.parent if self._own_tree is not None else -1

    @property
    def role(self) -> int:
        """Index of ROLES."""
        if self.claim.leads:
            return VERTEX
        if self.tier < 0:
            return DISTRESS
        return SUB_VERTEX if self._followed else MEMBER

    @property
    def _own_tree(self) -> Tree | None:
        claim = self.claim
        if claim.leads:
            return self.trees[claim.vertex]
        return self.trees[self._map.home[claim.queue]] if claim.queue != NO_QUEUE else None

    def standing(self, now_s: float) -> Standing:
        """Return what the beacon says of the structure."""
        claim, pushes, standing = self.claim, self.claim.pushes(now_s), self._standing
        if standing is None or standing.pushes != pushes:
            standing = self._standing = Standing(
                branches=tuple([tree.branch for tree in self.trees]),
                leads=claim.vertex,
                queue=claim.queue,
                heard=self._direct.heard,
                pushes=pushes,
                proposal=claim.proposal,
                reservation=claim.reservation,
                code=self._head_count.code,
            )
        return standing


def _branch(heard: Heard, vertex: int) -> HeardBranch | None:
    standing = heard.standing
    if standing is None or vertex >= len(standing.branches):
        return None
    return standing.branches[vertex]


def _follows(heard: Heard, agent: int) -> bool:
    """Whether an agent heard has another one as its parent, in some tree."""
    if heard.standing is None:
        return False
    branches = heard.standing.branches
    return any(branch is not None and branch.parent == agent for branch in branches)
