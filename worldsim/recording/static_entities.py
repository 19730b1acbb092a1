"""Entities that hold for a whole run: styles, series names, limits and the scenario's text."""

from collections.abc import Iterator

import numpy as np
import rerun as rr

from worldsim.recording import layout, palette
from worldsim.recording.columns import Entity
from worldsim.scenario.file import dump
from worldsim.scenario.tables import CONVERGED_M, Scenario
from worldsim.truth.vehicle import Floats

TRAIL_RADIUS_M = 0.018
POINT_RADIUS = 1.4  # [UI points]
TARGET_RADIUS_M = 0.035
LINK_RADIUS_M = 0.004
LINK_STYLES = (
    (layout.LINKS, palette.LINK, LINK_RADIUS_M),
    (layout.LINKS_LOST, palette.LINK_LOST, 1.6 * LINK_RADIUS_M),
    (layout.LINKS_CUT, palette.LINK_CUT, 1.6 * LINK_RADIUS_M),
    (layout.LINKS_OUT_OF_RANGE, palette.LINK_OUT_OF_RANGE, LINK_RADIUS_M),
)
PARENT_LINE_RADIUS_M = 0.012
HEADING_RADIUS_M = 0.012
MAX_NAMES = 5
"""Of more agents with a limit, the first are named."""
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
    near = {layout.OBSTACLE_DISTANCE: [scenario.obstacle_bound_m]} if scenario.obstacle else {}
    return {
        **near,
        layout.SEPARATION: [scenario.separation_bound_m],
        layout.SLOT_ERROR: [CONVERGED_M],
        layout.QUEUE_RESIDUAL: [CONVERGED_M],
        layout.TURN_DEG: list(turn_limits(scenario)),
    }


def turn_limits(scenario: Scenario) -> dict[float, str]:
    """Return the limits of the wanted turn [deg], positive to the left, and whose they are.

    Agents may have other limits than the rest, and each side its own.
    """
    holders: dict[float, list[int]] = {}
    for agent, vehicle in enumerate(scenario.vehicles):
        left, right = vehicle.max_turn_left_deg, vehicle.max_turn_right_deg
        holders.setdefault(vehicle.max_turn_deg if left is None else left, []).append(agent)
        holders.setdefault(-(vehicle.max_turn_deg if right is None else right), []).append(agent)
    return {limit: _whose(limit, agents, scenario.rows) for limit, agents in holders.items()}


def _whose(limit: float, agents: list[int], rows: int) -> str:
    side = "left" if limit > 0.0 else "right"
    if len(agents) == rows:
        return f"limit to the {side}"
    names = [layout.agent_name(agent) for agent in agents[:MAX_NAMES]]
    more = f" and {len(agents) - MAX_NAMES} more" if len(agents) > MAX_NAMES else ""
    return f"limit to the {side} of {', '.join(names)}{more}"


def max_queues(scenario: Scenario) -> int:
    """Return the largest number of queues of any formation in a scenario."""
    later = [event.formation for event in scenario.event if event.formation is not None]
    return max(len(spec.queue) for spec in (scenario.formation, *later))


def _world_styles(scenario: Scenario) -> Iterator[Entity]:
    # The vehicles of a large fleet are small in the picture: points of it are not.
    large = scenario.rows > layout.NAMED_MAX
    radius = -POINT_RADIUS if large else TRAIL_RADIUS_M  # negative: in UI points
    yield Entity(layout.AGENTS, rr.Points3D.from_fields(radii=[radius]))
    yield Entity(layout.TARGETS, rr.Points3D.from_fields(radii=[TARGET_RADIUS_M]))
    for entity, colour, width in LINK_STYLES:
        style = rr.LineStrips3D.from_fields(colors=np.array([colour]), radii=[width])
        yield Entity(entity, style)
    yield Entity(layout.HIERARCHY, rr.LineStrips3D.from_fields(radii=[PARENT_LINE_RADIUS_M]))
    boxes = rr.Boxes3D.from_fields(
        show_labels=scenario.rows <= layout.NAMED_MAX, fill_mode=rr.components.FillMode.Solid
    )
    yield Entity(layout.VEHICLES, boxes)
    heading = rr.Arrows3D.from_fields(colors=np.array([palette.HEADING]), radii=[HEADING_RADIUS_M])
    yield Entity(layout.VEHICLES, heading)
    yield from _guidance_styles()
    yield from _fault_styles()


def half_sizes(scenario: Scenario) -> Floats:
    """Return half the length, width and height of each vehicle's body (N, 3) [m]."""
    radius_m = np.array([vehicle.radius_m for vehicle in scenario.vehicles])
    sizes: Floats = radius_m[:, None] * np.array([1.0, 0.62, 0.3])
    return sizes


def _guidance_styles() -> Iterator[Entity]:
    colours, radii = np.array([palette.GUIDANCE]), [LINK_RADIUS_M]
    yield Entity(layout.CAST_ZONES, rr.LineStrips3D.from_fields(colors=colours, radii=radii))
    yield Entity(layout.WAYS, rr.LineStrips3D.from_fields(colors=colours, radii=radii))
    bobbers = rr.Points3D.from_fields(colors=np.array([palette.BOBBER]), radii=[TARGET_RADIUS_M])
    yield Entity(layout.BOBBERS, bobbers)
    bent = np.array([palette.CONSTELLATION])
    yield Entity(layout.GUIDING_LINES, rr.LineStrips3D.from_fields(colors=bent, radii=radii))
    agents = rr.Points3D.from_fields(colors=bent, radii=[2.0 * LINK_RADIUS_M])
    yield Entity(layout.CONSTELLATION, agents)
    believed = np.array([palette.BELIEF])
    yield Entity(layout.BELIEFS, rr.LineStrips3D.from_fields(colors=believed, radii=radii))
    sensed = np.array([palette.SENSED])
    yield Entity(layout.RAYS, rr.LineStrips3D.from_fields(colors=sensed, radii=radii))


def _fault_styles() -> Iterator[Entity]:
    filled = rr.components.FillMode.TransparentFillMajorWireframe
    jams = rr.Ellipsoids3D.from_fields(colors=np.array([palette.JAM]), fill_mode=filled)
    yield Entity(layout.JAMS, jams)
    yield Entity(layout.SIDES, rr.Ellipsoids3D.from_fields(fill_mode=rr.components.FillMode.Solid))
    wire = rr.components.FillMode.MajorWireframe
    paused = np.array([palette.PAUSED])
    yield Entity(layout.PAUSED, rr.Boxes3D.from_fields(colors=paused, fill_mode=wire))
    dead = rr.LineStrips3D.from_fields(colors=np.array([palette.DEAD_CROSS]), show_labels=True)
    yield Entity(layout.DEAD, dead)


def _series_styles(scenario: Scenario) -> Iterator[Entity]:
    names = layout.agent_names(scenario.rows)
    for metric in layout.agent_metrics(obstacles=bool(scenario.obstacle)):
        yield Entity(metric, rr.SeriesLines(names=names, widths=[SERIES_WIDTH] * len(names)))
    yield Entity(layout.LINK_COUNTS, _link_count_series())
    yield Entity(layout.LAMBDA2, rr.SeriesLines(names=["lambda_2"], widths=[SERIES_WIDTH]))
    yield Entity(layout.QUEUE_RESIDUAL, _queue_series(max_queues(scenario)))
    for metric, values in metric_limits(scenario).items():
        turns = list(turn_limits(scenario).values()) if metric == layout.TURN_DEG else None
        yield Entity(layout.limit_entity(metric), _limit_series(turns or ["limit"] * len(values)))


def _queue_series(queues: int) -> rr.SeriesLines:
    return rr.SeriesLines(
        names=[f"queue {queue + 1}" for queue in range(queues)],
        colors=palette.queue_colours(np.arange(queues)),
        widths=[SERIES_WIDTH] * queues,
    )


def _link_count_series() -> rr.SeriesLines:
    colours = [0x8FA3BFFF, palette.LINK_CUT, palette.LINK_LOST, palette.LINK_OUT_OF_RANGE]
    return rr.SeriesLines(
        names=["heard", "cut", "lost", "out of range"],
        colors=np.array(colours, dtype=np.uint32),
        widths=[SERIES_WIDTH] * len(colours),
    )


def _limit_series(names: list[str]) -> rr.SeriesLines:
    lines = len(names)
    return rr.SeriesLines(
        names=names, colors=np.full(lines, palette.LIMIT), widths=[LIMIT_WIDTH] * lines
    )


def _role_colours() -> rr.StateConfiguration:
    return rr.StateConfiguration(
        values=list(palette.ROLE_COLOURS), colors=list(palette.ROLE_COLOURS.values())
    )
