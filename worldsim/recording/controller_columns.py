"""What controllers tell of themselves as columns: their signals and their datagrams."""

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr

from agent.messages import Report
from worldsim.judge.tick import Tick
from worldsim.recording import layout
from worldsim.recording.agent_colours import AgentColours
from worldsim.recording.columns import ColumnBlock
from worldsim.recording.components import SCALARS
from worldsim.recording.static_entities import SERIES_WIDTH
from worldsim.scenario.tables import SLOTS_PER_TICK


class ControllerColumns:
    """Makes the columns of one block of ticks after the other.

    agents: rows of the world; colours: those of the agents' curves.
    """

    def __init__(self, agents: int, colours: AgentColours) -> None:
        self._agents, self._colours = agents, colours
        self.known: list[str] = []
        """The names of the signals so far, in the order in which they came."""
        self._named: set[str] = set()
        """The entities whose series have names."""
        self._told: dict[int, dict[int, Report]] = {}
        """By tick and agent."""

    def keep(self, agent: int, slot: int, report: Report) -> None:
        """Keep what an agent's controller tells at a slot, if it is of datagrams."""
        if report.sent[0] or report.received[0]:
            self._told.setdefault(slot // SLOTS_PER_TICK, {})[agent] = report

    def signals(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Yield each signal at each tick at which any agent states it."""
        for name in sorted({name for tick in ticks for name in tick.signals}):
            rows = [row for row, tick in enumerate(ticks) if name in tick.signals]
            values = np.stack([ticks[row].signals[name] for row in rows])
            if name not in self.known:
                self.known.append(name)
            entity = layout.signal_entity(name)
            yield from self._names(entity)
            yield ColumnBlock(entity, rows, [SCALARS.rows(values)])

    def datagrams(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Yield the bytes sent and received, and the oldest age [s], where there are any."""
        rows = [row for row, tick in enumerate(ticks) if tick.index in self._told]
        values = np.full((3, len(rows), self._agents), np.nan)
        for at, row in enumerate(rows):
            for agent, report in self._told[ticks[row].index].items():
                age_s = report.oldest_s if report.received[0] else np.nan
                values[:, at, agent] = report.sent[1], report.received[1], age_s
        self._told = {index: each for index, each in self._told.items() if index > ticks[-1].index}
        entities = layout.DATAGRAMS_SENT, layout.DATAGRAMS_RECEIVED, layout.DATAGRAM_AGE
        for entity, series in zip(entities, values, strict=True):
            if rows:
                yield from self._names(entity)
                yield ColumnBlock(entity, rows, [SCALARS.rows(series)])

    def _names(self, entity: str) -> Iterator[ColumnBlock]:
        """Yield the names of an entity's series, once."""
        if entity not in self._named:
            self._named.add(entity)
            names = layout.agent_names(self._agents)
            widths, colours = [SERIES_WIDTH] * len(names), self._colours.series()
            styles = rr.SeriesLines.columns(names=names, widths=widths, colors=colours)
            yield ColumnBlock(entity, (), styles.partition([len(names)]))
