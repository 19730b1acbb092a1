"""Warnings of queues whose orientation vehicles cannot hold while their slots move.

A vehicle flies within a cone about its heading. Where a slot moves outside that cone of the queue's
yaw, its agent flies with another heading, and turns to the queue's where the slot rests.
"""

from collections.abc import Iterator
from math import degrees, hypot
from typing import NamedTuple

from agent.guidance.cone import Cone, azimuth_error, flight_cone_of
from agent.guidance.movement import DEAD_BAND_MPS
from agent.qstructure.formation import FormationSpec, Slot, formation_of
from agent.qstructure.frame_path import Track
from agent.qstructure.target_frame import Frame
from worldsim.scenario.problem import Problem
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import FrameChange, FrameTable, changed_frame, path_of


class _Flight(NamedTuple):
    """A formation and its frame, from one mission to the next."""

    key: str  # of the formation's tables
    formation: FormationSpec
    frame: FrameTable
    from_s: float
    until_s: float


def yaws_not_held(scenario: Scenario) -> Iterator[Problem]:
    """Yield a warning for each queue whose yaw cannot be held while a slot of it moves."""
    cones = [flight_cone_of(vehicle) for vehicle in scenario.vehicles]
    narrowest = Cone(min(cone.left for cone in cones), min(cone.right for cone in cones))
    found: dict[str, Problem] = {}
    for flight in _flights(scenario):
        for problem in _of_flight(scenario, flight, narrowest):
            found.setdefault(problem.key, problem)
    yield from found.values()


def _flights(scenario: Scenario) -> Iterator[_Flight]:
    """Yield what the team flies, mission by mission."""
    key, formation, frame, from_s = "formation", scenario.formation, scenario.frame, 0.0
    missions = [
        (event.at_s, index, event)
        for index, event in enumerate(scenario.event)
        if isinstance(event.action, FormationSpec | FrameChange)
    ]
    for at_s, index, event in sorted(missions, key=lambda each: each[:2]):
        yield _Flight(key, formation, frame, from_s, at_s)
        from_s = at_s
        if isinstance(event.action, FormationSpec):
            key, formation = f"event[{index}].formation", event.action
        elif isinstance(event.action, FrameChange):
            frame = changed_frame(frame, event.action, at_s)
    yield _Flight(key, formation, frame, from_s, scenario.duration_s)


def _of_flight(scenario: Scenario, flight: _Flight, cone: Cone) -> Iterator[Problem]:
    formation = formation_of(flight.formation, scenario.control.spacing_m)
    slots = [
        (place.queue, slot)
        for place, slot in formation.layout(scenario.fleet.agents).slots.items()
        if slot.attitude.yaw is not None
    ]
    for from_s, until_s, frame in Track(path_of(flight.frame)).stretches() if slots else ():
        if until_s <= flight.from_s or from_s >= flight.until_s:
            continue
        for queue, slot in slots:
            off = _off_heading(slot, frame)
            if off is not None and not cone.holds(off):
                yield Problem(
                    f"{flight.key}.queue[{queue}].orientation.yaw_deg",
                    f"queue {flight.formation.queue[queue].name!r}: from"
                    f" {max(from_s, flight.from_s):.4g} s on, its slot at {slot.arc_length:.3g} m"
                    f" moves {abs(degrees(off)):.3g} degrees off this yaw, and vehicles fly at most"
                    f" {degrees(cone.left if off > 0.0 else cone.right):.3g} off their heading:"
                    " they turn to it only where the slot rests",
                )


def _off_heading(slot: Slot, frame: Frame) -> float | None:
    """Return the azimuth of a slot's motion from its yaw [rad]; None where it has none (E10)."""
    u, v, _ = frame.velocity_at(frame.to_world(slot.point))
    if slot.attitude.yaw is None or hypot(u, v) <= DEAD_BAND_MPS:
        return None
    return azimuth_error(u, v, slot.attitude.yaw + frame.yaw)
