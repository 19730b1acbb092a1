"""Timelines of states: the team's phase, the radio's condition, and what is wrong with agents.

Each has a row where its state changes.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from worldsim.judge.network_strength import algebraic_connectivity
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures
from worldsim.recording import layout
from worldsim.recording.columns import ColumnBlock
from worldsim.recording.components import SCALARS, STATES
from worldsim.recording.situation import Situation

NO_FORMATION = "no formation"
CLEAR, JAMMED, PARTED = "clear", "jam", "partition"
RUNNING = "running"
LAMBDA2_HZ = 4.0
"""Of more than NAMED_MAX agents it would take more time than all else that is recorded."""


class StateColumns:
    """Makes the columns of one block of ticks after the other; formation: the first one's name."""

    def __init__(self, tick_hz: float, agents: int, formation: str) -> None:
        self._formation = formation
        self._named = min(agents, layout.NAMED_MAX)
        self._small = agents <= layout.NAMED_MAX
        samples_hz = LAMBDA2_HZ if agents <= layout.FEW_MAX else 0.5 * LAMBDA2_HZ
        self._ticks_per_sample = max(1, round(tick_hz / samples_hz))
        self._shown: dict[str, str] = {}
        self._noted = False
        """Whether anything has been wrong with an agent."""
        self._links = b""
        self._lambda2: float | None = None

    def begin_phase(self, formation: str) -> None:
        """Take the name of a new mission's formation, before the block of its ticks."""
        self._formation = formation

    def blocks(
        self,
        ticks: Sequence[Tick],
        figures: Sequence[Figures],
        situations: Sequence[Situation],
    ) -> Iterator[ColumnBlock]:
        """Yield the columns of a block; blocks come in order."""
        pairs = zip(ticks, figures, strict=True)
        phases = [self._phase(tick, each) for tick, each in pairs]
        yield from self._states(layout.TEAM_PHASE, phases)
        radio = {id(each): _radio(each) for each in situations}
        yield from self._states(layout.RADIO_CONDITION, [radio[id(each)] for each in situations])
        noted = any(any(each.notes) for each in {id(each): each for each in situations}.values())
        self._noted = self._noted or noted
        for agent in range(self._named if self._noted else 0):
            yield from self._conditions(agent, situations)

    def _phase(self, tick: Tick, figures: Figures) -> str:
        if not (tick.place >= 0).any():
            return NO_FORMATION
        return f"{'in' if figures.converged else 'forming'} {self._formation}"

    def _states(self, entity: str, states: Sequence[str]) -> Iterator[ColumnBlock]:
        rows = []
        for row, state in enumerate(states):
            if state != self._shown.get(entity):
                self._shown[entity] = state
                rows.append(row)
        if rows:
            yield ColumnBlock(entity, rows, [STATES.rows([states[row] for row in rows])])

    def _conditions(self, agent: int, situations: Sequence[Situation]) -> Iterator[ColumnBlock]:
        """Yield what is wrong with an agent, from the first time that anything is."""
        entity, states = layout.condition_entity(agent), [each.notes[agent] for each in situations]
        if entity in self._shown or any(states):
            yield from self._states(entity, [state or RUNNING for state in states])

    def connectivity(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Yield lambda_2 of the running agents, of which two are linked if each hears the other.

        At the sampled ones of some ticks; of small fleets only.
        """
        sampled = self._ticks_per_sample
        rows = [row for row, tick in enumerate(ticks) if self._small and tick.index % sampled == 0]
        values = [self._lambda2_of(ticks[row]) for row in rows]
        if rows:
            found = np.array([np.nan if each is None else each for each in values])
            yield ColumnBlock(layout.LAMBDA2, rows, [SCALARS.rows(found[:, None])])

    def _lambda2_of(self, tick: Tick) -> float | None:
        key = tick.links.tobytes() + tick.alive.tobytes()
        if key != self._links:
            agents = len(tick.alive)
            hearer, heard = tick.links[(tick.links < agents).all(axis=1)].T
            hears = np.zeros((agents, agents), dtype=np.bool_)
            hears[hearer, heard] = True
            linked = (hears & hears.T)[np.ix_(tick.alive, tick.alive)]
            self._links, self._lambda2 = key, algebraic_connectivity(linked)
        return self._lambda2


def _radio(situation: Situation) -> str:
    """Return what is wrong with the radio."""
    states = [PARTED] * situation.parted + [JAMMED] * bool(situation.jams)
    return ", ".join([*states, *situation.radio.faults]) or CLEAR
