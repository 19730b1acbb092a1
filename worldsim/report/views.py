"""The team in space: one moment in 3D or from above, with trails, slots, links and obstacles.

Vehicles have the colour of their queue (the paper's Figs. 9 and 13).
"""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Circle, Rectangle
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from agent.qstructure.formation import Slot
from worldsim.judge.tick import Tick
from worldsim.report import style
from worldsim.report.shown import DOWN, STARTING, Shown
from worldsim.report.style import FAINT, INK, MUTED, QUEUES, SOLID, UNPLACED
from worldsim.truth.vehicle import Floats

CURVE_STEPS = 24
SPHERE_STEPS = 14
ELEVATION_DEG = 24.0
AZIMUTHS_DEG = (-58.0, -70.0, -46.0, -34.0, -22.0, -80.0, -106.0)
"""Directions to look from, the first choice first."""
BETTER = 1.25
"""Another direction is taken where it keeps vehicles so much farther apart."""
LEAST_SIZE_M = 2.0
MAX_NAMED = 20
"""With more agents, vehicles have no names."""
MAX_LINKED = 30
"""Of more agents, no links are drawn."""
TRAIL_S = 6.0
"""A trail shows so much of the past [s]."""
MAX_TRAIL_POINTS = 160
MAX_VECTOR_LINES = 150
"""More links are drawn as an image inside the SVG."""
Space = Any
"""Axes in 3D, of which matplotlib declares no types."""
OUTLINE: Any = {"facecolor": SOLID, "alpha": 0.55, "edgecolor": "none"}
Plane = tuple[int, int]
"""The axes to the right and up."""
FROM_ABOVE: Plane = (0, 1)
FROM_THE_SIDE: Plane = (0, 2)


class Region(NamedTuple):
    """A part of space: its centre (3,) and its size (3,) [m; world frame]."""

    centre: Floats
    size: Floats

    @property
    def low(self) -> Floats:
        """The least coordinates (3,) [m]."""
        low: Floats = self.centre - 0.5 * self.size
        return low

    @property
    def high(self) -> Floats:
        """The largest coordinates (3,) [m]."""
        high: Floats = self.centre + 0.5 * self.size
        return high


def region_of(points: Floats, margin_m: float = 0.5) -> Region:
    """Return the region around some points (K, 3), NaN rows left out."""
    known = points.reshape(-1, 3)
    known = known[~np.isnan(known).any(axis=1)]
    if not len(known):
        return Region(np.zeros(3), np.full(3, LEAST_SIZE_M))
    low, high = known.min(axis=0) - margin_m, known.max(axis=0) + margin_m
    return Region(0.5 * (low + high), np.maximum(high - low, LEAST_SIZE_M))


def moment_region(shown: Shown, row: int, trail_s: float = TRAIL_S) -> Region:
    """Return the region of a tick: vehicles, their trails and their slots."""
    first = _first_of_trail(shown, row, trail_s)
    slots = [point for point, _ in _slots(shown, shown.run.ticks[row]).values()]
    points = [shown.position[first : row + 1].reshape(-1, 3), np.array(slots).reshape(-1, 3)]
    return region_of(np.concatenate(points))


def azimuth_deg(position: Floats) -> float:
    """Return where to look from in 3D, so that no vehicle hides another one or its name.

    position: of the vehicles (N, 3) [m; world frame].
    """
    known = position[~np.isnan(position).any(axis=1)]
    if not 2 <= len(known) <= MAX_NAMED:
        return AZIMUTHS_DEG[0]
    apart = [_least_apart(known, azimuth) for azimuth in AZIMUTHS_DEG]
    best = max(apart)
    # Small differences, as between two runs of one scenario, leave the first choice.
    chosen = next(index for index, each in enumerate(apart) if BETTER * each >= best)
    return AZIMUTHS_DEG[chosen]


def _least_apart(points: Floats, azimuth: float) -> float:
    """Return how near two points (N, 3) come in the picture from an azimuth [deg]."""
    around, up = np.radians(azimuth), np.radians(ELEVATION_DEG)
    x, y, z = points.T
    away = x * np.cos(around) + y * np.sin(around)
    seen = np.stack((y * np.cos(around) - x * np.sin(around), z * np.cos(up) - away * np.sin(up)))
    apart = np.linalg.norm(seen[:, :, None] - seen[:, None, :], axis=0)
    return float(apart[np.triu_indices(len(points), 1)].min())


def draw_moment(axes: Space, shown: Shown, row: int, seen: Region, scale: float = 1.0) -> None:
    """Draw the team at a tick in 3D, with the trails of the last seconds.

    seen: what to show. scale: of marks and names.
    """
    tick, trail_s = shown.run.ticks[row], TRAIL_S
    _draw_solids(axes, shown, tick.time_s, seen)
    for colour, curve in _queue_curves(shown, tick):
        axes.plot(*curve.T, color=colour, linewidth=1.0, alpha=0.55)
    _draw_lines(axes, link_lines(shown, tick), FAINT, 0.4)
    colours = colours_of(shown, row)
    for agent, colour in enumerate(colours):
        axes.plot(*_trail(shown, agent, row, trail_s).T, color=colour, linewidth=0.8, alpha=0.6)
    for point, colour in _slots(shown, tick).values():
        axes.scatter(*point, s=26 * scale**2, facecolors="none", edgecolors=colour, linewidths=0.8)
    axes.scatter(
        *tick.position.T, s=20 * scale**2, c=colours, depthshade=False, edgecolors="white", lw=0.5
    )
    _name(axes, shown, tick, 6.5 * scale)
    _frame(axes, seen, azimuth_deg(shown.position[-1]))


def draw_flat(
    axes: Axes, shown: Shown, row: int, plane: Plane, seen: Region, trail_s: float = TRAIL_S
) -> None:
    """Draw the team at a tick in a plane: from above, or from the side. seen: what to show."""
    tick, (across, up) = shown.run.ticks[row], plane
    keep = [across, up]
    if plane == FROM_ABOVE:
        _draw_outlines(axes, shown, tick.time_s)
    for colour, curve in _queue_curves(shown, tick):
        axes.plot(*curve[:, keep].T, color=colour, linewidth=1.2, alpha=0.5)
    flat = [line[:, keep] for line in link_lines(shown, tick)]
    links = LineCollection(flat, colors=FAINT, linewidths=0.5, alpha=0.5)
    links.set_rasterized(len(flat) > MAX_VECTOR_LINES)
    axes.add_collection(links)
    colours = colours_of(shown, row)
    for agent, colour in enumerate(colours):
        trail = _trail(shown, agent, row, trail_s)[:, keep]
        axes.plot(*trail.T, color=colour, linewidth=0.9, alpha=0.65)
    for point, colour in _slots(shown, tick).values():
        axes.plot(*point[keep], "o", markersize=6.0, mfc="none", mec=colour, mew=0.9)
    place = tick.position[:, keep]
    axes.scatter(place[:, 0], place[:, 1], s=22, c=colours, edgecolors="white", lw=0.5, zorder=3)
    _name_flat(axes, shown, place)
    axes.set_xlim(seen.low[across], seen.high[across])
    axes.set_ylim(seen.low[up], seen.high[up])
    axes.set_aspect("equal", adjustable="box", anchor="N")
    axes.set_xlabel(f"{'xyz'[across]} [m]")
    axes.set_ylabel(f"{'xyz'[up]} [m]")


def _name_flat(axes: Axes, shown: Shown, place: Floats) -> None:
    """Name the vehicles, those that are at one place together. place: (N, 2) [m]."""
    if shown.agents > MAX_NAMED:
        return
    together: dict[tuple[float, float], list[str]] = {}
    for name, point in zip(shown.names, place, strict=True):
        if not np.isnan(point).any():
            x, y = np.round(point, 1).tolist()
            together.setdefault((x, y), []).append(name)
    for at, names in together.items():
        text = ", ".join(names)
        axes.annotate(text, at, (5, 4), textcoords="offset points", fontsize=7.0, color=INK)


def colours_of(shown: Shown, row: int) -> list[str]:
    """Return the colour of each vehicle at a tick.

    It is its queue's; others are for one without a place, and for one whose process is stopped or
    starting.
    """
    queues, states = shown.run.ticks[row].place[:, 0].tolist(), shown.states[row].tolist()
    idle = {DOWN: style.STOPPED, STARTING: style.STARTING}
    return [
        idle.get(state, queue_colour(queue)) for queue, state in zip(queues, states, strict=True)
    ]


def queue_colour(queue: int) -> str:
    """Return the colour of a queue by its index; that of an agent without a place below 0."""
    return QUEUES[queue % len(QUEUES)] if queue >= 0 else UNPLACED


def _slots(shown: Shown, tick: Tick) -> dict[int, tuple[Floats, str]]:
    """Return the slot that each agent claims [m; world frame], and its colour."""
    phase = shown.phase_at(tick.time_s)
    frame = phase.frame(tick.time_s)
    queue = tick.place[:, 0].tolist()
    return {
        agent: (np.array(frame.to_world(slot.point)), queue_colour(queue[agent]))
        for agent, slot in phase.own_slots(tick).items()
    }


def _queue_curves(shown: Shown, tick: Tick) -> list[tuple[str, Floats]]:
    """Return the curve of each queue as far as its slots are claimed [m; world frame]."""
    phase = shown.phase_at(tick.time_s)
    frame, slots, found = phase.frame(tick.time_s), phase.own_slots(tick), []
    for index, queue in enumerate(phase.formation.queues):
        claimed: list[Slot] = [
            slot for agent, slot in slots.items() if tick.place[agent, 0] == index
        ]
        if not claimed:
            continue
        end_m = max([*queue.stations, *(slot.arc_length for slot in claimed)])
        steps = [queue.point(end_m * k / CURVE_STEPS) for k in range(CURVE_STEPS + 1)]
        curve = np.array([frame.to_world(point) for point in steps])
        found.append((queue_colour(index), curve))
    return found


def link_lines(shown: Shown, tick: Tick) -> list[Floats]:
    """Return the links to draw, each as (2, 3) [m; world frame]; none of a large team.

    There they would be a grey mass that hides the team.
    """
    if shown.agents > MAX_LINKED:
        return []
    pairs = sorted({(min(pair), max(pair)) for pair in tick.links.tolist()})
    lines = [tick.position[list(pair)] for pair in pairs]
    return [line for line in lines if not np.isnan(line).any()]


def _first_of_trail(shown: Shown, row: int, trail_s: float) -> int:
    return int(np.searchsorted(shown.times_s, shown.times_s[row] - trail_s))


def _trail(shown: Shown, agent: int, row: int, trail_s: float) -> Floats:
    """Return where a vehicle was in the last seconds (K, 3) [m; world frame]."""
    first = _first_of_trail(shown, row, trail_s)
    step = max(1, (row + 1 - first) // MAX_TRAIL_POINTS)
    trail: Floats = shown.position[first : row + 1][::-1][::step][::-1, agent]
    return trail


def _draw_lines(axes: Space, lines: list[Floats], colour: str, width: float) -> None:
    if lines:
        collection: Any = Line3DCollection
        drawn = collection(lines, colors=colour, linewidths=width, alpha=0.5)
        drawn.set_rasterized(len(lines) > MAX_VECTOR_LINES)
        axes.add_collection3d(drawn)


def _name(axes: Space, shown: Shown, tick: Tick, size_pt: float) -> None:
    if shown.agents > MAX_NAMED:
        return
    for name, (x, y, z) in zip(shown.names, tick.position.tolist(), strict=True):
        if not np.isnan(x):
            axes.text(x, y, z, f"\u00a0{name}", fontsize=size_pt, color=INK)


def _frame(axes: Space, region: Region, azimuth: float) -> None:
    axes.set(
        xlim=(region.low[0], region.high[0]),
        ylim=(region.low[1], region.high[1]),
        zlim=(region.low[2], region.high[2]),
    )
    axes.set_box_aspect(region.size.tolist(), zoom=0.92)
    axes.patch.set_visible(False)  # it would hide the label of the axes to the left
    axes.view_init(elev=ELEVATION_DEG, azim=azimuth)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color("#f7f8fa")
        axis.line.set_color(FAINT)
        axis.set_tick_params(labelsize=6.5, pad=-3.0, colors=MUTED)
        axis.set_major_locator(MaxNLocator(4))
    axes.set_xlabel("x [m]", fontsize=7.0, labelpad=-8.0)
    axes.set_ylabel("y [m]", fontsize=7.0, labelpad=-8.0)
    axes.set_zlabel("z [m]", fontsize=7.0, labelpad=-8.0)


def _inside(centre: Floats, region: Region) -> bool:
    return bool(np.all(np.abs(centre - region.centre) <= 0.5 * region.size))


def _draw_solids(axes: Space, shown: Shown, time_s: float, region: Region) -> None:
    """Draw the obstacles in the region: spheres and cylinders round, boxes as their edges."""
    if not len(shown.obstacles):
        return
    solids, centres = shown.obstacles, shown.obstacles.centres(time_s)
    turn, up = np.meshgrid(
        np.linspace(0, 2 * np.pi, SPHERE_STEPS), np.linspace(-1, 1, SPHERE_STEPS)
    )
    for column, centre in enumerate(centres):
        radius = float(solids.radius[column])
        half = solids.half[column]
        if not _inside(centre, region):
            continue
        if column in solids.boxes:
            _draw_lines(axes, _edges(centre, half, solids.heading[column]), SOLID, 1.2)
            continue
        ball = column in solids.spheres
        across = radius * (np.sqrt(1.0 - up**2) if ball else np.ones_like(up))
        height = radius if ball else float(half[2])
        surface = (across * np.cos(turn), across * np.sin(turn), height * up)
        x, y, z = (c + part for c, part in zip(centre.tolist(), surface, strict=True))
        axes.plot_surface(x, y, z, color=SOLID, alpha=0.55, linewidth=0.0, rasterized=True)


def _edges(centre: Floats, half: Floats, heading: Floats) -> list[Floats]:
    """Return the twelve edges of a box, each (2, 3) [m; world frame]."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = centre + _turned(signs * half, heading)
    return [
        corners[[a, b]]
        for a in range(8)
        for b in range(a + 1, 8)
        if np.count_nonzero(signs[a] != signs[b]) == 1
    ]


def _turned(points: Floats, heading: Floats) -> Floats:
    cosine, sine = heading.tolist()
    turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    turned: Floats = points @ turn
    return turned


def _draw_outlines(axes: Axes, shown: Shown, time_s: float) -> None:
    """Draw the obstacles from above."""
    if not len(shown.obstacles):
        return
    solids, style = shown.obstacles, OUTLINE
    for column, centre in enumerate(solids.centres(time_s)):
        if column in solids.boxes:
            half, (cosine, sine) = solids.half[column], solids.heading[column].tolist()
            corner = centre + _turned(np.array([-half[0], -half[1], 0.0]), solids.heading[column])
            angle = float(np.degrees(np.arctan2(sine, cosine)))
            size = (2.0 * half[0], 2.0 * half[1])
            axes.add_patch(Rectangle(tuple(corner[:2]), *size, angle=angle, **style))
        else:
            axes.add_patch(Circle(tuple(centre[:2]), float(solids.radius[column]), **style))
