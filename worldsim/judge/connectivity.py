"""Radio connectivity of the team: components, hops, and the time that news takes to spread.

Computed from the truth: positions, link conditions and radio faults in force, link by link. A round
is one period of the multihop channel, on which agents pass on what they hear.
"""

from functools import cache
from math import comb, inf
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.assignment.slot_selection import ALONE_S
from agent.comms.gossip import LEAST_RELAYED_SILENCE_S
from netem.conditions import NetworkConditions
from netem.link import burst_variance_factor, unusable_share
from netem.link_model import LinkModel
from netem.random_draws import MAX_QUANTILE
from netem.wire.channels import CHANNELS, LOCAL, MAX_PAYLOAD_B, MULTIHOP
from worldsim.judge.radio_events import RadioRunEvent, order_of
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
    """(C,): of each component, whether its agents hear none of another."""
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


class Connectivity:
    """The connectivity of the running agents under the radio conditions in force."""

    def __init__(self, scenario: Scenario) -> None:
        self._slack_s = 2.0 / scenario.fleet.tick_hz
        """Within this time of being due, a frame is received [s]."""
        self._round_s = 1.0 / scenario.comms.multihop_hz if scenario.comms.multihop_hz else inf
        self._rows = range(scenario.rows)
        self._network = NetworkConditions(scenario.netem)
        self._refresh()

    def handle_event(self, event: RadioRunEvent) -> None:
        """Apply the radio fault that an event reports."""
        self._network.apply(order_of(event))
        self._refresh()

    def components(self, tick: Tick) -> Components:
        """Return the connected components at a tick."""
        lost = self._lost(MULTIHOP, tick.position, tick.alive)
        label = _components(lost < 1.0, tick.alive)
        within = lost[(lost < 1.0) & (label[:, None] == label)]
        loss = _weakest(lost, label, np.unique(within))
        linked = (lost <= loss) & (label[:, None] == label)
        rows = np.flatnonzero(tick.alive).tolist()
        hops = max((int(_hops_from(row, linked).max()) for row in rows), default=0)
        heard = self._lost(LOCAL, tick.position, tick.alive) < 1.0
        foreign = (heard | (lost < 1.0)) & (label[:, None] != label)
        open_ = np.unique(label[foreign.any(axis=0)])
        closed = ~np.isin(np.arange(label.max(initial=-1) + 1), open_)
        return Components(label, hops, loss, bool(within.any()), closed, heard.T)

    def groups(self, position: Floats, alive: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Return the group of agents (N,) in which beacons of each come to each; -1 for the others.

        position (N, 3) [m; world frame]; alive: the agents that take part.
        """
        return _components(self._lost(LOCAL, position, alive) < 1.0, alive)

    def dissemination_s(self, agents: int, hops: int, loss: float | None = None) -> float:
        """Return B [s]: a record reaches every agent in this time, with probability 1 - 1e-6.

        loss: of the worst link; None: of a link without values of its own, within range. Infinite
        while links flap: there is no bound.
        """
        if self._network.flapping:
            return inf
        lost = self.loss if loss is None else loss
        rounds = rounds_to_all(agents, hops, lost) * self._burst_factor if hops else 0.0
        return max(LEAST_NEWS_S, rounds * self._round_s + hops * self._delay_s)

    def detection_s(self, hops: int, loss: float | None = None) -> float:
        """Return T_d [s]: the team knows within this time that an agent is gone."""
        lost = self.loss if loss is None else loss
        rounds = (2 * hops + 10) / (1.0 - lost) if lost < 1.0 else inf
        return max(LEAST_DETECTION_S, rounds * self._round_s + hops * self._delay_s)

    def _refresh(self) -> None:
        """Derive loss, delay and cuts from the conditions and partitions in force."""
        models = self._network.models
        self.loss = unusable_share(models.of_channel(MULTIHOP), 0.0)
        """Share of multihop frames that a link loses within range."""
        multihop = models.of_any_link(MULTIHOP)
        self._burst_factor = max(1.0, *map(burst_variance_factor, multihop))
        self._delay_s = max(map(_longest_delay_s, multihop))
        links = [link for at in range(len(CHANNELS)) for link in models.of_any_link(at)]
        queued_s = max(map(_longest_queued_s, links))
        self.longest_s = inf
        """The longest time that a frame is in flight where no queue grows [s]; infinite for a radio
        without queues."""
        if queued_s > 0.0:
            self.longest_s = max(map(_longest_delay_s, links)) + queued_s + self._slack_s
        rows = self._rows
        cut = [[self._network.partitions(a, b) for b in rows] for a in rows]
        self._cut = np.array(cut, dtype=np.bool_)

    def _lost(self, channel: int, position: Floats, alive: NDArray[np.bool_]) -> Floats:
        """Return the share of a channel's frames that each link loses, from row to column (N, N).

        It is 1 where no frame gets through, and to the agent itself.
        """
        away = position[:, None] - position[None]
        distance = np.sqrt(np.sum(away * away, axis=2))
        lost = self._lost_over(channel, distance)
        usable = ~self._cut & alive[:, None] & alive
        if self._network.obstructed:
            free = [not self._network.jammed((x, y, z)) for x, y, z in position.tolist()]
            usable &= np.outer(free, free)
        np.fill_diagonal(usable, val=False)
        return np.where(usable, lost, 1.0)

    def _lost_over(self, channel: int, distance: Floats) -> Floats:
        """Return the share of a channel's frames that links lose over distances (N, N) [m]."""
        models, common = self._network.models, self._network.models.of_channel(channel)
        if models.alike(channel) and common.path_loss is None:
            return np.where(distance <= common.reach_m, unusable_share(common, 0.0), 1.0)
        rows = distance.tolist()
        return np.array(
            [
                [unusable_share(models.of_link(channel, a, b), rows[a][b]) for b in self._rows]
                for a in self._rows
            ]
        )


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


def _longest_queued_s(model: LinkModel) -> float:
    """Return how long a frame may wait for others and be on the air [s]; 0 without a queue."""
    size_bit = 8.0 * (MAX_PAYLOAD_B + model.rate_overhead_b)
    return min(MAX_QUEUED_S, size_bit / (1000.0 * model.rate_kbit))


def _components(linked: NDArray[np.bool_], alive: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the strongly connected component of each running agent (N,), -1 for the others.

    linked: whether frames get through, from row to column (N, N).
    """
    reaches = linked | np.eye(len(linked), dtype=np.bool_)
    for _ in range(len(linked).bit_length()):
        # Counts of paths: exact in single precision, and far faster than booleans.
        paths = reaches.astype(np.float32)
        reaches = paths @ paths > 0.0
    mutual = reaches & reaches.T
    first = np.where(alive, np.argmax(mutual, axis=1), -1)
    label = np.searchsorted(np.unique(first[alive]), first)
    return np.where(alive, label, -1)


def _weakest(lost: Floats, label: NDArray[np.int64], losses: Floats) -> float:
    """Return the loss of the worst link that holds a component together; 0 without any.

    It is the least of ``losses`` at which links that lose no more hold all components together.
    lost: share of frames lost on each link, from row to column (N, N).
    """
    low, high = 0, len(losses) - 1
    while low < high:
        middle = (low + high) // 2
        if np.array_equal(_components(lost <= losses[middle], label >= 0), label):
            high = middle
        else:
            low = middle + 1
    return float(losses[high]) if len(losses) else 0.0


def _hops_from(row: int, linked: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the number of hops from a row to each row (N,); -1 where there is no path."""
    distance = np.full(len(linked), -1)
    frontier = np.zeros(len(linked), dtype=np.bool_)
    frontier[row], hops = True, 0
    while frontier.any():
        distance[frontier] = hops
        frontier = linked[frontier].any(axis=0) & (distance < 0)
        hops += 1
    return distance
