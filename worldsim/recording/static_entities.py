"""Entities that hold for a whole run: styles, series names, limits and the scenario's text."""

from collections.abc import Iterator

import numpy as np
import rerun as rr

from worldsim.recording import layout, palette
from worldsim.recording.columns import Entity
from worldsim.scenario.file import dump
from worldsim.scenario.tables import CONVERGED_M, Scenario

TRAIL_RADIUS_M = 0.018
TARGET_RADIUS_M = 0.035
LINK_RADIUS_M = 0.004
PARENT_LINE_RADIUS_M = 0.012
SERIES_WIDTH = 1.2  # [UI points]
LIMIT_WIDTH = 1.0  # [UI points]


def static_entities(scenario: Scenario) -> Iterator[Entity]:
    """Yield what is logged once, as static data."""
    yield from _world_styles(scenario)
    yield from _series_styles(scenario)
    for agent in range(min(scenario.rows, layout.NAMED_MAX)):
        yield Entity(layout.role_entity(agent), _role_colours())
    text = f"```toml\n{dump(scenario)}```\n"
    yield Entity(layout.SCENARIO, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))


def metric_limits(scenario: Scenario) -> dict[str, list[float]]:
    """Return the reference lines of each metric that has any, in the metric's unit."""
    turn_deg = scenario.vehicle.max_turn_deg
    near = {layout.OBSTACLE_DISTANCE: [scenario.obstacle_bound_m]} if scenario.obstacle else {}
    return {
        **near,
        layout.SEPARATION: [scenario.separation_bound_m],
        layout.SLOT_ERROR: [CONVERGED_M],
        layout.QUEUE_RESIDUAL: [CONVERGED_M],
        layout.TURN_DEG: [-turn_deg, turn_deg],
    }


def max_queues(scenario: Scenario) -> int:
    """Return the largest number of queues of any formation in a scenario."""
    later = [event.formation for event in scenario.event if event.formation is not None]
    return max(len(spec.queue) for spec in (scenario.formation, *later))


def _world_styles(scenario: Scenario) -> Iterator[Entity]:
    yield Entity(layout.AGENTS, rr.Points3D.from_fields(radii=[TRAIL_RADIUS_M]))
    yield Entity(layout.TARGETS, rr.Points3D.from_fields(radii=[TARGET_RADIUS_M]))
    links = rr.LineStrips3D.from_fields(colors=np.array([palette.LINK]), radii=[LINK_RADIUS_M])
    yield Entity(layout.LINKS, links)
    yield Entity(layout.HIERARCHY, rr.LineStrips3D.from_fields(radii=[PARENT_LINE_RADIUS_M]))
    yield Entity(layout.VEHICLES, _vehicle_boxes(scenario))


def _vehicle_boxes(scenario: Scenario) -> rr.Boxes3D:
    agents, radius_m = scenario.rows, scenario.vehicle.radius_m
    return rr.Boxes3D.from_fields(
        half_sizes=[[radius_m, 0.62 * radius_m, 0.3 * radius_m]] * agents,
        show_labels=agents <= layout.NAMED_MAX,
        fill_mode=rr.components.FillMode.Solid,
    )


def _series_styles(scenario: Scenario) -> Iterator[Entity]:
    names = layout.agent_names(scenario.rows)
    for metric in layout.agent_metrics(obstacles=bool(scenario.obstacle)):
        yield Entity(metric, rr.SeriesLines(names=names, widths=[SERIES_WIDTH] * len(names)))
    yield Entity(layout.QUEUE_RESIDUAL, _queue_series(max_queues(scenario)))
    for metric, values in metric_limits(scenario).items():
        yield Entity(layout.limit_entity(metric), _limit_series(len(values)))


def _queue_series(queues: int) -> rr.SeriesLines:
    return rr.SeriesLines(
        names=[f"queue {queue + 1}" for queue in range(queues)],
        colors=palette.queue_colours(np.arange(queues)),
        widths=[SERIES_WIDTH] * queues,
    )


def _limit_series(lines: int) -> rr.SeriesLines:
    return rr.SeriesLines(
        names=["limit"] * lines,
        colors=np.full(lines, palette.LIMIT),
        widths=[LIMIT_WIDTH] * lines,
    )


def _role_colours() -> rr.StateConfiguration:
    return rr.StateConfiguration(
        values=list(palette.ROLE_COLOURS), colors=list(palette.ROLE_COLOURS.values())
    )
