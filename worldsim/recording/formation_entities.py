"""Entities of the formation that is flown: its slots, their arrival spheres and its queues.

They are logged anew when a mission changes the formation or its frame.
"""

from collections.abc import Iterator
from math import ceil

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from agent.messages import Vector
from agent.qstructure.formation import Formation
from agent.qstructure.target_frame import Frame
from worldsim.recording import layout, palette
from worldsim.recording.columns import Entity
from worldsim.scenario.tables import CONVERGED_M

CURVE_STEP_M = 0.05
SLOT_RADIUS_M = 0.022
SPHERE_LINE_RADIUS_M = 0.003
QUEUE_LINE_RADIUS_M = 0.008
SPHERE_ALPHA = 40
QUEUE_ALPHA = 90


class FormationEntities:
    """Draws a formation for a team of ``team`` agents, with the target's frame at ``frame``."""

    def __init__(self, formation: Formation, team: int, frame: Frame) -> None:
        self._formation = formation
        self._frame = frame
        filled = formation.layout(team)
        self._places = filled.places
        self._arc_lengths = {place: slot.arc_length for place, slot in filled.slots.items()}
        self._points = [filled.slots[place].point for place in self._places]  # [m; target's frame]
        self.slots: NDArray[np.float64] = np.array(self._points_in(frame))
        """Positions of the slots (M, 3) [m; world frame]."""

    def entities(self) -> Iterator[Entity]:
        """Yield the formation as it stands at the start of its phase."""
        shared = np.array(self._formation.common, dtype=np.int16).reshape(-1, 2)
        colours = palette.place_colours(np.array(self._places, dtype=np.int16), shared)
        slots = rr.Points3D(self.slots, colors=colours, radii=[SLOT_RADIUS_M])
        yield Entity(layout.SLOTS, slots)
        yield Entity(layout.ARRIVAL_SPHERES, self._arrival_spheres(colours))
        yield Entity(layout.QUEUES, self._queue_lines())

    def slots_in(self, frame: Frame) -> rr.Points3D:
        """Return the slots with the target's frame at another pose."""
        return rr.Points3D.from_fields(positions=self._points_in(frame))

    def _points_in(self, frame: Frame) -> list[Vector]:
        return [frame.to_world(point) for point in self._points]

    def _arrival_spheres(self, colours: palette.Colours) -> rr.Ellipsoids3D:
        """Return the spheres within which an agent counts as in place."""
        return rr.Ellipsoids3D(
            centers=self.slots,
            half_sizes=[[CONVERGED_M] * 3] * len(self.slots),
            colors=palette.with_opacity(colours, SPHERE_ALPHA),
            line_radii=[SPHERE_LINE_RADIUS_M],
            fill_mode=rr.components.FillMode.MajorWireframe,
        )

    def _queue_lines(self) -> rr.LineStrips3D:
        queues = np.arange(len(self._formation.queues))
        return rr.LineStrips3D(
            [self._curve(queue) for queue in queues.tolist()],
            colors=palette.with_opacity(palette.queue_colours(queues), QUEUE_ALPHA),
            radii=[QUEUE_LINE_RADIUS_M],
        )

    def _curve(self, index: int) -> list[Vector]:
        """Return a queue's curve from its first vertex to its last slot [m; world frame]."""
        queue = self._formation.queues[index]
        slots = [s for place, s in self._arc_lengths.items() if place.queue == index]
        end = max([*queue.stations, *slots])
        steps = max(1, ceil(end / CURVE_STEP_M))
        return [self._frame.to_world(queue.point(end * k / steps)) for k in range(steps + 1)]
