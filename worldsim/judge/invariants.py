"""Invariants of the allocation: they hold at every tick of any run at which their premise holds.

I2: in each connected component, each vertex of the formation has exactly one agent.
I3: in each component, the number of agents of a queue is within 1 of the queue's share.
Premise of both: T_d + 2B have passed since the last fault, and the judge can tell which agents and
which hovering vehicles the component's agents know.
I4: no two agents of a component claim one place for longer than 2B; under leaders and trees, no two
that hear each other.
I6: no agent that news reaches within a bound takes up or gives up the lead of a vertex more than 3
times after a fault.
I7: no agent changes its place in a settled team in which every agent is in its place; where frames
are lost, each agent may once.
A fault is an event of the timeline, an exit, a change of the connected components, a vehicle that
comes to hover in a component's place or leaves it, agents that look again whether a vehicle hovers
in a place of which they cannot know it, a radio whose queues cannot carry the traffic, or a time in
which agents are not observed, as netem is down or the world was stopped. While one of the last two
lasts, none of the invariants is evaluated.
"""

from collections import Counter
from collections.abc import Sequence
from math import inf
from typing import NamedTuple, assert_never

import numpy as np
from numpy.typing import NDArray

from agent.messages import Place
from agent.qstructure.formation import NO_PLACES
from worldsim.judge.blocked_places import BlockedPlaces
from worldsim.judge.connectivity import Components, Connectivity
from worldsim.judge.finding import InvariantTally
from worldsim.judge.hovering_vehicles import HoveringVehicles
from worldsim.judge.lead_changes import LeadChanges
from worldsim.judge.phase import Phase
from worldsim.judge.radio_events import NetemOutage, RadioRunEvent, Sabotaged
from worldsim.judge.radio_load import RadioLoad
from worldsim.judge.run_events import (
    AgentFaultRunEvent,
    ClockChanged,
    ControllerLogged,
    DiskFilled,
    FormationGiven,
    FrameGiven,
    Intruded,
    Joined,
    Killed,
    LateStart,
    Left,
    Paused,
    PoseChanged,
    QueueChanged,
    Reconnected,
    Restarted,
    Resumed,
    RoleChanged,
    RunEvent,
    SensorChanged,
    SlotChanged,
    SlowChanged,
    Starved,
    WorldStopped,
)
from worldsim.judge.shared_places import Claims, SharedPlaces
from worldsim.judge.tick import Tick, same_claims
from worldsim.scenario.tables import CONVERGED_S, Scenario

COMPONENTS_EVERY_S = 1.0
"""Interval at which connectivity is computed anew [s]."""


class Breaches(NamedTuple):
    """Breaches of I2 and I3 at one tick."""

    vertices: int
    """Vertices that do not have exactly one agent."""
    shares: int
    """Queues whose number of agents is not within 1 of their share."""


class Invariants:
    """Evaluates the allocation of a whole run. hovering: sees every tick first."""

    def __init__(self, scenario: Scenario, hovering: HoveringVehicles) -> None:
        self.tallies = {name: InvariantTally() for name in ("I2", "I3", "I4", "I6", "I7")}
        self._connectivity, self._load = Connectivity(scenario), RadioLoad()
        self._shared = SharedPlaces(local=scenario.control.allocation == "structure")
        self._places = BlockedPlaces(
            hovering, ["proximity" in each.sensors for each in scenario.vehicles]
        )
        self._boot_s, self._unobserved = scenario.fleet.boot_s, False
        self._fault_s = 0.0
        """When the last fault is over [s; simulated time]."""
        self._busy_until_s = 0.0
        """Until when a slow agent may be at a step that it began earlier [s; simulated time]."""
        self._components_due_s = 0.0
        """When connectivity is to be computed anew [s; simulated time]."""
        self._components: Components | None = None
        self._members: list[list[int]] = []
        """The rows of each component."""
        self._seen: tuple[object, ...] = ()
        """What the breaches were found from."""
        self._seen_in: tuple[Tick, Phase, Components | None] | None = None
        """The same in short, where all agents are in one component; else None."""
        self._claims: Claims = []
        self._blocked_last: list[frozenset[Place] | None] = []
        """For each component, the places in which others hover."""
        self._breaches: Breaches | None = None
        """None where it is clear of no component whom its agents know."""
        self._leads = LeadChanges()
        self._moves: Counter[int] = Counter()
        """Changes of place of each agent since the last fault, in a quiet team."""
        self._quiet_since_s: float | None = None
        """Since when every agent is in its place in a settled team [s; simulated time]."""
        self._before = 0, 0.0  # hops and loss before the components changed last
        self._settling_s = 0.0
        """The time in which a team settles [s]: T_d + 2B."""
        self._twice_s = 0.0
        """2B [s]."""

    def handle_event(self, event: RunEvent) -> None:
        """Take an event; events come in order."""
        if isinstance(event, RadioRunEvent):
            self._handle_radio(event)
            return
        match event:
            case ClockChanged() | PoseChanged() | SlowChanged() | Starved():
                self._handle_agent_fault(event)
            case RoleChanged():
                self._leads.take(event, informed=self._is_informed(event.agent))
            case Restarted() | Joined():
                if event.agent is not None:
                    self._places.restart(event.agent)
                    self._leads.forget(event.agent)
                self._fault(event, event.t_s + self._boot_s)
            case Killed() | Left() | Paused() | Resumed() | FormationGiven() | FrameGiven():
                self._fault(event, event.t_s)
            case WorldStopped() | Reconnected():
                self._unobserved = isinstance(event, WorldStopped)
                self._fault(event, event.t_s)
            case (
                SlotChanged()
                | QueueChanged()
                | SensorChanged()
                | Intruded()
                | LateStart()
                | DiskFilled()
                | ControllerLogged()
            ):
                pass
            case _:
                assert_never(event)

    def _handle_agent_fault(self, event: AgentFaultRunEvent) -> None:
        """Take a change of an agent's fault, which may outlast its end by a step."""
        self._connectivity.handle_agent_fault(event)
        self._shared.forget()
        self._busy_until_s = max(self._busy_until_s, event.over_s)
        self._fault(event, event.over_s)

    def _handle_radio(self, event: RadioRunEvent) -> None:
        if isinstance(event, Sabotaged):
            return  # whatever somebody sends, it excuses nobody
        self._connectivity.handle_event(event)
        self._unobserved = self._unobserved or isinstance(event, NetemOutage)
        self._fault(event, event.t_s)

    def see(self, tick: Tick, phase: Phase) -> None:
        """Evaluate a tick, which the phase has seen."""
        if tick.time_s >= self._components_due_s:
            self._find_components(tick)
        parted = len(self._members) > 1 or False in tick.alive.tolist()
        self._places.see(tick, parted=parted, news_s=self._twice_s)
        last_claims = self._claims
        self._find_breaches(tick, phase)
        if self._is_suspect(tick.time_s, last_claims):
            # Agents may have come into reach since the components were found, or gone out of it.
            self._find_components(tick)
            self._find_breaches(tick, phase)
        if self._load.is_overloaded(tick, self._connectivity.longest_s) or self._unobserved:
            self._excuse(tick.time_s)
            return
        self.tallies["I6"].count(self._leads.take_excess())
        if tick.time_s <= self._busy_until_s:
            self._shared.forget()
        self.tallies["I4"].count(self._shared.count_lasting(tick.time_s, self._twice_s))
        if tick.time_s >= self._settled_s and self._breaches is not None:
            self.tallies["I2"].count(self._breaches.vertices)
            self.tallies["I3"].count(self._breaches.shares)
        if self._quiet_since_s is not None and self._looks_again(tick, phase, last_claims):
            self._start_anew(tick.time_s)
        self._evaluate_quiet(tick, last_claims, phase.at_slots)

    @property
    def _settled_s(self) -> float:
        """When the team must have settled after the last fault [s; simulated time]."""
        return self._fault_s + self._settling_s

    def _is_suspect(self, time_s: float, last_claims: Claims) -> bool:
        """Return whether an invariant is violated, if the components are still the same."""
        if time_s < self._settled_s:
            return False
        moved = self._quiet_since_s is not None and last_claims is not self._claims
        return moved or (self._breaches is not None and any(self._breaches))

    def _is_informed(self, agent: int | None) -> bool:
        """Return whether news reaches an agent within a bound, and both ways."""
        if self._components is None or agent is None:
            return True
        label = int(self._components.label[agent])
        return self._twice_s < inf and label >= 0 and bool(self._components.closed[label])

    def _fault(self, event: RunEvent, over_s: float) -> None:
        """Start anew after a fault. over_s: when it is over [s; simulated time]."""
        self._leads.strike(event.t_s, type(event).__name__)
        self._components_due_s = event.t_s
        self._restart_premises(over_s)

    def _excuse(self, time_s: float) -> None:
        """Evaluate nothing at a tick at which news takes no bounded time, and start anew then."""
        self._start_anew(time_s)
        self._shared.forget()
        self._leads.take_excess()

    def _start_anew(self, time_s: float) -> None:
        """Start anew where no event tells why."""
        self._leads.restart(time_s)
        self._restart_premises(time_s)

    def _restart_premises(self, time_s: float) -> None:
        self._fault_s = max(self._fault_s, time_s)
        self._quiet_since_s = None
        self._moves.clear()

    def _find_components(self, tick: Tick) -> None:
        """Find the connected components: once a second, and after each fault."""
        self._components_due_s = tick.time_s + COMPONENTS_EVERY_S
        found = self._connectivity.components(tick)
        self._places.hear(found.hears)
        last, self._components, self._members = self._components, found, found.members()
        if last is not None and last is not found and not last.same_as(found):
            self._start_anew(tick.time_s)
            self._before = last.hops, last.loss
        if self._shared.local and len(self._claims):
            self._shared.find(self._claims, self._members, found.hears)
        team = int(np.count_nonzero(tick.alive))
        self._twice_s = 2.0 * self._connectivity.dissemination_s(team, found.hops, found.loss)
        # Agents wait for those whom they heard before as long as news may come from there.
        hops, loss = max(found.hops, self._before[0]), max(found.loss, self._before[1])
        self._settling_s = self._connectivity.detection_s(hops, loss) + self._twice_s

    def _find_breaches(self, tick: Tick, phase: Phase) -> None:
        """Find the breaches of a tick; they hold until a claim or a blocked place changes."""
        if self._is_as_before(tick, phase):
            return
        members = self._members
        blocked = [self._blocked(tick, phase, rows) for rows in members]
        whole = len(members) == 1 and len(members[0]) == len(tick.alive)
        self._seen_in = (tick, phase, self._components) if whole else None
        seen = (
            *(rows.tobytes() for rows in (tick.place, tick.alive, tick.mission)),
            *self._members_key(),
            phase.mission,
            *blocked,
        )
        if seen == self._seen:
            return
        self._seen, claims = seen, phase.claims(tick)
        self._leads.near_taken = frozenset(
            row
            for rows, places in zip(members, blocked, strict=True)
            if places is None or places
            for row in rows
        )
        if blocked != self._blocked_last:
            # A vehicle that comes to hover in a place, or goes, is news that has to spread.
            self._blocked_last = blocked
            self._fault_s = max(self._fault_s, tick.time_s)
        self._claims = self._claims if claims == self._claims else claims
        self._breaches = self._judged(phase, blocked)
        hears = self._components.hears if self._components is not None else None
        self._shared.find(self._claims, members, hears)

    def _is_as_before(self, tick: Tick, phase: Phase) -> bool:
        """Return whether the breaches are those of the last tick, without looking further."""
        if self._seen_in is None:
            return False
        last, of, components = self._seen_in
        return phase is of and components is self._components and same_claims(last, tick)

    def _members_key(self) -> tuple[bytes, ...]:
        """Return what changes with the components."""
        if self._components is None:
            return ()
        return self._components.label.tobytes(), self._components.closed.tobytes()

    def _blocked(self, tick: Tick, phase: Phase, rows: list[int]) -> frozenset[Place] | None:
        """Return the places in which others hover, for a component.

        None where that is not clear, or where the mission has reached none of its agents.
        """
        if not (tick.mission[rows] >= phase.mission).any():
            return None
        if len(rows) == len(tick.alive) or self._components is None:
            return NO_PLACES
        return self._places.of(tick, phase, rows)

    def _judged(self, phase: Phase, blocked: Sequence[frozenset[Place] | None]) -> Breaches | None:
        """Return the breaches in all components of which it is clear whom their agents know.

        Those are the components that hear of no other agent, and that know the mission and can
        know every blocked place. None where there is no such component.
        """
        closed = self._components.closed.tolist() if self._components is not None else []
        found = [
            self._in_component(phase, rows, places)
            for rows, places, alone in zip(self._members, blocked, closed, strict=True)
            if alone and places is not None
        ]
        if not found:
            return None
        return Breaches(sum(each.vertices for each in found), sum(each.shares for each in found))

    def _in_component(self, phase: Phase, rows: list[int], blocked: frozenset[Place]) -> Breaches:
        """Return the breaches in the component of these rows."""
        held = Counter(Place(*self._claims[row]) for row in rows)
        free = {*phase.formation.vertex_places.values()} - blocked
        if len(rows) == 1 and free.issuperset(held):
            return Breaches(0, 0)  # who hears nobody may keep the vertex that it leads
        layout = phase.formation.layout(len(rows), blocked)
        vertices = sum(held[place] != 1 for place in layout.heads)
        common = set(phase.formation.common)
        own = Counter[int]()
        for place, count in held.items():
            if place not in common:
                own[place.queue] += count
        shares = phase.formation.divide(len(rows), blocked)
        wrong = sum(abs(own[queue] - share) > 1 for queue, share in enumerate(shares))
        return Breaches(vertices, wrong)

    def _evaluate_quiet(self, tick: Tick, last_claims: Claims, at_slots: bool) -> None:
        """Evaluate I7 once every agent of a settled team has been in its place for 2 s."""
        since_s = self._quiet_since_s
        if self._twice_s == inf:
            self._quiet_since_s = None  # a drifting clock makes news unbounded without an event
        elif since_s is not None and tick.time_s - since_s >= CONVERGED_S:
            self.tallies["I7"].count(self._count_moves(tick.alive, last_claims))
        elif not at_slots or tick.time_s < self._settled_s:
            self._quiet_since_s = None
        elif since_s is None:
            self._quiet_since_s = tick.time_s

    def _looks_again(self, tick: Tick, phase: Phase, last_claims: Claims) -> bool:
        """Whether agents may look whether a vehicle still hovers in a place: they cannot know."""
        return last_claims is not self._claims and any(
            self._places.is_unclear(tick, phase, rows) for rows in self._members
        )

    def _count_moves(self, alive: NDArray[np.bool_], last_claims: Claims) -> int:
        """Return the number of agents that changed their place more often than allowed."""
        if last_claims is self._claims:
            return 0
        allowed = 1 if self._components is not None and self._components.lossy else 0
        excess = 0
        for row, (last, now) in enumerate(zip(last_claims, self._claims, strict=True)):
            if alive[row] and last != now:
                self._moves[row] += 1
                excess += self._moves[row] > allowed
        return excess
