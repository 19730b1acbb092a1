"""Where agents take their neighbours to be, beside the truth: a line for each, and how far off.

An agent extrapolates each neighbour from its last beacon: the worse the radio, the longer the
lines.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from agent.messages import Believed
from worldsim.judge.tick import Tick
from worldsim.recording import layout
from worldsim.recording.columns import ColumnBlock
from worldsim.recording.components import SCALARS, STRIPS
from worldsim.scenario.tables import SLOTS_PER_TICK
from worldsim.truth.vehicle import Floats

LEAST_M = 0.05
"""A shorter line would be hidden by its vehicle."""
LINES_MAX = 200
"""Of more, the longest are drawn."""


class BeliefColumns:
    """Makes the columns of one block of ticks after the other; agents: rows of the world."""

    def __init__(self, agents: int) -> None:
        self._agents = agents
        self._told: dict[int, dict[int, tuple[int, Believed]]] = {}
        """By tick and agent: the slot, and what it believed."""
        self._drawn = False

    def keep(self, agent: int, slot: int, believed: Believed) -> None:
        """Keep what an agent tells at a slot."""
        self._told.setdefault(slot // SLOTS_PER_TICK, {})[agent] = (slot, believed)

    def blocks(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Yield the columns of a block; blocks come in order."""
        rows, strips, errors = [], [], []
        for row, tick in enumerate(ticks):
            told = self._told.pop(tick.index, None)
            if told is not None:
                after = ticks[row + 1] if row + 1 < len(ticks) else tick
                lines, worst = self._lines(tick, after, told)
                rows.append(row)
                strips.append(lines)
                errors.append(worst)
        self._told = {index: each for index, each in self._told.items() if index > ticks[-1].index}
        if rows:
            yield ColumnBlock(layout.BELIEF_ERROR, rows, [SCALARS.rows(np.stack(errors))])
            lengths = [len(each) for each in strips]
            if any(lengths) or self._drawn:
                columns = [STRIPS.parts(np.concatenate(strips), lengths)]
                yield ColumnBlock(layout.BELIEFS, rows, columns)
            self._drawn = bool(lengths[-1])

    def _lines(
        self, tick: Tick, after: Tick, told: dict[int, tuple[int, Believed]]
    ) -> tuple[Floats, Floats]:
        """Return lines from the truth to what is believed (K, 2, 3), and each agent's worst (N,).

        The truth is that of the slot, between two ticks. NaN for an agent that hears nobody.
        """
        worst = np.full(self._agents, np.nan)
        ends = []
        for agent, (slot, believed) in sorted(told.items()):
            share = slot % SLOTS_PER_TICK / SLOTS_PER_TICK
            there = [(other, at) for other, at in believed if other < self._agents]
            others = [other for other, _ in there]
            true = (1.0 - share) * tick.position[others] + share * after.position[others]
            off = np.array([at for _, at in there]).reshape(-1, 3)
            error = np.linalg.norm(off - true, axis=1)
            if np.isfinite(error).any():
                worst[agent] = np.nanmax(error)
            seen = error > LEAST_M
            ends.append(np.stack((true[seen], off[seen]), axis=1))
        lines = np.concatenate(ends)
        if len(lines) > LINES_MAX:
            length = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
            lines = lines[np.argpartition(length, -LINES_MAX)[-LINES_MAX:]]
        return lines, worst
