"""Curves over time: forces, distances, turns, slot errors (the paper's Figs. 9 to 12, 14, 15)."""

from itertools import combinations
from math import ceil

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from worldsim.report.shown import Shown
from worldsim.report.style import (
    ACCENT,
    FAINT,
    FAULT,
    INK,
    MUTED,
    limit_lines,
    new_figure,
    time_axis,
)
from worldsim.scenario.tables import CONVERGED_M
from worldsim.truth.vehicle import Floats

MAX_PANELS = 12
"""With more agents, their forces share one panel."""
PANEL_COLUMNS = 3
MAX_POINTS = 700
"""Grey curves are drawn with so many points; what is highlighted keeps all."""
MAX_VECTOR_LINES = 80
"""More curves are drawn as an image inside the SVG."""
FLOOR_M = 1e-4
"""A smaller slot error is drawn as this one [m]."""


def draw_forces(shown: Shown) -> Figure:
    """Draw the control force of each agent over time."""
    if shown.agents > MAX_PANELS:
        return _forces_together(shown)
    columns = min(PANEL_COLUMNS, shown.agents)
    rows = ceil(shown.agents / columns)
    figure = new_figure(0.6 + 1.25 * rows)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    top = _top(shown.force)
    for agent, axes in enumerate(panels[: shown.agents]):
        mark_times(axes, shown, named=False)
        axes.plot(shown.times_s, shown.force[:, agent], color=ACCENT, linewidth=1.1)
        time_axis(axes, shown.until_s)
        axes.set_ylim(0.0, top)
        axes.set_title(shown.names[agent])
        axes.label_outer()
    for axes in panels[shown.agents :]:
        axes.set_visible(False)
    figure.supylabel("control force $|u_i|$", fontsize=9.0, color=MUTED)
    return figure


def _forces_together(shown: Shown) -> Figure:
    figure = new_figure(3.2)
    axes = figure.subplots()
    mark_times(axes, shown)
    _grey(axes, shown.times_s, shown.force)
    axes.plot(shown.times_s, _middle(shown.force), color=ACCENT, linewidth=1.6)
    time_axis(axes, shown.until_s)
    axes.set_ylim(0.0, _top(shown.force))
    axes.set_ylabel("control force $|u_i|$")
    _key(axes, [("each agent", FAINT), ("median", ACCENT)])
    return figure


def draw_distances(shown: Shown) -> Figure:
    """Draw the distances of all pairs of vehicles over time, and the least of the run."""
    figure = new_figure(3.4)
    axes = figure.subplots()
    mark_times(axes, shown)
    _grey(axes, shown.times_s, _pair_distances(shown.position))
    least = _least(shown.separation)
    axes.plot(shown.times_s, least, color=ACCENT, linewidth=1.6)
    _mark_least(axes, shown.times_s, least)
    bound_m = shown.scenario.separation_bound_m
    limit_lines(axes, [bound_m], "required separation")
    time_axis(axes, shown.until_s)
    if shown.agents > MAX_PANELS:
        # Most pairs of a large team are far apart: the near ones are what matters.
        axes.set_yscale("log")
        axes.set_ylim(
            bottom=0.6 * max(0.05, min(bound_m, float(np.nanmin(least, initial=bound_m))))
        )
        axes.yaxis.set_major_formatter(ScalarFormatter())
    else:
        axes.set_ylim(bottom=0.0)
    axes.set_ylabel("distance [m]")
    _key(axes, [("each pair", FAINT), ("nearest pair", ACCENT)])
    return figure


def draw_turns(shown: Shown) -> Figure:
    """Draw the turn that each agent wants at each moving step, and the vehicles' limits."""
    figure = new_figure(3.0)
    axes = figure.subplots()
    mark_times(axes, shown)
    turn = shown.turn_deg
    over = (turn > shown.turn_left_deg + 1e-6) | (turn < -shown.turn_right_deg - 1e-6)
    times = np.broadcast_to(shown.times_s[:, None], turn.shape)
    within = ~over & ~np.isnan(turn)
    axes.plot(times[within], turn[within], ".", color="#8d98a7", markersize=1.6, rasterized=True)
    axes.plot(times[over], turn[over], ".", color=ACCENT, markersize=3.4, rasterized=True)
    limits = np.unique(np.concatenate((shown.turn_left_deg, -shown.turn_right_deg)))
    limit_lines(axes, sorted(limits[np.abs(limits) < 180.0].tolist(), reverse=True), "turn limit")
    time_axis(axes, shown.until_s)
    axes.set_ylim(-185.0, 185.0)
    axes.set_yticks([-180, -90, -45, 0, 45, 90, 180])
    axes.set_ylabel("wanted turn [deg]")
    _key(axes, [("within the limit", "#8d98a7"), ("over the limit", ACCENT)], dots=True)
    return figure


def draw_obstacle_distances(shown: Shown) -> Figure:
    """Draw each vehicle's distance to the nearest obstacle over time."""
    figure = new_figure(3.0)
    axes = figure.subplots()
    mark_times(axes, shown)
    distance = shown.obstacle_distance
    if distance is not None:
        _grey(axes, shown.times_s, distance)
        least = _least(distance)
        axes.plot(shown.times_s, least, color=ACCENT, linewidth=1.6)
        _mark_least(axes, shown.times_s, least)
        limit_lines(axes, [shown.scenario.obstacle_bound_m], "required distance")
    time_axis(axes, shown.until_s)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("distance to the nearest surface [m]")
    _key(axes, [("each vehicle", FAINT), ("nearest vehicle", ACCENT)])
    return figure


def draw_slot_errors(shown: Shown) -> Figure:
    """Draw each agent's distance from its own slot over time."""
    figure = new_figure(3.0)
    axes = figure.subplots()
    mark_times(axes, shown)
    error = np.where(np.isfinite(shown.slot_error), np.maximum(shown.slot_error, FLOOR_M), np.nan)
    _grey(axes, shown.times_s, error)
    known = np.isfinite(error).any(axis=1)
    largest = np.full(len(error), np.nan)
    largest[known] = np.nanmax(error[known], axis=1)
    axes.plot(shown.times_s, largest, color=ACCENT, linewidth=1.6)
    limit_lines(axes, [CONVERGED_M], "in place")
    time_axis(axes, shown.until_s)
    axes.set_yscale("log")
    axes.set_ylim(FLOOR_M, 5.0 * max(1.0, float(np.nanmax(largest, initial=1.0))))
    axes.set_ylabel("distance to the own slot [m]")
    _key(axes, [("each agent", FAINT), ("farthest agent", ACCENT)])
    return figure


def mark_times(axes: Axes, shown: Shown, named: bool = True) -> None:
    """Shade the times of faults, and mark when another formation was asked for."""
    spans = _joined([(fault.from_s, fault.to_s) for fault in shown.faults])
    for from_s, to_s in spans:
        axes.axvspan(from_s, to_s, color=FAULT, linewidth=0.0, zorder=0.2)
    for phase in shown.phases[1:]:
        axes.axvline(phase.from_s, color=MUTED, linewidth=0.8, linestyle=(0, (1, 2)), zorder=0.5)
    if not named:
        return
    marks = [(phase.from_s, phase.formation.name) for phase in shown.phases[1:]]
    if spans:
        marks.append((spans[0][0], "fault" if len(shown.faults) == 1 else "faults"))
    for at_s, name in marks:
        axes.annotate(
            name,
            (at_s, 1.0),
            xycoords=axes.get_xaxis_transform(),
            xytext=(4, -4),
            textcoords="offset points",
            fontsize=7.5,
            color=MUTED,
            va="top",
            bbox={"facecolor": "white", "alpha": 0.7, "linewidth": 0.0, "pad": 1.0},
        )


def _joined(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return spans with those that overlap as one, so that shades do not add up."""
    found: list[tuple[float, float]] = []
    for from_s, to_s in sorted(spans):
        if found and from_s <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], to_s))
        else:
            found.append((from_s, to_s))
    return found


def _grey(axes: Axes, times_s: Floats, values: Floats) -> None:
    """Draw one thin grey curve for each column of values (T, K)."""
    step = max(1, ceil(len(times_s) / MAX_POINTS))
    times, thinned = times_s[::step], values[::step]
    lines = [np.column_stack((times, column)) for column in thinned.T]
    many = len(lines) > MAX_VECTOR_LINES
    drawn = LineCollection(lines, colors=FAINT, linewidths=0.5 if many else 0.7)
    drawn.set_alpha(max(0.05, min(0.8, 40.0 / len(lines))) if lines else None)
    drawn.set_rasterized(many)
    axes.add_collection(drawn)
    axes.autoscale_view()


def _pair_distances(position: Floats) -> Floats:
    """Return the distances (T, K) of all pairs [m]; position: (T, N, 3)."""
    pairs = np.array(list(combinations(range(position.shape[1]), 2)), dtype=np.intp).reshape(-1, 2)
    step = max(1, ceil(len(position) / MAX_POINTS))
    apart = np.full((len(position), len(pairs)), np.nan)
    thinned = position[::step]
    apart[::step] = np.linalg.norm(thinned[:, pairs[:, 0]] - thinned[:, pairs[:, 1]], axis=2)
    return apart


def _least(values: Floats) -> Floats:
    """Return the least of each row (T,); NaN for a row without a number."""
    least: Floats = np.min(np.where(np.isnan(values), np.inf, values), axis=1)
    return np.where(np.isinf(least), np.nan, least)


def _middle(values: Floats) -> Floats:
    known = ~np.isnan(values).all(axis=1)
    middle = np.full(len(values), np.nan)
    middle[known] = np.nanmedian(values[known], axis=1)
    return middle


def _top(values: Floats) -> float:
    """Return the upper end of an axis for values of which a few may be far above the others."""
    known = values[np.isfinite(values)]
    return 1.08 * float(known.max()) if known.size and known.max() > 0.0 else 1.0


def _mark_least(axes: Axes, times_s: Floats, least: Floats) -> None:
    if not np.isfinite(least).any():
        return
    at = int(np.nanargmin(least))
    axes.plot(times_s[at], least[at], "o", color=ACCENT, markersize=5.0, markeredgecolor="white")
    late = times_s[at] > 0.7 * times_s[-1]
    axes.annotate(
        f"least: {least[at]:.3f} m at {times_s[at]:.1f} s",
        (times_s[at], least[at]),
        xytext=(-8 if late else 8, -11),
        textcoords="offset points",
        bbox={"facecolor": "white", "alpha": 0.85, "linewidth": 0.0, "pad": 1.5},
        ha="right" if late else "left",
        color=INK,
        fontsize=8.0,
        fontweight="bold",
    )


def _key(axes: Axes, entries: list[tuple[str, str]], dots: bool = False) -> None:
    """Name the colours of a figure, above its right end."""
    marker = {"marker": "o", "markersize": 4.0, "linestyle": ""} if dots else {"linewidth": 2.0}
    handles = [axes.plot([], [], color=colour, label=name, **marker)[0] for name, colour in entries]
    axes.legend(
        handles=handles,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=len(entries),
        borderpad=0.2,
    )
