"""The figures of a report: which there are, their captions, and how they are drawn."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from worldsim.report import curves, network, views
from worldsim.report.page_parts import DrawnFigure
from worldsim.report.shown import Fault, Shown
from worldsim.report.style import drawing, new_figure, png_of, svg_of

MOMENTS, MAX_MOMENTS = 6, 9
"""So many snapshots there are; where more goes on, up to the greater number."""
COLUMNS = 3
AFTER_S = 1.0
"""So long after a new formation or a fault's end, its effect is shown [s]."""
RIGHT_END = 0.97
"""Snapshots take so much of the width: labels of axes in 3D are not counted in their layout."""
MAX_WIDE = 1.8
"""A flight that is wider than so many times its breadth is drawn with one view below the other."""


class _Recipe(NamedTuple):
    name: str
    title: str
    caption: str
    draw: Callable[[Shown], Figure]


def drawn_figures(shown: Shown, progress: Callable[[str], None]) -> Iterator[DrawnFigure]:
    """Yield the figures of a run that has ticks. progress: gets the title of each before it."""
    for recipe in _recipes(shown):
        progress(recipe.title.lower())
        with drawing():
            figure = recipe.draw(shown)
            svg, png = svg_of(figure), png_of(figure)
        yield DrawnFigure(recipe.name, recipe.title, recipe.caption, svg, png)


def moments_s(shown: Shown) -> list[float]:
    """Return the times of the snapshots [s], at most MAX_MOMENTS, spread over what goes on.

    They are the start, the end, formations (soon after each is asked for, and when it stands), and
    times amid faults and joins; then what is left when faults are over; then times in between.
    """
    chosen, inside = {0.0, shown.until_s}, _Inside(shown.until_s)
    formed = inside.of(
        time_s
        for phase in shown.phases
        for time_s in (
            phase.from_s + AFTER_S if phase.from_s > 0.0 else 0.0,
            0.0 if phase.converge_s is None else phase.from_s + phase.converge_s,
        )
    )
    struck = _amid(shown.changes, inside)
    room = MAX_MOMENTS - len(chosen)
    chosen.update(_spread(formed, max(room // 2, room - len(struck))))
    chosen.update(struck[: MAX_MOMENTS - len(chosen)])
    after = inside.of(fault.to_s + AFTER_S for fault in shown.faults)
    chosen.update(_spread(after, MOMENTS - len(chosen)))
    first = shown.phases[0].converge_s
    if first is not None and len(chosen) < MOMENTS:
        chosen.add(0.5 * first)
    while len(chosen) < MOMENTS and shown.until_s > 0.0:
        ordered = sorted(chosen)
        gaps = [after - before for before, after in pairwise(ordered)]
        widest = int(np.argmax(gaps))
        chosen.add(ordered[widest] + 0.5 * gaps[widest])
    return sorted(chosen)


class _Inside(NamedTuple):
    """What lies between start and end."""

    until_s: float

    def of(self, times_s: Iterable[float]) -> list[float]:
        """Return the times between start and end, each once, in order [s]."""
        return sorted({time_s for time_s in times_s if 0.0 < time_s < self.until_s})


def _amid(changes: Sequence[Fault], inside: _Inside) -> list[float]:
    """Return times amid faults and joins [s], those first that show the most not shown before.

    Of those that show as many, the one comes first that is farthest from the others.
    """
    middles = inside.of(0.5 * (each.from_s + each.to_s) for each in changes)
    left, found = list(changes), list[float]()
    while left and middles and len(found) < MAX_MOMENTS:
        others = (0.0, inside.until_s, *found)
        best = max(
            middles,
            key=lambda time_s: (
                sum(each.from_s < time_s < each.to_s for each in left),
                min(abs(time_s - other) for other in others),
            ),
        )
        rest = [each for each in left if not each.from_s < best < each.to_s]
        if len(rest) == len(left):
            break
        left = rest
        found.append(best)
    return found


def _spread(times_s: Sequence[float], room: int) -> list[float]:
    """Return as many of some times as there is room for, from the first to the last [s]."""
    if len(times_s) <= room:
        return list(times_s)
    picked = np.linspace(0, len(times_s) - 1, max(room, 0)).round().astype(int)
    return [times_s[index] for index in picked.tolist()]


def draw_moments(shown: Shown) -> Figure:
    """Draw the team in 3D at some moments."""
    times_s = moments_s(shown)
    lines, forms = -(-len(times_s) // COLUMNS), shown.forms
    figure = new_figure(3.05 * lines)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.set(rect=(0.0, 0.0, RIGHT_END, 1.0))  # type: ignore[call-arg]
    rows = [shown.tick_at(time_s) for time_s in times_s]
    regions = [views.moment_region(shown, row) for row in rows]
    size = np.max([region.size for region in regions], axis=0)
    for index, (row, region) in enumerate(zip(rows, regions, strict=True)):
        axes: views.Space = figure.add_subplot(lines, COLUMNS, index + 1, projection="3d")
        views.draw_moment(axes, shown, row, views.Region(region.centre, size))
        formation = f", {shown.phase_at(shown.times_s[row]).formation.name}" if forms else ""
        axes.set_title(f"{shown.times_s[row]:.1f} s{formation}", pad=0.0)
    return figure


def draw_flight(shown: Shown) -> Figure:
    """Draw the whole flight from above and from the side."""
    last = len(shown.times_s) - 1
    whole = views.moment_region(shown, last, shown.until_s)
    wide, *others = whole.size.tolist()
    if wide > MAX_WIDE * max(others):
        figure = new_figure(float(np.clip(9.2 * sum(others) / wide + 1.0, 3.0, 9.0)))
        panels = figure.subplots(2, 1, height_ratios=others)
    else:
        figure = new_figure(float(np.clip(4.4 * max(others) / wide + 0.6, 3.0, 6.0)))
        panels = figure.subplots(1, 2)
    for axes, plane, title in zip(
        panels,
        (views.FROM_ABOVE, views.FROM_THE_SIDE),
        ("from above", "from the side"),
        strict=True,
    ):
        views.draw_flat(axes, shown, last, plane, whole, shown.until_s)
        axes.set_title(title)
    return figure


def _recipes(shown: Shown) -> list[_Recipe]:
    """Return what is drawn of a run, in the order of the page."""
    obstacles = [OBSTACLE_DISTANCES] if shown.obstacle_distance is not None else []
    found = [*BEFORE_OBSTACLES, *obstacles, *AFTER_OBSTACLES]
    return found if shown.forms else [each for each in found if each is not SLOT_ERRORS]


SLOT_ERRORS = _Recipe(
    "slot_errors",
    "How the formation comes together",
    "How far each agent is from the slot that it claims, on a logarithmic scale. The team has"
    " converged when every agent has been below the dashed line for two seconds.",
    curves.draw_slot_errors,
)
BEFORE_OBSTACLES = (
    _Recipe(
        "snapshots",
        "The team in space",
        "Vehicles in the colour of their queue, with the trails of the last seconds. Rings are the"
        " slots that agents claim, thin grey lines the links between agents that hear each other"
        f" (not drawn of more than {views.MAX_LINKED} agents)."
        " A vehicle without a place is grey, one whose process is stopped is dark, one whose"
        " process is starting is pale. (As in Figs. 9 and 13 of the paper.)",
        draw_moments,
    ),
    _Recipe(
        "flight",
        "The whole flight",
        "The path of every vehicle from start to end, and where the team is at the end. Obstacles"
        " are drawn from above only.",
        draw_flight,
    ),
    SLOT_ERRORS,
    _Recipe(
        "forces",
        "Control forces",
        "The size of each agent's control force. It decays to zero as the agent reaches its"
        " target; a spike is a change of target. (Figs. 9, 11 and 14 of the paper.)",
        curves.draw_forces,
    ),
    _Recipe(
        "distances",
        "Distances between vehicles",
        "The distance of every pair of vehicles, centre to centre. The highlighted curve is the"
        " nearest pair, measured along the way from tick to tick; it must stay above the dashed"
        " line. (Figs. 10(a), 12 and 15 of the paper.)",
        curves.draw_distances,
    ),
)
OBSTACLE_DISTANCES = _Recipe(
    "obstacle_distances",
    "Distances from obstacles",
    "The distance of each vehicle's centre from the nearest surface. (Fig. 15 of the paper.)",
    curves.draw_obstacle_distances,
)
AFTER_OBSTACLES = (
    _Recipe(
        "turns",
        "Turns",
        "The azimuth of the velocity that each agent wants, against its heading, on every moving"
        " step; left is positive. A vehicle that wants a larger turn than the dashed lines allow"
        " turns on the spot first. (Fig. 10(b) of the paper.)",
        curves.draw_turns,
    ),
    _Recipe(
        "packets",
        "Packets",
        "What became of the frames, counted once for each receiver, by cause.",
        network.draw_packets,
    ),
    _Recipe(
        "network",
        "The network and its faults",
        "Above, how many others an agent hears directly, on average, and the strength of the"
        " network, its algebraic connectivity: zero means that the team is parted. Below, the"
        " role of each agent while its vehicle is in the world, the times at which faults were in"
        " force, and those from a join until its agents run.",
        network.draw_network,
    ),
)
