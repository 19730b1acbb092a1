"""Entities of the formation that is flown: its slots, their arrival spheres and its queues.

They stand in the target's frame, under one transform. The transform is logged at every tick at
which the frame has moved; the formation is logged where a mission or the team changes it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import ceil, cos, sin

import numpy as np
import rerun as rr

from agent.messages import FramePath, Place, Vector
from agent.qstructure.formation import Formation, Slot
from agent.qstructure.frame_path import Track
from agent.qstructure.target_frame import Frame
from worldsim.judge.tick import Tick, same_claims
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

    While some agents still fly the mission before, because a new one has not reached their side of
    a partition, the formation before is drawn too, with a transform of its own. Nothing is drawn
    before an agent claims a place: a controller may form nothing.
    """

    def __init__(self, formation: Formation, path: FramePath) -> None:
        self._newest = _Drawing(layout.FORMATION, formation, Track(path), mission=0)
        self._before: _Drawing | None = None
        self._team = 0
        self._last: Tick | None = None
        """The last tick that was seen in the present phase."""

    def begin_phase(
        self, formation: Formation, path: FramePath, mission: int, time_s: float
    ) -> Iterator[Entity]:
        """Replace the formation by that of a new mission, given at a time [s]; mission: its key."""
        last, drawn = self._newest, self._newest.drawn
        self._last = None
        if self._before is not None:
            yield from self._before.clear()
        self._before = last.moved_to(layout.FORMATION_BEFORE) if drawn else None
        self._newest = _Drawing(layout.FORMATION, formation, Track(path), mission)
        yield from self._newest.place(time_s)
        if drawn:
            slots = formation.layout(self._team).slots
            yield from self._newest.draw(dict(slots), self._team)

    def see(self, tick: Tick) -> Iterator[Entity]:
        """Yield what has moved or changed at a tick; ticks come in order."""
        newest, last, self._last = self._newest, self._last, tick
        yield from newest.place(tick.time_s)
        if self._before is not None and self._before.drawn:
            yield from self._before.place(tick.time_s)
        if last is not None and same_claims(last, tick):
            return
        claims = _claims(tick, newest.mission)
        self._team = int(np.count_nonzero(tick.alive)) or self._team
        if newest.drawn or claims:
            yield from newest.draw(self._slots(claims), self._team)
        if self._before is not None:
            yield from self._see_before(self._before, tick)

    def _see_before(self, before: "_Drawing", tick: Tick) -> Iterator[Entity]:
        """Yield the formation before as far as agents still claim its places."""
        flown = (tick.mission >= before.mission) & (tick.mission < self._newest.mission)
        claims = _claims(replace(tick, place=tick.place[flown], mission=tick.mission[flown]), 0)
        if claims:
            if not before.drawn:
                yield from before.place(tick.time_s)
            slots = ((place, before.formation.slot(place, self._team)) for place in sorted(claims))
            yield from before.draw({place: slot for place, slot in slots if slot}, self._team)
        else:
            yield from before.clear()

    def _slots(self, claims: frozenset[Place]) -> Slots:
        """Return the slots that the team fills by itself, and those claimed beyond them.

        Agents claim other slots where vehicles that are no members occupy some (E18).
        """
        formation = self._newest.formation
        slots = dict(formation.layout(self._team).slots)
        for place in sorted(claims - slots.keys()):
            slot = formation.slot(place, self._team)
            if slot is not None:
                slots[place] = slot
        return slots


class _Drawing:
    """One formation in its frame, under an entity of its own, and what is shown of it."""

    def __init__(self, entity: str, formation: Formation, track: Track, mission: int) -> None:
        self.formation = formation
        self.mission = mission
        self._entity = entity
        self._track = track
        self._shown: tuple[object, ...] = ()
        self._pose: tuple[Vector, float] | None = None

    @property
    def drawn(self) -> bool:
        """Whether anything of it is shown."""
        return bool(self._shown)

    def moved_to(self, entity: str) -> "_Drawing":
        """Return the same formation under another entity, where nothing is shown yet."""
        return _Drawing(entity, self.formation, self._track, self.mission)

    def place(self, time_s: float) -> Iterator[Entity]:
        """Yield the transform from the target's frame to the world, where it has changed."""
        frame = self._track.at(time_s)
        pose = (frame.origin, frame.yaw)
        if pose != self._pose:
            self._pose = pose
            yield Entity(self._entity, _transform(frame))

    def draw(self, slots: Slots, team: int) -> Iterator[Entity]:
        """Yield the formation with these slots of a team, where it is not what is shown."""
        shown = (team, frozenset(slots))
        if shown != self._shown:
            self._shown = shown
            yield from _entities(self._entity, self.formation, slots)

    def clear(self) -> Iterator[Entity]:
        """Yield the end of what is shown."""
        if self._shown:
            self._shown = ()
            yield Entity(self._entity, rr.Clear(recursive=True))
            self._pose = None


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


def _entities(entity: str, formation: Formation, slots: Slots) -> Iterator[Entity]:
    """Yield a formation with these slots, in the target's frame."""
    shared = np.array(formation.common, dtype=np.int16).reshape(-1, 2)
    places = np.array(list(slots), dtype=np.int16).reshape(-1, 2)
    colours = palette.place_colours(places, shared)
    points = [slot.point for slot in slots.values()]
    dots = rr.Points3D(points, colors=colours, radii=[SLOT_RADIUS_M])
    yield Entity(f"{entity}/{layout.SLOTS_PART}", dots)
    yield Entity(f"{entity}/{layout.SPHERES_PART}", _arrival_spheres(points, colours))
    yield Entity(f"{entity}/{layout.QUEUES_PART}", _queue_lines(formation, slots))


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
