"""What stands still in a recording: styles, names, a phase's formation, the scenario's text."""

from collections.abc import Iterator
from math import ceil
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from agent.messages import Vector
from agent.qstructure.formation import Formation
from agent.qstructure.target_frame import Frame
from worldsim.judge.phase import CONVERGED_M
from worldsim.recording import layout, palette
from worldsim.scenario.file import dump
from worldsim.scenario.tables import Scenario

TRAIL_RADIUS_M = 0.018
DRAWN_EVERY_M = 0.05
TARGET_RADIUS_M = 0.035


class Scenery:
    """What holds for a whole run, or for a whole phase of it.

    team: how many the formation is drawn for. slots: (M, 3), where its places are [m; world frame].
    """

    def __init__(self, scenario: Scenario, formation: Formation, team: int, frame: Frame) -> None:
        self._scenario = scenario
        self._formation = formation
        self._frame = frame
        filled = formation.layout(team)
        self._places = filled.places
        self._stands = {place: slot.arc_length for place, slot in filled.slots.items()}
        self._points = [filled.slots[place].point for place in self._places]
        self.slots: NDArray[np.float64] = np.array(
            [self._frame.to_world(point) for point in self._points]
        )

    def lasting(self) -> Iterator[tuple[str, list[Any]]]:
        """Return what holds for the whole run, entity by entity."""
        agents = self._scenario.rows
        names = layout.names_of(agents)
        yield layout.AGENTS, [rr.Points3D.from_fields(radii=[TRAIL_RADIUS_M])]
        yield layout.TARGETS, [rr.Points3D.from_fields(radii=[TARGET_RADIUS_M])]
        yield (
            layout.LINKS,
            [rr.LineStrips3D.from_fields(colors=np.array([palette.LINK]), radii=[0.004])],
        )
        yield layout.HIERARCHY, [rr.LineStrips3D.from_fields(radii=[0.012])]
        yield layout.VEHICLES, [self._bodies(agents)]
        metrics = layout.NEAR_OBSTACLES if self._scenario.obstacle else layout.PER_AGENT
        for metric in (*metrics, *layout.TOLD):
            yield metric, [rr.SeriesLines(names=names, widths=[1.2] * agents)]
        yield layout.QUEUE_RESIDUAL, [_by_queue(queues_of(self._scenario))]
        for agent in range(min(agents, layout.NAMED_MAX)):
            yield layout.role_of(agent), [_role_colours()]
        for metric, lines in limits(self._scenario).items():
            yield layout.limit_of(metric), [_reference(len(lines))]
        text = f"```toml\n{dump(self._scenario)}```\n"
        yield layout.SCENARIO, [rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)]

    def formation(self) -> Iterator[tuple[str, Any]]:
        """Return the formation as it stands from the start of its phase on."""
        colours = self._place_colours()
        yield layout.SLOTS, rr.Points3D(self.slots, colors=colours, radii=[0.022])
        yield (
            layout.ARRIVED,
            rr.Ellipsoids3D(
                centers=self.slots,
                half_sizes=[[CONVERGED_M] * 3] * len(self.slots),
                colors=palette.faint(colours, 40),
                line_radii=[0.003],
                fill_mode=rr.components.FillMode.MajorWireframe,
            ),
        )
        strips, tints = self._edges()
        yield layout.QUEUES, rr.LineStrips3D(strips, colors=tints, radii=[0.008])

    def slots_in(self, frame: Frame) -> rr.Points3D:
        """Return where the places are once the target's frame has moved on."""
        where = [frame.to_world(point) for point in self._points]
        return rr.Points3D.from_fields(positions=where)

    def _bodies(self, agents: int) -> rr.Boxes3D:
        r = self._scenario.vehicle.radius_m
        return rr.Boxes3D.from_fields(
            half_sizes=[[r, 0.62 * r, 0.3 * r]] * agents,
            show_labels=agents <= layout.NAMED_MAX,
            fill_mode=rr.components.FillMode.Solid,
        )

    def _place_colours(self) -> palette.Colours:
        shared = np.array(self._formation.common, dtype=np.int16).reshape(-1, 2)
        return palette.of_places(np.array(self._places, dtype=np.int16), shared)

    def _edges(self) -> tuple[list[list[Any]], palette.Colours]:
        """Return each queue from its vertex to its last slot, and its colour."""
        strips = []
        queues = np.arange(len(self._formation.queues))
        for index in queues.tolist():
            strips.append(self._edge(index))
        return strips, palette.faint(palette.QUEUES[queues % len(palette.QUEUES)], 90)

    def _edge(self, index: int) -> list[Vector]:
        """Return a queue's curve from its first vertex to its last slot, drawn every 5 cm."""
        queue = self._formation.queues[index]
        ends = [s for place, s in self._stands.items() if place.queue == index]
        end = max([*queue.stations, *ends])
        steps = max(1, ceil(end / DRAWN_EVERY_M))
        return [self._frame.to_world(queue.point(end * k / steps)) for k in range(steps + 1)]


def _reference(lines: int) -> rr.SeriesLines:
    return rr.SeriesLines(
        colors=np.full(lines, palette.LIMIT), widths=[1.0] * lines, names=["limit"] * lines
    )


def _by_queue(queues: int) -> rr.SeriesLines:
    """Return the style of one series for each queue, of whatever formation is flown."""
    return rr.SeriesLines(
        names=[f"queue {queue + 1}" for queue in range(queues)],
        colors=palette.QUEUES[np.arange(queues) % len(palette.QUEUES)],
        widths=[1.2] * queues,
    )


def _role_colours() -> rr.StateConfiguration:
    return rr.StateConfiguration(values=list(palette.ROLES), colors=list(palette.ROLES.values()))


def queues_of(scenario: Scenario) -> int:
    """Return how many queues the formations of a scenario have at most."""
    later = [event.formation for event in scenario.event if event.formation is not None]
    return max(len(spec.queue) for spec in (scenario.formation, *later))


def limits(scenario: Scenario) -> dict[str, list[float]]:
    """Return the reference lines of each metric that has a limit."""
    least = scenario.expect.min_separation_m
    turn = scenario.vehicle.max_turn_deg
    near = {layout.OBSTACLE_DISTANCE: [scenario.obstacle_bound_m]} if scenario.obstacle else {}
    return {
        **near,
        layout.SEPARATION: [least if least is not None else scenario.control.separation_m],
        layout.SLOT_ERROR: [CONVERGED_M],
        layout.QUEUE_RESIDUAL: [CONVERGED_M],
        layout.TURN_DEG: [-turn, turn],
    }
