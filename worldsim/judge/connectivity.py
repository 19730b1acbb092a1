"""Radio connectivity of the team: components, hops, and the time that news takes to spread.

Computed from the truth: positions, link conditions and radio faults in force, link by link. A round
is one period of the multihop channel, on which agents pass on what they hear.
"""

from functools import cache
from math import comb, inf
from typing import Final, NamedTuple, assert_never

import numpy as np
from numpy.typing import NDArray

from agent.assignment.slot_selection import ALONE_S
from agent.comms.gossip import LEAST_RELAYED_SILENCE_S
from agent.comms.neighbours import MAX_AGE_S
from agent.comms.unidentified_vehicles import SAME_VEHICLE_M
from netem.conditions import NetworkConditions
from netem.link import burst_variance_factor, unusable_share
from netem.link_model import LinkModel
from netem.random_draws import MAX_QUANTILE
from netem.wire.channels import CHANNELS, LOCAL, MAX_PAYLOAD_B, MULTIHOP
from worldsim.judge.clock_links import ClockLinks
from worldsim.judge.radio_events import RadioRunEvent, order_of
from worldsim.judge.run_events import (
    AgentFaultRunEvent,
    ClockChanged,
    PoseChanged,
    SlowChanged,
    Starved,
)
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import Scenario
from worldsim.truth.vehicle import Floats

LEAST_NEWS_S: Final = 0.5
"""However fast the radio, agents take this long to act on news: they choose at 5 Hz, and wait for
their knowledge to settle."""
LEAST_DETECTION_S = LEAST_RELAYED_SILENCE_S + ALONE_S
"""The same for a loss, or for nobody to be heard at the start."""
MAX_QUEUED_S: Final = 0.5
"""A frame that waits longer in its sender's queue makes news late, however slow the rate."""
LONGEST_STEP_S: Final = 0.5
"""Where a step takes longer, beacons come so rarely that others may take their sender for lost."""
LONGEST_STOP_S: Final = 1.0
"""Where processes stop for longer, others may take their agents for lost (LEAST_SILENCE_S)."""
LEAST_FRAME_B: Final = (158, 64)
"""The shortest frame that an agent sends on each channel [B]: a beacon that echoes nobody, and
gossip of one record."""
MAX_ROUNDS: Final = 2000
"""More rounds count as infinitely many."""


class Components(NamedTuple):
    """The connected components of the running agents.

    Two agents are in one component where news of each reaches the other, over any number of links.
    """

    label: NDArray[np.int64]
    """(N,): the component of each running agent; -1 for the others."""
    hops: int
    """The diameter D: the most hops between two agents of a component."""
    loss: float
    """The share of frames that is lost on the worst link that holds a component together."""
    lossy: bool
    """Whether some frames are lost on a link within a component, and some are not."""
    closed: NDArray[np.bool_]
    """(C,): of each component, whether its agents hear none of another, and take part."""
    hears: NDArray[np.bool_]
    """(N, N): whether the agent of the row hears beacons of the agent of the column."""

    def members(self) -> list[list[int]]:
        """Return the rows of each component."""
        found: list[list[int]] = [[] for _ in range(int(self.label.max(initial=-1)) + 1)]
        for row, label in enumerate(self.label.tolist()):
            if label >= 0:
                found[label].append(row)
        return found

    def same_as(self, other: "Components") -> bool:
        """Return whether the same agents hear of each other."""
        alike = np.array_equal(self.label, other.label)
        return alike and np.array_equal(self.closed, other.closed)


class Spreads(NamedTuple):
    """Whether what agents send reaches the whole team, over each channel."""

    local: bool
    """Whether beacons join all agents, over any number of links."""
    multihop: bool
    """Whether news reaches all in a bounded time."""


class Connectivity:
    """The connectivity of the running agents under the radio conditions in force."""

    def __init__(self, scenario: Scenario) -> None:
        self._slack_s = 2.0 / scenario.fleet.tick_hz
        """Within this time of being due, a frame is received [s]."""
        self._round_s = 1.0 / scenario.comms.multihop_hz if scenario.comms.multihop_hz else inf
        self._frames_hz = scenario.comms.local_hz, scenario.comms.multihop_hz
        self._stale_after_s: list[float] = []
        """Of each channel, see _stale_after_s, since the conditions last changed that."""
        self._stale_from_s: list[float] = []
        """Of each channel, when that is [s]."""
        self._rows = range(scenario.rows)
        self._network = NetworkConditions(scenario.netem)
        self._clocks = ClockLinks(scenario.rows, self._slack_s)
        self._displaced: set[tuple[int, int | None]] = set()
        """Faults, by number and agent, by which others take a vehicle for an unidentified one."""
        self._waits_s: dict[tuple[int, int | None], float] = {}
        """How long news may wait in an agent by a fault, by the fault's number and agent [s]."""
        self._held_up_s = 0.0
        """The longest of these [s]."""
        self._found: Components | None = None
        """The newest components, and below what they were computed from."""
        self._found_of: tuple[bytes, ...] = ()
        self._refresh()

    def handle_event(self, event: RadioRunEvent) -> None:
        """Apply the radio fault that an event reports."""
        self._network.apply(order_of(event))
        self._refresh(event.t_s)

    def handle_agent_fault(self, event: AgentFaultRunEvent) -> None:
        """Take the beginning or the end of a fault of an agent."""
        match event:
            case ClockChanged():
                self._clocks.handle_event(event)
            case PoseChanged():
                self._note_displaced(event)
            case SlowChanged(delay_s=delay_s):
                self._note_held_up(event, 2.0 * delay_s if delay_s <= LONGEST_STEP_S else inf)
            case Starved(stops_s=stops_s):
                self._note_held_up(event, 2.0 * stops_s if stops_s <= LONGEST_STOP_S else inf)
            case _:
                assert_never(event)

    def _note_displaced(self, event: PoseChanged) -> None:
        if event.ends:
            self._displaced.discard((event.number, event.agent))
        elif event.displaces_m > SAME_VEHICLE_M:
            self._displaced.add((event.number, event.agent))

    def _note_held_up(self, event: SlowChanged | Starved, waits_s: float) -> None:
        """Note for how long news may wait in an agent by a fault [s], or that it has ended."""
        key = event.number, event.agent
        if event.ends:
            self._waits_s.pop(key, None)
        else:
            self._waits_s[key] = waits_s
        self._held_up_s = max(self._waits_s.values(), default=0.0)

    def components(self, tick: Tick) -> Components:
        """Return the connected components at a tick; the same object while no link changes."""
        distance, usable = self._links(tick.position, tick.alive)
        heard = usable & (self._lost_over(LOCAL, distance) < 1.0)
        if self._clocks:
            passing = self._clocks.passing(heard, tick.time_s, self._in_flight_s)
            usable, heard = usable & passing, heard & passing
        lost = np.where(usable, self._lost_over(MULTIHOP, distance), 1.0)
        silent = self._clocks.silent
        of = lost.tobytes(), heard.tobytes(), tick.alive.tobytes(), silent.tobytes()
        if self._found is None or of != self._found_of:
            self._found, self._found_of = _found(lost, heard, tick.alive, silent), of
        return self._found

    def heard(self, tick: Tick) -> NDArray[np.bool_]:
        """Return over which links beacons get through at a tick (N, N), from row to column."""
        distance, usable = self._links(tick.position, tick.alive)
        heard: NDArray[np.bool_] = usable & (self._lost_over(LOCAL, distance) < 1.0)
        return heard

    def groups(self, position: Floats, alive: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Return the group of agents (N,) in which beacons of each come to each; -1 for the others.

        position (N, 3) [m; world frame]; alive: the agents that take part.
        """
        distance, usable = self._links(position, alive)
        linked = usable & (self._lost_over(LOCAL, distance) < 1.0)
        return _labels(_reached(_neighbours(linked)).rows, alive)

    def spreads(self, tick: Tick) -> Spreads:
        """Return over which channels the running agents hear of each other at a tick."""
        found = self.components(tick)
        agents = int(np.count_nonzero(tick.alive))
        bounded = self.dissemination_s(agents, found.hops, found.loss) < inf
        groups = self.groups(tick.position, tick.alive)
        return Spreads(
            local=tick.time_s < self._stale_from_s[LOCAL] and int(groups.max(initial=0)) == 0,
            multihop=(
                tick.time_s < self._stale_from_s[MULTIHOP]
                and bounded
                and int(found.label.max(initial=0)) == 0
            ),
        )

    def dissemination_s(self, agents: int, hops: int, loss: float | None = None) -> float:
        """Return B [s]: a record reaches every agent in this time, with probability 1 - 1e-6.

        loss: of the worst link; None: of a link without values of its own, within range. Infinite
        while links flap, delays decide whether stamps are accepted, or a vehicle is elsewhere than
        its agent says: there is no bound.
        """
        if self._network.flapping or self._clocks.unclear or self._displaced:
            return inf
        lost = self.loss if loss is None else loss
        rounds = rounds_to_all(agents, hops, lost) * self._burst_factor if hops else 0.0
        round_s = self._round_s + self._held_up_s
        return max(LEAST_NEWS_S, rounds * round_s + hops * (self._delay_s + self._held_up_s))

    def detection_s(self, hops: int, loss: float | None = None) -> float:
        """Return T_d [s]: the team knows within this time that an agent is gone."""
        lost = self.loss if loss is None else loss
        rounds = (2 * hops + 10) / (1.0 - lost) if lost < 1.0 else inf
        round_s = self._round_s + self._held_up_s
        return max(LEAST_DETECTION_S, rounds * round_s + hops * (self._delay_s + self._held_up_s))

    def _refresh(self, now_s: float = 0.0) -> None:
        """Derive loss, delay and cuts from the conditions and partitions in force.

        now_s: since when they hold [s].
        """
        models = self._network.models
        self.loss = unusable_share(models.of_channel(MULTIHOP), 0.0)
        """Share of multihop frames that a link loses within range."""
        multihop = models.of_any_link(MULTIHOP)
        self._burst_factor = max(1.0, *map(burst_variance_factor, multihop))
        self._delay_s = max(map(_longest_delay_s, multihop))
        stale_s = [
            max(_stale_after_s(link, hz, size_b) for link in models.of_any_link(at))
            for at, (hz, size_b) in enumerate(zip(self._frames_hz, LEAST_FRAME_B, strict=True))
        ]
        if stale_s != self._stale_after_s:
            self._stale_after_s = stale_s
            self._stale_from_s = [now_s + each_s for each_s in stale_s]
        links = [link for at in range(len(CHANNELS)) for link in models.of_any_link(at)]
        queued_s = max(map(_longest_queued_s, links))
        self._in_flight_s = max(map(_longest_delay_s, links)) + queued_s + self._slack_s
        """The longest time that a frame is in flight where no queue grows [s]."""
        self.longest_s = inf
        """The same; infinite for a radio without queues [s]."""
        if queued_s > 0.0:
            self.longest_s = self._in_flight_s
        rows = self._rows
        cut = [[self._network.partitions(a, b) for b in rows] for a in rows]
        self._cut = np.array(cut, dtype=np.bool_)

    def _links(
        self, position: Floats, alive: NDArray[np.bool_]
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the distance (N, N) [m] of each link, and whether frames may get over it.

        None gets from an agent to itself. position (N, 3) [m; world frame].
        """
        square = np.zeros((len(position), len(position)))
        for axis in position.T:
            away = axis[:, None] - axis
            square += away * away
        usable = ~self._cut & alive[:, None] & alive
        if self._network.obstructed:
            free = [not self._network.jammed((x, y, z)) for x, y, z in position.tolist()]
            usable &= np.outer(free, free)
        np.fill_diagonal(usable, val=False)
        return np.sqrt(square), usable

    def _lost_over(self, channel: int, distance: Floats) -> Floats:
        """Return the share of a channel's frames that links lose over distances (N, N) [m].

        It is 1 where no frame gets through.
        """
        models, common = self._network.models, self._network.models.of_channel(channel)
        within, share = distance <= common.reach_m, unusable_share(common, 0.0)
        lost = np.where(within, share, 1.0)
        if common.path_loss is not None:
            lost[within] = [unusable_share(common, each) for each in distance[within].tolist()]
        if not models.alike(channel):
            for a in self._rows:
                if models.common(channel, a) is None:
                    own = [models.of_link(channel, a, b) for b in self._rows]
                    lost[a] = list(map(unusable_share, own, distance[a].tolist()))
        return lost


@cache
def rounds_to_all(agents: int, hops: int, loss: float) -> float:
    """Return the least t with N^2 P(Bin(t, 1 - p) < D) <= 1e-6; infinite from MAX_ROUNDS on."""
    if hops == 0:
        return 0
    if loss >= 1.0:
        return inf
    for rounds in range(hops, MAX_ROUNDS):
        late = sum(comb(rounds, k) * (1.0 - loss) ** k * loss ** (rounds - k) for k in range(hops))
        if agents * agents * late <= 1e-6:
            return rounds
    return inf


def _longest_delay_s(model: LinkModel) -> float:
    """Return the longest delay on a link [s]."""
    widest = 1.0 if model.distribution == "uniform" else MAX_QUANTILE
    return (model.delay_ms + widest * model.jitter_ms) / 1000.0


def _least_delay_s(model: LinkModel) -> float:
    """Return the least delay on a link [s]."""
    widest = 1.0 if model.distribution == "uniform" else MAX_QUANTILE
    return (model.delay_ms - widest * model.jitter_ms) / 1000.0


def _stale_after_s(model: LinkModel, frames_hz: float, size_b: int) -> float:
    """Return after which time every frame that comes over a link is too old to be accepted [s].

    0: at once, for its delay or its time on the air; infinite: never. Where frames_hz frames of
    size_b [B] a second are more than the rate carries, the queue grows, up to its limit: a frame
    that leaves it at t was sent at t / load.
    """
    left_s = MAX_AGE_S - max(0.0, _least_delay_s(model))
    on_air_s = 8.0 * (size_b + model.rate_overhead_b) / (1000.0 * model.rate_kbit)
    if on_air_s > left_s:
        return 0.0
    load = frames_hz * on_air_s
    if load <= 1.0 or model.limit * on_air_s <= left_s:
        return inf
    return left_s / (1.0 - 1.0 / load)


def _longest_queued_s(model: LinkModel) -> float:
    """Return how long a frame may wait for others and be on the air [s]; 0 without a queue."""
    size_bit = 8.0 * (MAX_PAYLOAD_B + model.rate_overhead_b)
    return min(MAX_QUEUED_S, size_bit / (1000.0 * model.rate_kbit))


def _found(
    lost: Floats, heard: NDArray[np.bool_], alive: NDArray[np.bool_], silent: NDArray[np.bool_]
) -> Components:
    """Return the components where links lose these shares, and beacons are heard over some.

    lost, heard: (N, N), from row to column. alive: (N,), the running agents; silent: (N,), those of
    them that take no part.
    """
    reached = _reached(_neighbours(lost < 1.0))
    label = _labels(reached.rows, alive)
    inside = label[:, None] == label
    within = lost[(lost < 1.0) & inside]
    losses = np.array(sorted(set(within.tolist())))
    loss = _weakest(lost, label, losses)
    if len(losses) > 1 or not inside.all():
        reached = _reached(_neighbours((lost <= loss) & inside))
    foreign = (heard | (lost < 1.0)) & ~inside
    closed = np.ones(int(label.max(initial=-1)) + 1, dtype=np.bool_)
    closed[label[(foreign.any(axis=0) | silent) & alive]] = False
    return Components(label, reached.hops, loss, bool(within.any()), closed, heard.T)


class _Reached(NamedTuple):
    """Which agents each agent reaches over any number of links."""

    rows: list[int]
    """Of each agent, itself included; bit j: agent j."""
    hops: int
    """The most hops from one agent to another that it reaches."""


def _neighbours(linked: NDArray[np.bool_]) -> list[list[int]]:
    """Return the agents to which frames of each get through. linked: (N, N), row to column."""
    found: list[list[int]] = [[] for _ in range(len(linked))]
    rows, columns = np.nonzero(linked)
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        found[row].append(column)
    return found


def _reached(neighbours: list[list[int]]) -> _Reached:
    """Return which agents each reaches: one hop farther in each round, for all at once."""
    rows, hops = [1 << row for row in range(len(neighbours))], 0
    while True:
        farther = []
        for row, found in enumerate(neighbours):
            reached = rows[row]
            for each in found:
                reached |= rows[each]
            farther.append(reached)
        if farther == rows:
            return _Reached(rows, hops)
        rows, hops = farther, hops + 1


def _labels(reached: list[int], alive: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the strongly connected component of each running agent (N,), -1 for the others."""
    label, count = [-1] * len(reached), 0
    running = np.flatnonzero(alive).tolist()
    for row in running:
        if label[row] >= 0:
            continue
        for other in running:
            if reached[row] >> other & 1 and reached[other] >> row & 1:
                label[other] = count
        count += 1
    return np.array(label, dtype=np.int64)


def _weakest(lost: Floats, label: NDArray[np.int64], losses: Floats) -> float:
    """Return the loss of the worst link that holds a component together; 0 without any.

    It is the least of ``losses`` at which links that lose no more hold all components together.
    lost: share of frames lost on each link, from row to column (N, N).
    """
    low, high = 0, len(losses) - 1
    while low < high:
        middle = (low + high) // 2
        reached = _reached(_neighbours(lost <= losses[middle])).rows
        if np.array_equal(_labels(reached, label >= 0), label):
            high = middle
        else:
            low = middle + 1
    return float(losses[high]) if len(losses) else 0.0
