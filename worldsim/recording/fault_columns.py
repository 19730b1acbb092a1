"""Faults in force as columns: jams, sides of a partition, and stopped vehicles.

Each has rows only while it is in force, and one without anything where it ends.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from worldsim.judge.tick import Tick
from worldsim.recording import layout, palette
from worldsim.recording.columns import ColumnBlock
from worldsim.recording.components import BOX_HALF_SIZES
from worldsim.recording.situation import Situation
from worldsim.truth.vehicle import Floats

RING_RADIUS = 1.9
"""Of the disc that shows a vehicle's side, and below: in radii of the vehicle."""
CROSS_RADIUS = 2.0
LINE_RADIUS = 0.16
CROSS = np.array(
    [[1, 1, 0], [-1, -1, 0], [0, 0, 0], [1, -1, 0], [-1, 1, 0], [0, 0, 0], [0, 0, 1], [0, 0, -1]]
)
"""A cross as one line (8, 3) [its radii]."""

Shown = Callable[[Situation], NDArray[np.bool_]]


class FaultColumns:
    """Makes the columns of one block of ticks after the other; radius_m (N,): of each vehicle."""

    def __init__(self, radius_m: Floats, half_sizes: Floats) -> None:
        self._radius_m = radius_m
        self._half_sizes = half_sizes
        self._shown: dict[str, bytes] = {}
        """What each entity shows; nothing where it is not in here."""

    def blocks(
        self, ticks: Sequence[Tick], situations: Sequence[Situation]
    ) -> Iterator[ColumnBlock]:
        """Yield the columns of a block; blocks come in order."""
        yield from self._bodies(situations)
        yield from self._jams(situations)
        yield from self._sides(ticks, situations)
        yield from self._paused(ticks, situations)
        yield from self._dead(ticks, situations)

    def _bodies(self, situations: Sequence[Situation]) -> Iterator[ColumnBlock]:
        """Yield the vehicles' sizes: a paused one is drawn hollow, by an entity of its own."""
        rows = self._changed(layout.VEHICLES, [each.paused.tobytes() for each in situations])
        if rows:
            sizes = [
                np.where(situations[row].paused[:, None], 0.0, self._half_sizes) for row in rows
            ]
            columns = [BOX_HALF_SIZES.rows(np.stack(sizes))]
            yield ColumnBlock(layout.VEHICLES, rows, columns)

    def _jams(self, situations: Sequence[Situation]) -> Iterator[ColumnBlock]:
        keys = [repr(each.jams).encode() if each.jams else b"" for each in situations]
        rows = self._changed(layout.JAMS, keys)
        if rows:
            jams = [situations[row].jams for row in rows]
            flat = [jam for each in jams for jam in each]
            columns = rr.Ellipsoids3D.columns(
                centers=np.array([jam.centre_m for jam in flat]).reshape(-1, 3),
                half_sizes=np.array([[jam.radius_m] * 3 for jam in flat]).reshape(-1, 3),
            )
            yield ColumnBlock(layout.JAMS, rows, columns.partition([len(each) for each in jams]))

    def _sides(
        self, ticks: Sequence[Tick], situations: Sequence[Situation]
    ) -> Iterator[ColumnBlock]:
        chosen = self._chosen(layout.SIDES, ticks, situations, lambda each: each.side >= 0)
        if chosen:
            rows, agents = list(chosen), list(chosen.values())
            side = [situations[row].side[at] for row, at in chosen.items()]
            half_sizes = self._radius_m[np.concatenate(agents)][:, None] * (
                RING_RADIUS * np.array([1.0, 1.0, 0.02])
            )
            columns = rr.Ellipsoids3D.columns(
                centers=_positions(ticks, chosen),
                half_sizes=half_sizes,
                colors=palette.side_colours(np.concatenate(side)),
            )
            yield ColumnBlock(layout.SIDES, rows, columns.partition([len(at) for at in agents]))

    def _paused(
        self, ticks: Sequence[Tick], situations: Sequence[Situation]
    ) -> Iterator[ColumnBlock]:
        chosen = self._chosen(layout.PAUSED, ticks, situations, lambda each: each.paused)
        if chosen:
            columns = rr.Boxes3D.columns(
                centers=_positions(ticks, chosen),
                half_sizes=1.3 * self._half_sizes[np.concatenate(list(chosen.values()))],
            )
            lengths = [len(at) for at in chosen.values()]
            yield ColumnBlock(layout.PAUSED, list(chosen), columns.partition(lengths))

    def _dead(
        self, ticks: Sequence[Tick], situations: Sequence[Situation]
    ) -> Iterator[ColumnBlock]:
        chosen = self._chosen(layout.DEAD, ticks, situations, lambda each: each.dead)
        if chosen:
            agents = np.concatenate(list(chosen.values()))
            size_m = CROSS_RADIUS * self._radius_m[agents]
            lines = _positions(ticks, chosen)[:, None, :] + size_m[:, None, None] * CROSS
            columns = rr.LineStrips3D.columns(
                strips=list(lines),
                radii=LINE_RADIUS * size_m / CROSS_RADIUS,
                labels=[f"{layout.agent_name(agent)} (dead)" for agent in agents.tolist()],
            )
            lengths = [len(at) for at in chosen.values()]
            yield ColumnBlock(layout.DEAD, list(chosen), columns.partition(lengths))

    def _chosen(
        self,
        entity: str,
        ticks: Sequence[Tick],
        situations: Sequence[Situation],
        shown: Shown,
    ) -> dict[int, NDArray[np.intp]]:
        """Return the agents that an entity shows in the rows in which they, or they move."""
        now = {id(each): each for each in situations}
        if entity not in self._shown and not any(shown(each).any() for each in now.values()):
            return {}
        agents = [
            np.flatnonzero(shown(each) & np.isfinite(tick.position).all(axis=1))
            for tick, each in zip(ticks, situations, strict=True)
        ]
        keys = [
            at.tobytes() + tick.position[at].astype(np.float32).tobytes() if len(at) else b""
            for tick, at in zip(ticks, agents, strict=True)
        ]
        return {row: agents[row] for row in self._changed(entity, keys)}

    def _changed(self, entity: str, keys: Sequence[bytes]) -> list[int]:
        """Return the rows in which what an entity shows is not what it showed; b"": nothing."""
        rows = []
        for row, key in enumerate(keys):
            if key != self._shown.get(entity, b""):
                self._shown[entity] = key
                rows.append(row)
        return rows


def _positions(ticks: Sequence[Tick], chosen: dict[int, NDArray[np.intp]]) -> Floats:
    """Return the positions of the chosen agents of all rows (K, 3) [m; world frame]."""
    return np.concatenate([ticks[row].position[agents] for row, agents in chosen.items()])
