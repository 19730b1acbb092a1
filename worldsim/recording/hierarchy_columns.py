"""The hierarchy of the queues as columns: labels, roles, parent lines, tiers and residuals.

Labels and roles have a row where they changed. Figures have a row four times a second.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from agent.messages import DISTRESS, MEMBER, ROLES, SUB_VERTEX, VERTEX
from worldsim.judge.tick import NO_ROLE, HierarchyRows, Tick
from worldsim.judge.verdict import Figures
from worldsim.recording import layout, palette
from worldsim.recording.columns import ChangeDetector, ColumnBlock, LineRateLimiter
from worldsim.recording.components import BOX_LABELS, SCALARS, STATES, STRIP_COLOURS, STRIPS
from worldsim.recording.situation import DEAD, Situation
from worldsim.truth.vehicle import Floats

SAMPLES_HZ = 4.0
LINES_PER_S = 500
"""More parent lines in a second are drawn at fewer ticks."""
UNPLACED = -2
"""The role shown of an agent without a place, before any agent of the run has claimed one."""
LABEL_SUFFIXES = {
    NO_ROLE: "",
    UNPLACED: "",
    MEMBER: "",
    SUB_VERTEX: " sub-vertex {tier}",
    VERTEX: " vertex",
    DISTRESS: " distress",
}
"""What follows an agent's name in its vehicle's label, by role."""


class ShownRoles:
    """Tells agents in distress from those of a controller that forms nothing.

    Both report distress: they have no parent in a queue. But where no agent claims a place there is
    no queue.
    """

    def __init__(self) -> None:
        self._claimed = False

    def of(self, tick: Tick) -> Tick:
        """Return a tick with the roles to show; ticks come in order."""
        self._claimed = self._claimed or bool(np.any(tick.place >= 0))
        if self._claimed or tick.hierarchy is None:
            return tick
        role = np.where(tick.hierarchy.role == DISTRESS, UNPLACED, tick.hierarchy.role)
        return replace(tick, hierarchy=replace(tick.hierarchy, role=role.astype(np.int8)))


class HierarchyColumns:
    """Makes the columns of one block of ticks after the other.

    tick_hz: ticks in a second; agents: rows; queues: the most that any formation of the run has.
    """

    def __init__(self, tick_hz: float, agents: int, queues: int) -> None:
        self._names = layout.agent_names(agents)
        self._queues = queues
        self._ticks_per_sample = max(1, round(tick_hz / SAMPLES_HZ))
        self._line_rate = LineRateLimiter(tick_hz, LINES_PER_S)
        self._notes: dict[str, int] = {}
        """The number of each note, in the order in which they came."""
        self._label_changes = ChangeDetector()
        self._small = agents <= layout.NAMED_MAX
        self._sampled: NDArray[np.int16] | None = None
        """What labels of a large fleet are made of, at the first tick of the next figures."""
        self._role_changes = ChangeDetector()

    def blocks(
        self, ticks: Sequence[Tick], situations: Sequence[Situation]
    ) -> Iterator[ColumnBlock]:
        """Yield the columns of a block; blocks come in order."""
        if self._small:
            yield from self._changed_labels(self._label_keys(ticks, situations))
        elif self._sampled is None:
            self._sampled = self._label_keys(ticks[:1], situations[:1])
        hierarchies = [tick.hierarchy for tick in ticks if tick.hierarchy is not None]
        if len(hierarchies) == len(ticks):
            yield from self._parent_lines(ticks, hierarchies)

    def figures(self, ticks: Sequence[Tick], figures: Sequence[Figures]) -> Iterator[ColumnBlock]:
        """Yield agents' and queues' figures at the sampled ones of some ticks, and roles."""
        yield from self._queue_residuals(ticks, figures)
        if self._sampled is not None:
            yield from self._changed_labels(self._sampled)
            self._sampled = None
        yield from self._agent_figures(ticks)
        hierarchies = [tick.hierarchy for tick in ticks if tick.hierarchy is not None]
        if len(hierarchies) == len(ticks):
            yield from self._roles(hierarchies)

    def _changed_labels(self, keys: NDArray[np.int16]) -> Iterator[ColumnBlock]:
        """Yield the vehicles' labels: name, the role where it is not member, and what is in force.

        Large fleets show a label only under the mouse pointer: there they come with the figures.
        """
        rows = self._label_changes.changed_rows(keys)
        if rows:
            labels = [label for row in rows for label in self._labels(keys[row])]
            columns = [BOX_LABELS.rows(labels, len(self._names))]
            yield ColumnBlock(layout.VEHICLES, rows, columns)

    def _label_keys(
        self, ticks: Sequence[Tick], situations: Sequence[Situation]
    ) -> NDArray[np.int16]:
        """Return role, tier, note and presence (T, N, 4), which labels are made of.

        Role and tier are -1 where unknown; presence is 1 of a vehicle in the world, else 0.
        """
        keys = np.full((len(ticks), len(self._names), 4), -1, dtype=np.int16)
        noted: Situation | None = None
        for row, tick, situation in zip(keys, ticks, situations, strict=True):
            if situation is not noted:
                noted = situation
                notes = [self._notes.setdefault(note, len(self._notes)) for note in noted.notes]
                numbers = np.array(notes, dtype=np.int16)
            row[:, 2], row[:, 3] = numbers, np.isfinite(tick.position[:, 0])
            if tick.hierarchy is not None:
                row[:, 0], row[:, 1] = tick.hierarchy.role, tick.hierarchy.tier
        return keys

    def _labels(self, keys: NDArray[np.int16]) -> list[str]:
        """Return a label for each vehicle in the world; the cross of a dead one has its own.

        The viewer would draw the label of any other amid the view.
        """
        notes = list(self._notes)
        labels = []
        for name, (role, tier, note, present) in zip(self._names, keys.tolist(), strict=True):
            said = f" ({notes[note]})" if notes[note] else ""
            hidden = not present or notes[note].startswith(DEAD)
            labels.append("" if hidden else name + LABEL_SUFFIXES[role].format(tier=tier) + said)
        return labels

    def _parent_lines(
        self, ticks: Sequence[Tick], hierarchies: Sequence[HierarchyRows]
    ) -> Iterator[ColumnBlock]:
        rows, strips, colours = [], [], []
        for row, (tick, hierarchy) in enumerate(zip(ticks, hierarchies, strict=True)):
            if self._line_rate.allows(tick.index):
                ends, tiers = parent_lines(tick.position, hierarchy)
                rows.append(row)
                strips.append(ends)
                colours.append(palette.tier_colours(tiers))
                self._line_rate.count(tick.index, len(ends))
        if rows:
            lengths = [len(ends) for ends in strips]
            columns = [
                STRIPS.parts(np.concatenate(strips), lengths),
                STRIP_COLOURS.parts(np.concatenate(colours), lengths),
            ]
            yield ColumnBlock(layout.HIERARCHY, rows, columns)

    def _agent_figures(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        known = {row: ticks[row].hierarchy for row in self._sampled_rows(ticks)}
        hierarchies = {row: each for row, each in known.items() if each is not None}
        rows = list(hierarchies)
        if not rows:
            return
        for entity, series in (
            (layout.TIER, [_tiers(each) for each in hierarchies.values()]),
            (layout.RECORD_AGE, [each.record_age_s for each in hierarchies.values()]),
            (layout.NEIGHBOURS, [_neighbour_counts(ticks[row]) for row in rows]),
            (layout.SAFETY_FILTER, [_filtered(ticks[row]) for row in rows]),
        ):
            yield ColumnBlock(entity, rows, [SCALARS.rows(np.stack(series))])

    def _queue_residuals(
        self, ticks: Sequence[Tick], figures: Sequence[Figures]
    ) -> Iterator[ColumnBlock]:
        rows = [row for row in self._sampled_rows(ticks) if figures[row].queue_residual is not None]
        values = np.full((len(rows), self._queues), np.nan)
        for at, row in enumerate(rows):
            residual = np.asarray(figures[row].queue_residual)[: self._queues]
            values[at, : len(residual)] = np.where(np.isfinite(residual), residual, np.nan)
        if rows and self._queues:
            yield ColumnBlock(layout.QUEUE_RESIDUAL, rows, [SCALARS.rows(values)])

    def _roles(self, hierarchies: Sequence[HierarchyRows]) -> Iterator[ColumnBlock]:
        """Yield each agent's role where it changed, for the first NAMED_MAX agents."""
        roles = np.stack([hierarchy.role[: layout.NAMED_MAX] for hierarchy in hierarchies])
        changed = self._role_changes.changed_values(roles)
        for agent in map(int, np.flatnonzero(changed.any(axis=0))):
            rows = [int(row) for row in np.flatnonzero(changed[:, agent])]
            names = [role_name(int(role)) for role in roles[rows, agent]]
            yield ColumnBlock(layout.role_entity(agent), rows, [STATES.rows(names)])

    def _sampled_rows(self, ticks: Sequence[Tick]) -> list[int]:
        return [row for row, tick in enumerate(ticks) if tick.index % self._ticks_per_sample == 0]


def role_name(role: int) -> str:
    """Return the name of a role that is shown; an agent that is not running is "absent"."""
    unranked = {NO_ROLE: palette.ABSENT, UNPLACED: palette.NO_PLACE}
    return unranked[role] if role in unranked else ROLES[role]


def parent_lines(position: Floats, hierarchy: HierarchyRows) -> tuple[Floats, NDArray[np.int16]]:
    """Return a line from each agent to its parent (K, 2, 3) [m; world frame], and its tier (K,).

    position (N, 3) [m; world frame].
    """
    parent = hierarchy.parent
    children = np.flatnonzero((parent >= 0) & (parent < len(parent)))
    ends = np.stack((position[children], position[parent[children]]), axis=1)
    in_world = ~np.isnan(ends).any(axis=(1, 2))
    return ends[in_world], hierarchy.tier[children[in_world]]


def _tiers(hierarchy: HierarchyRows) -> NDArray[np.float64]:
    """Return the tiers (N,); NaN where there is no queue that could have tiers, or no process."""
    return np.where(np.isin(hierarchy.role, (NO_ROLE, UNPLACED)), np.nan, hierarchy.tier)


def _filtered(tick: Tick) -> NDArray[np.float64]:
    """Return what each agent's safety filter does (N,) [m/s]; NaN where it is not known."""
    unknown = np.full(len(tick.alive), np.nan)
    return unknown if tick.filtered_mps is None else tick.filtered_mps.astype(np.float64)


def _neighbour_counts(tick: Tick) -> NDArray[np.float64]:
    """Return how many agents each agent hears directly (N,); NaN for one that is not running."""
    count = np.bincount(tick.links[:, 0], minlength=len(tick.alive))[: len(tick.alive)]
    return np.where(tick.alive, count, np.nan)
