"""A small team that flies straight, without a medium, cores or avoidance: only the Q-structure.

It flies hundreds of times faster than a whole fleet, so properties can be tested on many seeds.
"""

from collections import Counter
from collections.abc import Callable
from math import dist
from random import Random
from typing import NamedTuple

from agent.config import AgentSetup, Comms, Control, Vehicle
from agent.controller import NO_WORDS, Flown, Heard, HeardSummary, Link, Senses
from agent.heard_beacon import HeardStanding
from agent.messages import ZERO, Place, Standing, Vector
from agent.qstructure.formation import FormationSpec
from agent.qstructure.target_frame import Frame
from agent.structure.link_timing import Timing
from agent.structure.member import StructureMember

TICK_S = 0.05
SPEED_MPS = 0.5
ECHO_LASTS_S = 3.0
Drops = Callable[[int, int, float], bool]
"""Whether a frame from one agent to another, sent at a time [s], is dropped."""


class Said(NamedTuple):
    """What an agent's beacon says."""

    sender: int
    stamp_s: float
    at: Vector
    velocity: Vector
    place: Place | None
    cost_m: float
    standing: Standing | None
    mission: int


class Member:
    """One agent of the team: where it is, what it heard, and its structure."""

    def __init__(self, own_id, at, team):
        self.id, self.at, self.velocity = own_id, at, ZERO
        setup = AgentSetup(
            id=own_id,
            incarnation=0,
            tick_hz=1.0 / TICK_S,
            slots_per_tick=4,
            command_ticks=2,
            vehicle=Vehicle(),
            fleet_max_speed_mps=SPEED_MPS,
            control=Control(gather=team.gather),
            comms=Comms(),
            formation=FormationSpec("f", {}, ()),
            ids=team.ids,
        )
        self.structure = StructureMember(setup)
        self.words = NO_WORDS
        self.beacons = {}
        self.summaries = []
        self.place, self.changes = None, 0

    @property
    def leads(self):
        standing = self.words.standing
        return standing is not None and standing.leads >= 0


class Team:
    """Agents at given points, with a radio: range [m], loss, latency [s], and what it drops."""

    def __init__(
        self, formation, points, seed=0, *, range_m=100.0, loss=0.0, latency_s=0.0, gather=False
    ):
        self.gather = gather
        self.map, self.ids = formation, len(points) + 8
        self.mission = Flown(0, formation.formation, Frame())
        self.random = Random(seed)
        self.link = Link(loss, latency_s, range_m)
        self.drops: Drops = lambda *_: self.random.random() < loss
        self.members = {k: Member(k, at, self) for k, at in enumerate(points)}
        self.now_s = 0.0
        self.silent = ()  # unidentified vehicles [m], which all know
        self._air = []

    def fly(self, frame):
        """Give the whole team a mission: the same formation in another frame."""
        key = self.mission.key + 1
        self.mission = Flown(key, self.map.formation, frame, key)

    def hear_frame(self, frame):
        """Let the frame of the next mission come before the mission."""
        self.mission = self.mission._replace(frame=frame, frame_key=self.mission.key + 1)

    def join(self, at):
        """Let another agent take off."""
        own_id = max(self.members) + 1
        self.members[own_id] = Member(own_id, at, self)

    def run(self, seconds):
        """Fly on; return how often agents changed their places meanwhile."""
        before = self._changes()
        for _ in range(round(seconds / TICK_S)):
            self.step()
        return self._changes() - before

    def step(self):
        self.now_s += TICK_S
        due = [each for each in self._air if each[0] <= self.now_s]
        self._air = [each for each in self._air if each[0] > self.now_s]
        for _, receiver, message in due:
            if receiver in self.members:
                self._deliver(self.members[receiver], *message)
        for member in self.members.values():
            self._decide(member)
        for member in self.members.values():
            self._send(member)

    def _deliver(self, receiver, said, summary):
        known = receiver.beacons.get(said.sender)
        if known is None or known.stamp_s < said.stamp_s:
            receiver.beacons[said.sender] = said
        if summary is not None:
            receiver.summaries.append(HeardSummary(said.sender, said.stamp_s, summary))

    def _decide(self, member):
        lost_s = Timing(self.link, TICK_S).lost_s
        member.beacons = {
            sender: beacon
            for sender, beacon in member.beacons.items()
            if self.now_s - beacon.stamp_s <= lost_s
        }
        own = member.structure.select(self._senses(member))
        member.words = member.structure.words(self.now_s)
        member.summaries = []
        if own is None:
            member.place = None
            return
        member.changes += member.place is not None and own.place != member.place
        member.place = own.place
        self._fly(member, self.mission.frame.to_world(own.slot.point))

    def _senses(self, member):
        neighbours = [self._heard(member, said) for _, said in sorted(member.beacons.items())]
        return Senses(
            now_s=self.now_s,
            position=member.at,
            velocity=member.velocity,
            yaw=0.0,
            vehicles=(),
            neighbours=tuple(neighbours),
            team=tuple,
            mission=self.mission,
            silent=self.silent,
            link=self.link,
            summaries=tuple(member.summaries),
        )

    def _heard(self, member, said):
        age_s = self.now_s - said.stamp_s
        other = self.members.get(said.sender)
        echoed = other.beacons.get(member.id) if other is not None else None
        return Heard(
            id=said.sender,
            age_s=age_s,
            position=tuple(x + age_s * u for x, u in zip(said.at, said.velocity, strict=True)),
            velocity=said.velocity,
            target=said.at,
            place=said.place,
            mission=said.mission,
            cost_m=said.cost_m,
            standing=HeardStanding(said.standing) if said.standing is not None else None,
            hears_me=echoed is not None and self.now_s - echoed.stamp_s < ECHO_LASTS_S,
        )

    def _fly(self, member, target):
        away_m = dist(member.at, target)
        share = min(1.0, SPEED_MPS * TICK_S / away_m) if away_m > 0.0 else 0.0
        before = member.at
        member.at = tuple(x + share * (y - x) for x, y in zip(before, target, strict=True))
        member.velocity = tuple((y - x) / TICK_S for x, y in zip(before, member.at, strict=True))

    def _send(self, member):
        said = Said(
            sender=member.id,
            stamp_s=self.now_s,
            at=member.at,
            velocity=member.velocity,
            place=member.place,
            cost_m=member.structure.cost_m,
            standing=member.words.standing,
            mission=self.mission.key,
        )
        arrives_s = self.now_s + self.link.latency_s
        for other in self.members.values():
            if other is member or dist(member.at, other.at) > self.link.reach_m:
                continue
            lost = self.drops(member.id, other.id, self.now_s)
            told = None if self.drops(member.id, other.id, self.now_s) else member.words.summary
            if not lost or told is not None:
                self._air.append((arrives_s, other.id, (said, told)))

    def _changes(self):
        return sum(member.changes for member in self.members.values())

    def places(self):
        """Return how many claim each place."""
        return Counter(member.place for member in self.members.values())

    def formed(self):
        """Whether the team has exactly the layout's places, and all stand in them."""
        layout = self.map.formation.layout(len(self.members))
        if self.places() != Counter(layout.places):
            return False
        to_world = self.mission.frame.to_world
        return all(
            dist(member.at, to_world(layout.slots[member.place].point)) < 0.01
            for member in self.members.values()
        )

    def until_formed(self, seconds):
        """Fly until the team has formed; return whether it has, within some time [s]."""
        until_s = self.now_s + seconds
        while not self.formed() and self.now_s < until_s:
            self.run(0.5)
        return self.formed()
