"""Allocation as agents move, join, leave, hear late and claim: it settles, one place for each."""

from itertools import combinations
from math import dist

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from agent.assignment.allocation import CONFLICT_M, HYSTERESIS_M2, allocate, own_place
from agent.controller import Peer
from agent.messages import Place, Vector
from tests.agent.comms.builders import peer, places

MOST = 6
SWEEPS = 12
"""Agents that all hear each other agree after so many turns of each, at most."""
ROUNDING_M2 = 1e-6
coordinate = st.integers(-12, 12).map(lambda quarter: quarter / 4.0)
points = st.tuples(coordinate, coordinate, coordinate)
offset = st.integers(-2, 2).map(lambda quarter: quarter / 4.0)
offsets = st.tuples(offset, offset, offset)
agents = st.integers(0, MOST - 1)


class Team(RuleBasedStateMachine):
    """Members with their positions and claims, and one slot for each."""

    def __init__(self) -> None:
        super().__init__()
        self.at: dict[int, Vector] = {}
        self.claims: dict[int, Place | None] = {}
        self.slots: list[Vector] = []

    @initialize(slots=st.lists(points, min_size=MOST, max_size=MOST, unique=True), at=points)
    def begin(self, slots: list[Vector], at: Vector) -> None:
        self.all_slots = slots
        self.join(0, at)

    def team(self, at: dict[int, Vector]) -> list[Peer]:
        return [peer(each, at[each], self.claims[each]) for each in sorted(at)]

    def layout(self) -> tuple[list[Place], list[Vector]]:
        return places(len(self.at)), self.all_slots[: len(self.at)]

    @rule(which=agents, at=points)
    def join(self, which: int, at: Vector) -> None:
        """Join, or move if it is there."""
        self.at[which] = at
        self.claims.setdefault(which, None)

    @precondition(lambda self: len(self.at) > 1)
    @rule(which=agents)
    def leave(self, which: int) -> None:
        if which in self.at and len(self.at) > 1:
            del self.at[which], self.claims[which]

    @rule(which=agents, rank=st.integers(-1, MOST))
    def claim_anything(self, which: int, rank: int) -> None:
        """As one that has heard little, or of places that there are no more."""
        if which in self.at:
            self.claims[which] = None if rank < 0 else Place(0, rank)

    @rule(rank=agents, near=st.lists(st.tuples(agents, offsets), min_size=2, max_size=3))
    def dispute(self, rank: int, near: list[tuple[int, Vector]]) -> None:
        """Some claim the same place, and are near it."""
        x, y, z = self.all_slots[rank]
        for which, (u, v, w) in near:
            self.at[which] = x + u, y + v, z + w
            self.claims[which] = Place(0, rank)

    @rule(which=agents)
    def choose(self, which: int) -> None:
        if which in self.at:
            self.claims[which] = own_place(which, self.team(self.at), *self.layout())

    @rule(last_first=st.booleans())
    def settle(self, last_first: bool) -> None:
        for _ in range(SWEEPS):
            before = dict(self.claims)
            for each in sorted(self.at, reverse=last_first):
                self.choose(each)
            if self.claims == before:
                break
        else:
            raise AssertionError(f"they exchange places for ever: {self.claims}")
        assert sorted(self.claims.values()) == self.layout()[0]
        assert allocate(self.team(self.at), *self.layout()) == self.claims

    @invariant()
    def each_has_one_place_of_its_own_whoever_asks(self) -> None:
        held, slots = self.layout()
        found = allocate(self.team(self.at), held, slots)
        assert sorted(place for place in found.values() if place is not None) == held

        def cost_m2(agent: int, place: Place) -> float:
            kept = HYSTERESIS_M2 if self.holders(held, slots).get(place) == agent else 0.0
            return dist(self.at[agent], slots[held.index(place)]) ** 2 - kept

        for a, b in combinations(found, 2):
            here, there = found[a], found[b]
            assert here is not None
            assert there is not None
            now_m2 = cost_m2(a, here) + cost_m2(b, there)
            assert cost_m2(a, there) + cost_m2(b, here) >= now_m2 - ROUNDING_M2, "an exchange saves"

    def holders(self, held: list[Place], slots: list[Vector]) -> dict[Place, int]:
        """Return who keeps each claimed place: the nearer, or of two as near the lower id."""
        kept: dict[Place, int] = {}
        for agent in sorted(self.at):
            place = self.claims[agent]
            if place not in held:
                continue
            slot = slots[held.index(place)]
            rival = kept.get(place)
            if (
                rival is None
                or dist(self.at[agent], slot) < dist(self.at[rival], slot) - CONFLICT_M
            ):
                kept[place] = agent
        return kept


TestTeam = Team.TestCase
TestTeam.settings = settings(
    derandomize=True, deadline=None, max_examples=30, stateful_step_count=25
)
