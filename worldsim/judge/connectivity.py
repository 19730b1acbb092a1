"""Radio connectivity of the team: components, hops, and the time that news takes to spread.

Computed from the truth: positions, link conditions and radio faults in force. Two agents are linked
where each can receive the other. A round is one period of the multihop channel.
"""

from functools import cache
from math import comb, inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from netem.conditions import NetworkConditions
from netem.link import burst_variance_factor, mean_loss
from netem.random_draws import MAX_QUANTILE
from netem.wire.channels import MULTIHOP
from worldsim.judge.radio_events import RadioRunEvent, order_of
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import Scenario

MAX_ROUNDS = 2000
"""More rounds count as infinitely many."""


class Components(NamedTuple):
    """The connected components of the running agents."""

    label: NDArray[np.int64]
    """(N,): the component of each running agent; -1 for the others."""
    hops: int
    """The diameter D: the most hops between two agents of a component."""

    def members(self) -> list[list[int]]:
        """Return the rows of each component."""
        found: list[list[int]] = [[] for _ in range(int(self.label.max(initial=-1)) + 1)]
        for row, label in enumerate(self.label.tolist()):
            if label >= 0:
                found[label].append(row)
        return found


class Connectivity:
    """The connectivity of the running agents under the radio conditions in force."""

    def __init__(self, scenario: Scenario) -> None:
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
        linked = self._linked(tick)
        label = np.full(len(tick.alive), -1)
        hops = count = 0
        for row in np.flatnonzero(tick.alive).tolist():
            distance = _hops_from(row, linked)
            hops = max(hops, int(distance.max()))
            if label[row] < 0:
                label[distance >= 0] = count
                count += 1
        return Components(label, hops)

    def dissemination_s(self, agents: int, hops: int) -> float:
        """Return B [s]: a record reaches every agent in this time, with probability 1 - 1e-6.

        Infinite while links flap: there is no bound.
        """
        if self._network.flapping:
            return inf
        rounds = rounds_to_all(agents, hops, self.loss) * self._burst_factor
        return rounds * self._round_s + hops * self._delay_s

    def detection_s(self, hops: int) -> float:
        """Return T_d [s]: the team knows within this time that an agent is gone."""
        rounds = (2 * hops + 10) / (1.0 - self.loss) if self.loss < 1.0 else inf
        return rounds * self._round_s + hops * self._delay_s

    def _refresh(self) -> None:
        """Derive loss, delay, range and cuts from the conditions and partitions in force."""
        model = self._network.models.of_channel(MULTIHOP)
        self.loss = mean_loss(model)
        """Share of multihop frames that a link loses."""
        self._burst_factor = max(1.0, burst_variance_factor(model))
        self._range_m = model.range_m
        widest = 1.0 if model.distribution == "uniform" else MAX_QUANTILE
        self._delay_s = (model.delay_ms + widest * model.jitter_ms) / 1000.0
        rows = self._rows
        hears = np.array([[not self._network.partitions(a, b) for a in rows] for b in rows])
        self._uncut = hears & hears.T

    def _linked(self, tick: Tick) -> NDArray[np.bool_]:
        """Return which pairs of running agents are linked (N, N)."""
        position = tick.position
        away = position[:, None] - position[None]
        near = np.sqrt(np.sum(away * away, axis=2)) <= self._range_m
        near &= self._uncut
        if self._network.obstructed:
            free = [not self._network.jammed((x, y, z)) for x, y, z in position.tolist()]
            near &= np.outer(free, free)
        linked: NDArray[np.bool_] = near & tick.alive[:, None] & tick.alive[None]
        return linked


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
