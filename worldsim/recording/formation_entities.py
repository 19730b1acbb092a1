"""Entities of the formation that is flown: its slots, their arrival spheres and its queues.

They stand in the target's frame, under one transform. The transform is logged at every tick at
which the frame has moved; the formation is logged where a mission or the team changes it.
"""

from collections.abc import Iterator, Sequence
from math import ceil, cos, sin

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from agent.messages import FramePath, Place, Vector
from agent.qstructure.formation import Formation, Slot
from agent.qstructure.frame_path import Track
from agent.qstructure.target_frame import Frame
from worldsim.judge.tick import Tick
from worldsim.recording import layout, palette
from worldsim.recording.columns import Entity
from worldsim.scenario.tables import CONVERGED_M

CURVE_STEP_M = 0.05
SLOT_RADIUS_M = 0.022
SPHERE_LINE_RADIUS_M = 0.003
QUEUE_LINE_RADIUS_M = 0.008
SPHERE_ALPHA = 40
QUEUE_ALPHA = 90

Slots = dict[Place, Slot]


class FormationEntities:
    """Draws the formation of each phase of a run, which the agents report by their claims.

    Nothing is drawn before an agent claims a place: a controller may form nothing.
    """

    def __init__(self, formation: Formation, path: FramePath) -> None:
        self._formation = formation
        self._track = Track(path)
        self._mission = 0
        self._team = 0
        self._claims: frozenset[Place] = frozenset()
        self._shown: tuple[object, ...] = ()
        self._pose: tuple[Vector, float] | None = None

    def begin_phase(
        self, formation: Formation, path: FramePath, mission: int, time_s: float
    ) -> Iterator[Entity]:
        """Replace the formation by that of a new mission, given at a time [s]; mission: its key."""
        self._formation, self._track, self._mission = formation, Track(path), mission
        yield from self._moved(time_s)
        if self._shown:
            self._claims = frozenset()
            yield from self._changed()

    def see(self, tick: Tick) -> Iterator[Entity]:
        """Yield what has moved or changed at a tick; ticks come in order."""
        yield from self._moved(tick.time_s)
        self._claims = _claims(tick, self._mission)
        self._team = int(np.count_nonzero(tick.alive)) or self._team
        if self._shown or self._claims:
            yield from self._changed()

    def _moved(self, time_s: float) -> Iterator[Entity]:
        """Yield the transform from the target's frame to the world, where it has changed."""
        frame = self._track.at(time_s)
        pose = (frame.origin, frame.yaw)
        if pose != self._pose:
            self._pose = pose
            yield Entity(layout.FORMATION, _transform(frame))

    def _changed(self) -> Iterator[Entity]:
        """Yield the formation, where it is not the one that is shown."""
        shown = (self._formation, self._team, self._claims)
        if shown != self._shown:
            self._shown = shown
            yield from _entities(self._formation, self._slots())

    def _slots(self) -> Slots:
        """Return the slots that the team fills by itself, and those claimed beyond them.

        Agents claim other slots where vehicles that are no members occupy some (E18).
        """
        slots = dict(self._formation.layout(self._team).slots)
        for place in sorted(self._claims - slots.keys()):
            slot = self._formation.slot(place, self._team)
            if slot is not None:
                slots[place] = slot
        return slots


def slot_positions(formation: Formation, team: int, frame: Frame) -> NDArray[np.float64]:
    """Return the slots (M, 3) [m; world frame] of a team, with the target's frame at a pose."""
    slots = formation.layout(team).slots.values()
    return np.array([frame.to_world(slot.point) for slot in slots])


def _claims(tick: Tick, mission: int) -> frozenset[Place]:
    """Return the places that agents claim in a mission, or in a newer one."""
    claims = zip(tick.place.tolist(), tick.mission.tolist(), strict=True)
    return frozenset(
        Place(queue, rank) for (queue, rank), flown in claims if queue >= 0 and flown >= mission
    )


def _transform(frame: Frame) -> rr.Transform3D:
    half = 0.5 * frame.yaw
    return rr.Transform3D(
        translation=frame.origin, quaternion=rr.Quaternion(xyzw=[0.0, 0.0, sin(half), cos(half)])
    )


def _entities(formation: Formation, slots: Slots) -> Iterator[Entity]:
    """Yield a formation with these slots, in the target's frame."""
    shared = np.array(formation.common, dtype=np.int16).reshape(-1, 2)
    places = np.array(list(slots), dtype=np.int16).reshape(-1, 2)
    colours = palette.place_colours(places, shared)
    points = [slot.point for slot in slots.values()]
    yield Entity(layout.SLOTS, rr.Points3D(points, colors=colours, radii=[SLOT_RADIUS_M]))
    yield Entity(layout.ARRIVAL_SPHERES, _arrival_spheres(points, colours))
    yield Entity(layout.QUEUES, _queue_lines(formation, slots))


def _arrival_spheres(points: Sequence[Vector], colours: palette.Colours) -> rr.Ellipsoids3D:
    """Return the spheres within which an agent counts as in place."""
    return rr.Ellipsoids3D(
        centers=points,
        half_sizes=[[CONVERGED_M] * 3] * len(points),
        colors=palette.with_opacity(colours, SPHERE_ALPHA),
        line_radii=[SPHERE_LINE_RADIUS_M],
        fill_mode=rr.components.FillMode.MajorWireframe,
    )


def _queue_lines(formation: Formation, slots: Slots) -> rr.LineStrips3D:
    queues = np.arange(len(formation.queues))
    return rr.LineStrips3D(
        [_curve(formation, queue, slots) for queue in queues.tolist()],
        colors=palette.with_opacity(palette.queue_colours(queues), QUEUE_ALPHA),
        radii=[QUEUE_LINE_RADIUS_M],
    )


def _curve(formation: Formation, index: int, slots: Slots) -> list[Vector]:
    """Return a queue's curve from its first vertex to its last slot [m; target's frame]."""
    queue = formation.queues[index]
    used = [slot.arc_length for place, slot in slots.items() if place.queue == index]
    end = max([*queue.stations, *used])
    steps = max(1, ceil(end / CURVE_STEP_M))
    return [queue.point(end * k / steps) for k in range(steps + 1)]
