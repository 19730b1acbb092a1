"""What agents sense as columns, and the constellation-agents that it bends (Fig. 7 of the paper).

A ray leads from a vehicle to each point that its sensors tell it of, as they do: one whose sensor
is at fault shows the wrong ones. Guiding lines are drawn of vehicles near a surface, computed here
from the same points. Both are hidden by the layout until asked for.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from agent.guidance.constellation import REACH_M, Constellation
from agent.messages import Observation, Vector
from agent.vectors import length
from worldsim.judge.tick import Tick
from worldsim.recording import layout
from worldsim.recording.columns import ColumnBlock
from worldsim.recording.components import POINTS, STRIPS
from worldsim.recording.guidance_columns import SAMPLES_HZ
from worldsim.recording.panels import FORMING
from worldsim.recording.sensed import Sensed, SensedPoints
from worldsim.scenario.tables import Scenario
from worldsim.truth.vehicle import Floats

Lines = list[list[Vector]]
"""Lines [m; world frame]."""
RAY_POINTS, LINE_POINTS = 2, 5


class SensingColumns:
    """Makes the columns of one block of ticks after the other; none for a large fleet."""

    def __init__(self, scenario: Scenario) -> None:
        self._every = max(1, round(scenario.fleet.tick_hz / SAMPLES_HZ))
        self._sensed = SensedPoints(scenario, self._every)
        self._shown = scenario.rows <= layout.NAMED_MAX
        control = scenario.control
        bends = control.controller == FORMING and control.avoidance == "constellation"
        self._constellation = Constellation(control.safety_m) if bends else None
        self._near_m = REACH_M + control.safety_m

    def observe(self, observations: Sequence[tuple[int, Observation]]) -> None:
        """Take what some agents observe."""
        if self._shown:
            self._sensed.keep(observations)

    def blocks(self, ticks: Sequence[Tick]) -> Iterator[ColumnBlock]:
        """Yield the columns of a block; blocks come in order."""
        rows = [row for row, tick in enumerate(ticks) if tick.index % self._every == 0]
        if not rows or not self._shown:
            return
        sensed = {row: self._sensed.take(ticks[row]) for row in rows}
        rays = [_rays(ticks[row], sensed[row]) for row in rows]
        yield _strips(layout.RAYS, rows, rays, RAY_POINTS)
        if self._constellation is not None:
            lines = [self._lines(ticks[row], sensed[row], self._constellation) for row in rows]
            agents = [[agent for line in each for agent in line] for each in lines]
            points = np.array([agent for each in agents for agent in each]).reshape(-1, 3)
            yield _strips(layout.GUIDING_LINES, rows, lines, LINE_POINTS)
            lengths = [len(each) for each in agents]
            yield ColumnBlock(layout.CONSTELLATION, rows, [POINTS.parts(points, lengths)])

    def _lines(self, tick: Tick, sensed: dict[int, Sensed], constellation: Constellation) -> Lines:
        """Return the guiding lines of vehicles near a surface."""
        found: Lines = []
        yaws = tick.attitude[:, 0].tolist()
        for agent, each in sensed.items():
            near = [point for point in each.surfaces if length(point) < self._near_m]
            if near:
                bent = constellation.bent_lines(yaws[agent], near)
                found.extend(_placed(tick.position[agent], line) for line in bent)
        return found


def _rays(tick: Tick, sensed: dict[int, Sensed]) -> Lines:
    """Return a ray from each vehicle to all that it senses."""
    return [
        _placed(tick.position[agent], [(0.0, 0.0, 0.0), point])
        for agent, each in sensed.items()
        for point in (*each.vehicles, *each.surfaces)
    ]


def _placed(centre: Floats, points: Sequence[Vector]) -> list[Vector]:
    """Return points relative to a vehicle's centre in the world frame [m]."""
    x, y, z = centre.tolist()
    return [(x + u, y + v, z + w) for u, v, w in points]


def _strips(entity: str, rows: Sequence[int], drawn: Sequence[Lines], points: int) -> ColumnBlock:
    """Return lines of so many points each, with a row for each tick that is shown."""
    flat = np.array([line for each in drawn for line in each]).reshape(-1, points, 3)
    return ColumnBlock(entity, rows, [STRIPS.parts(flat, [len(each) for each in drawn])])
