"""Invariants of allocation: what must hold at every tick whose premise holds, in any run.

I2 one vertex agent for each vertex of the formation in each component. I3 each queue's members
within 1 of its share there. Both from T_d + 2B after the last fault on. I4 no two of a component
claim one place for longer than 2B. I6 at most 3 changes of role an agent and fault. I7 quiet:
settled and all in place, nobody changes its place; where frames are lost, once an agent at most.
A fault is every event of the timeline, every death, and every change of who can reach whom.
"""

from collections import Counter
from dataclasses import dataclass
from typing import Any, assert_never

import numpy as np
from numpy.typing import NDArray

from agent.messages import Place
from worldsim.judge.connectivity import Components, Connectivity
from worldsim.judge.hovering_vehicles import HoveringVehicles
from worldsim.judge.phase import Phase
from worldsim.judge.run_events import (
    ConditionsChanged,
    Flapped,
    FormationGiven,
    FrameGiven,
    Healed,
    Jammed,
    Joined,
    Killed,
    LateStart,
    Left,
    Partitioned,
    Paused,
    QueueChanged,
    Restarted,
    Resumed,
    RoleChanged,
    RunEvent,
    SensorChanged,
    SlotChanged,
)
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import CONVERGED_S, Scenario

LOOK_EVERY_S = 1.0
MAX_ROLE_CHANGES = 3
Claims = list[tuple[int, int]]


@dataclass(slots=True)
class Tally:
    """At how many ticks an invariant was looked at, and at how many it did not hold."""

    ticks: int = 0
    violations: int = 0

    def count(self, broken: int) -> None:
        """Count a tick, and whether anything was broken at it."""
        self.ticks += 1
        self.violations += broken > 0


class Invariants:
    """Watches the allocation of a whole run; bodies: shown every tick."""

    def __init__(self, scenario: Scenario, bodies: HoveringVehicles) -> None:
        self.tallies = {name: Tally() for name in ("I2", "I3", "I4", "I6", "I7")}
        self._reach = Connectivity(scenario)
        self._bodies = bodies
        self._boot_s = scenario.fleet.boot_s
        self._fault_s = 0.0
        self._look_s = 0.0
        self._components: Components | None = None
        self._members: list[list[int]] = []
        self._seen: tuple[Any, ...] = ()
        self._claims: Claims = []
        self._broken = (0, 0)
        self._shared: list[bool] = []
        self._shared_since: dict[int, tuple[tuple[int, int], float]] = {}
        self._roles: Counter[int] = Counter()
        self._flips = 0
        self._moves: Counter[int] = Counter()
        self._quiet_since_s: float | None = None
        self._settled_s = self._twice_s = 0.0

    def note(self, event: RunEvent) -> None:
        """Take an event, in order."""
        match event:
            case RoleChanged(agent=int(agent)):
                self._roles[agent] += 1
                self._flips += self._roles[agent] > MAX_ROLE_CHANGES
            case Restarted() | Joined():
                self._fault(event.t_s, event.t_s + self._boot_s)
            case Killed() | Left() | Paused() | Resumed() | FormationGiven() | FrameGiven():
                self._fault(event.t_s, event.t_s)
            case Partitioned() | Healed() | Jammed() | Flapped() | ConditionsChanged():
                self._reach.note(event)
                self._fault(event.t_s, event.t_s)
            case RoleChanged() | SlotChanged() | QueueChanged() | SensorChanged() | LateStart():
                pass
            case _:
                assert_never(event)

    def see(self, tick: Tick, phase: Phase, in_place: bool) -> None:
        """Judge a tick; in_place: whether all the living are in their places."""
        if tick.time_s >= self._look_s:
            self._look(tick)
        before = self._claims
        self._find(tick, phase)
        self.tallies["I6"].count(self._flips)
        self._flips = 0
        self.tallies["I4"].count(self._lasting(tick.time_s))
        if tick.time_s >= self._settled_s:
            self.tallies["I2"].count(self._broken[0])
            self.tallies["I3"].count(self._broken[1])
        self._see_quiet(tick, before, in_place)

    def _fault(self, look_s: float, over_s: float) -> None:
        """Start anew after a fault at ``look_s`` that is over at ``over_s`` [s]."""
        self._look_s = look_s
        self._restart_quiet(over_s)

    def _restart_quiet(self, time_s: float) -> None:
        self._fault_s = max(self._fault_s, time_s)
        self._quiet_since_s = None
        self._roles.clear()
        self._moves.clear()

    def _look(self, tick: Tick) -> None:
        """See who can reach whom: once a second, and after each fault."""
        self._look_s = tick.time_s + LOOK_EVERY_S
        found = self._reach.components(tick)
        before, self._components, self._members = self._components, found, found.members()
        if before is not None and not np.array_equal(before.label, found.label):
            self._restart_quiet(tick.time_s)
        team = int(np.count_nonzero(tick.alive))
        self._twice_s = 2.0 * self._reach.everybody_s(team, found.hops)
        self._settled_s = self._fault_s + self._reach.detection_s(found.hops) + self._twice_s

    def _find(self, tick: Tick, phase: Phase) -> None:
        """Find what is broken; in one component that holds until a claim changes, or a body stands.

        Where there are more, a vehicle of one may come into a place of another at any time.
        """
        members = self._members
        seen = (
            *(rows.tobytes() for rows in (tick.place, tick.alive, tick.mission)),
            self._components.label.tobytes() if self._components is not None else b"",
            b"" if tick.alive.all() else self._bodies.hovering(tick).tobytes(),
        )
        if seen == self._seen and len(members) == 1:
            return
        self._seen, claims = seen, phase.claims(tick)
        self._claims = self._claims if claims == self._claims else claims
        broken = [self._in_component(tick, phase, rows) for rows in members]
        self._broken = (sum(heads for heads, _ in broken), sum(shares for _, shares in broken))
        self._shared = self._sharing(members)

    def _in_component(self, tick: Tick, phase: Phase, rows: list[int]) -> tuple[int, int]:
        """Return how many vertices have not one agent, and how many queues not their share."""
        held = Counter(Place(*self._claims[row]) for row in rows)
        layout = self._bodies.layout(tick, phase, rows)
        heads = sum(held[place] != 1 for place in layout.heads)
        common = set(phase.formation.common)
        own = Counter[int]()
        for place, count in held.items():
            if place not in common:
                own[place.queue] += count
        blocked = self._bodies.occupied_places(tick, phase, rows)
        shares = phase.formation.divide(len(rows), blocked)
        return heads, sum(abs(own[queue] - share) > 1 for queue, share in enumerate(shares))

    def _sharing(self, members: list[list[int]]) -> list[bool]:
        """Return whose place is claimed by another of its component too."""
        shared = [False] * len(self._claims)
        for rows in members:
            held = Counter(self._claims[row] for row in rows)
            for row in rows:
                shared[row] = self._claims[row][0] >= 0 and held[self._claims[row]] > 1
        return shared

    def _lasting(self, time_s: float) -> int:
        """Return how many have shared their place for longer than 2B, and not only just."""
        if not any(self._shared):
            self._shared_since = {}
            return 0
        since = {}
        for row, shared in enumerate(self._shared):
            if shared:
                claim, from_s = self._shared_since.get(row, (None, time_s))
                now = self._claims[row]
                since[row] = (now, from_s if claim == now else time_s)
        self._shared_since = since
        return sum(time_s - from_s > self._twice_s for _, from_s in since.values())

    def _see_quiet(self, tick: Tick, before: Claims, in_place: bool) -> None:
        """Count changes of place after 2 s of everybody standing in its place, settled."""
        since_s = self._quiet_since_s
        if since_s is not None and tick.time_s - since_s >= CONVERGED_S:
            self.tallies["I7"].count(self._moved(tick.alive, before))
        elif not in_place or tick.time_s < self._settled_s:
            self._quiet_since_s = None
        elif since_s is None:
            self._quiet_since_s = tick.time_s

    def _moved(self, alive: NDArray[np.bool_], before: Claims) -> int:
        """Return how many changed their place at this tick once more than they may."""
        if before is self._claims:
            return 0
        allowed = 1 if self._reach.loss > 0.0 else 0
        moved = 0
        for row, (was, now) in enumerate(zip(before, self._claims, strict=True)):
            if alive[row] and was != now:
                self._moves[row] += 1
                moved += self._moves[row] > allowed
        return moved
