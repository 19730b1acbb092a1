"""How agents stand in their queues, as sheets: tiers, parents, roles, and what they know of whom.

Roles and labels have a row where they changed; figures are taken four times a second.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from agent.comms.hierarchy import DISTRESS, SUB_VERTEX, VERTEX
from agent.messages import ROLES
from worldsim.judge.tick import Singles, Standings, Tick
from worldsim.judge.verdict import Figures
from worldsim.recording import layout, palette
from worldsim.recording.columns import ColumnBlock, Latest, Thinned, strips_of

SAMPLES_HZ = 4.0
LINES_PER_S = 500
"""More lines than these in a second are drawn less often."""
ABSENT = "absent"


class StandingSheets:
    """Makes the sheets of one block of ticks after the other.

    tick_hz: ticks in a second; agents: rows; queues: the most that any formation of the run has.
    """

    def __init__(self, tick_hz: float, agents: int, queues: int) -> None:
        self._names = layout.names_of(agents)
        self._queues = queues
        self._every = max(1, round(tick_hz / SAMPLES_HZ))
        self._lines = Thinned(tick_hz, LINES_PER_S)
        self._labels = Latest()
        self._roles = Latest()

    def of(self, ticks: Sequence[Tick], figures: Sequence[Figures]) -> Iterator[ColumnBlock]:
        """Return the sheets of a block; blocks come in order."""
        yield from self._labelled(ticks)
        yield from self._residuals(ticks, figures)
        standings = [tick.standings for tick in ticks if tick.standings is not None]
        if len(standings) == len(ticks):
            yield from self._hierarchy(ticks, standings)
            yield from self._told(ticks, standings)
            yield from self._lanes(standings)

    def _labelled(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Return vehicles' names, with what sets an agent apart from a plain member.

        Where they are not shown unless one is pointed at, once a block is enough.
        """
        keys = np.stack([_standing_keys(tick) for tick in ticks])
        rows = self._labels.changes(keys)
        if len(self._names) > layout.NAMED_MAX:
            rows = rows[-1:]
        if rows:
            labels = [label for row in rows for label in self._labels_of(keys[row])]
            columns = rr.Boxes3D.columns(labels=labels)
            yield ColumnBlock(
                layout.VEHICLES, rows, columns.partition([len(self._names)] * len(rows))
            )

    def _labels_of(self, keys: NDArray[np.int16]) -> list[str]:
        words = {VERTEX: " vertex", SUB_VERTEX: " sub-vertex {}", DISTRESS: " distress"}
        return [
            name + words.get(role, "").format(tier)
            for name, (role, tier) in zip(self._names, keys.tolist(), strict=True)
        ]

    def _hierarchy(
        self, ticks: Sequence[Tick], standings: Sequence[Standings]
    ) -> Iterator[ColumnBlock]:
        rows, strips, colours = [], [], []
        for row, (tick, standing) in enumerate(zip(ticks, standings, strict=True)):
            if self._lines.due(tick.index):
                ends, tiers = parent_lines(tick, standing)
                rows.append(row)
                strips.append(ends)
                colours.append(palette.of_tiers(tiers))
                self._lines.drawn(tick.index, len(ends))
        if rows:
            columns = rr.LineStrips3D.columns(
                strips=strips_of(np.concatenate(strips)), colors=np.concatenate(colours)
            )
            yield ColumnBlock(
                layout.HIERARCHY, rows, columns.partition([len(some) for some in strips])
            )

    def _told(self, ticks: Sequence[Tick], standings: Sequence[Standings]) -> Iterator[ColumnBlock]:
        rows = self._sampled(ticks)
        agents = len(self._names)
        for entity, series in (
            (layout.TIER, [standings[row].tier for row in rows]),
            (layout.RECORD_AGE, [standings[row].record_age_s for row in rows]),
            (layout.NEIGHBOURS, [_neighbours(ticks[row]) for row in rows]),
        ):
            if rows:
                values = np.concatenate(series).astype(np.float64)
                columns = rr.Scalars.columns(scalars=values)
                yield ColumnBlock(entity, rows, columns.partition([agents] * len(rows)))

    def _residuals(
        self, ticks: Sequence[Tick], figures: Sequence[Figures]
    ) -> Iterator[ColumnBlock]:
        rows = [row for row in self._sampled(ticks) if figures[row].queue_residual is not None]
        values = np.full((len(rows), self._queues), np.nan)
        for at, row in enumerate(rows):
            residual = np.asarray(figures[row].queue_residual)[: self._queues]
            values[at, : len(residual)] = np.where(np.isfinite(residual), residual, np.nan)
        if rows and self._queues:
            columns = rr.Scalars.columns(scalars=values.ravel())
            counts = [self._queues] * len(rows)
            yield ColumnBlock(layout.QUEUE_RESIDUAL, rows, columns.partition(counts))

    def _lanes(self, standings: Sequence[Standings]) -> Iterator[ColumnBlock]:
        """Return each agent's role over time."""
        roles = np.stack([standing.role[: layout.NAMED_MAX] for standing in standings])
        departs = self._roles.departs(roles)
        for agent in map(int, np.flatnonzero(departs.any(axis=0))):
            rows = [int(row) for row in np.flatnonzero(departs[:, agent])]
            words = [role_word(int(role)) for role in roles[rows, agent]]
            yield ColumnBlock(layout.role_of(agent), rows, rr.StateChange.columns(state=words))

    def _sampled(self, ticks: Sequence[Tick]) -> list[int]:
        return [row for row, tick in enumerate(ticks) if tick.index % self._every == 0]


def role_word(role: int) -> str:
    """Return a role's name, also of one who takes no part."""
    return ROLES[role] if role >= 0 else ABSENT


def parent_lines(tick: Tick, standing: Standings) -> tuple[Singles, NDArray[np.int16]]:
    """Return a line from each agent to its parent (K, 2, 3) [m; world frame], and its tier (K,)."""
    parent = standing.parent
    children = np.flatnonzero((parent >= 0) & (parent < len(parent)))
    ends = np.stack((tick.position[children], tick.position[parent[children]]), axis=1)
    there = ~np.isnan(ends).any(axis=(1, 2))
    return ends[there], standing.tier[children[there]]


def _standing_keys(tick: Tick) -> NDArray[np.int16]:
    """Return role and tier (N, 2), -1 where nothing is told of them."""
    if tick.standings is None:
        return np.full((len(tick.alive), 2), -1, dtype=np.int16)
    return np.stack((tick.standings.role.astype(np.int16), tick.standings.tier), axis=1)


def _neighbours(tick: Tick) -> NDArray[np.float64]:
    """Return how many each agent hears directly; NaN for one who takes no part."""
    count = np.bincount(tick.links[:, 0], minlength=len(tick.alive))[: len(tick.alive)]
    return np.where(tick.alive, count, np.nan)
