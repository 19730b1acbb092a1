"""The figures of a sweep: curves along each varied key, and a heat map over two numbers."""

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from worldsim.report.style import ACCENT, GRID, INK, MUTED, QUEUES, drawing, new_figure
from worldsim.report.style import png_of as _png_of
from worldsim.report.style import svg_of as _svg_of
from worldsim.sweep.logistic import curve
from worldsim.sweep.plan import Plan
from worldsim.sweep.result import CellRow, Line, break_along, lines_of
from worldsim.sweep.sweep_text import settings_text

MAX_LINES = len(QUEUES)
"""Lines in one figure; further settings of the other keys are not drawn."""
MAX_MAPS = 4
APART = 0.007
"""Between the points of neighbouring lines, so that none hides another [of the tested range]."""
HEIGHT_IN, MAP_HEIGHT_IN = 3.4, 3.2
MAP = LinearSegmentedColormap.from_list("qswarm", [GRID, "#7fb3cc", ACCENT])
LATE_MAP = LinearSegmentedColormap.from_list("qswarm-late", ["#fbf1e2", "#e6b980", "#b06a1f"])
WHITE_LIGHT, INK_LIGHT = 1.05, 0.067
"""Luminances of the two colours of texts, with the 0.05 that a contrast adds."""
SHARE, LATE = "share of flights that pass", "converged in, median [s]"


class SweepFigure(NamedTuple):
    """A figure as files."""

    name: str  # of its files
    svg: str
    png: bytes


def sweep_figures(plan: Plan, cells: list[CellRow]) -> Iterator[SweepFigure]:
    """Draw the figures of a sweep, one after another."""
    with drawing():
        for number, axis in enumerate(plan.axes):
            if len(axis.values) > 1:
                yield _saved(f"along-{axis.key}", _curves(plan, number, cells))
        numbers = [
            index
            for index, axis in enumerate(plan.axes)
            if axis.numbers is not None and len(axis.values) > 1
        ]
        if len(numbers) > 1:
            name = "-by-".join(plan.axes[index].key for index in numbers[:2])
            yield _saved(f"map-{name}", _maps(plan, (numbers[0], numbers[1]), cells))


def _saved(name: str, figure: Figure) -> SweepFigure:
    return SweepFigure(name, _svg_of(figure), _png_of(figure))


def _curves(plan: Plan, number: int, cells: list[CellRow]) -> Figure:
    """Draw shares and times along one key, a line for each setting of the others."""
    axis = plan.axes[number]
    x = np.array(axis.numbers if axis.numbers is not None else range(len(axis.values)))
    figure = new_figure(HEIGHT_IN)
    shares, times = figure.subplots(1, 2)
    lines = list(lines_of(plan, number))
    aside = APART * float(x.max() - x.min())
    for index, line in enumerate(lines[:MAX_LINES]):
        own, colour = [cells[cell] for cell in line.cells], QUEUES[index]
        shifted = x + aside * (index - (min(len(lines), MAX_LINES) - 1) / 2.0)
        _share_points(shares, shifted, own, (colour, settings_text(line.where)))
        if axis.numbers is not None:
            _fitted(shares, plan, line, cells, colour)
        late = [_value(row["medians"]["converge_s"]) for row in own]
        times.plot(x, late, "o-", color=colour, markersize=4.0, linewidth=1.2)
    shares.set(ylim=(-0.04, 1.04), title=SHARE, xlabel=axis.key)
    times.set(title=LATE, xlabel=axis.key, xlim=shares.get_xlim())
    times.set_ylim(bottom=0.0)
    for each in (shares, times) if axis.numbers is None else ():
        each.set_xticks(x, axis.values)
    if len(lines) > 1:
        shown = f" (the first {MAX_LINES} of {len(lines)})" if len(lines) > MAX_LINES else ""
        figure.legend(loc="outside lower center", ncols=4, title=shown or None)
    return figure


def _share_points(
    axes: Axes, x: "np.ndarray[tuple[int], np.dtype[np.float64]]", rows: list[CellRow],
    drawn: tuple[str, str],
) -> None:  # fmt: skip
    """Draw shares with their intervals. drawn: colour and label."""
    share = np.array([_value(row["pass_share"]) for row in rows])
    low = np.array([_value(row["pass_share_low"]) for row in rows])
    high = np.array([_value(row["pass_share_high"]) for row in rows])
    axes.errorbar(
        x, share, yerr=np.maximum(0.0, np.stack([share - low, high - share])),
        fmt="o", color=drawn[0], markersize=4.0, elinewidth=1.0, capsize=2.5, label=drawn[1],
    )  # fmt: skip


def _fitted(axes: Axes, plan: Plan, line: Line, cells: list[CellRow], colour: str) -> None:
    """Draw the fitted curve and where it breaks; a plain line where nothing was fitted."""
    numbers = np.array(plan.axes[line.axis].numbers)
    found = break_along(plan, line, cells)
    if found.kind != "break" or found.at is None or found.slope is None:
        share = [_value(cells[cell]["pass_share"]) for cell in line.cells]
        axes.plot(numbers, share, color=colour, linewidth=0.8, alpha=0.5)
        return
    x = np.linspace(numbers.min(), numbers.max(), 200)
    axes.plot(x, curve(found.at, found.slope, x), color=colour, linewidth=1.2)
    low, high = (
        float(np.clip(bound if bound is not None else found.at, x[0], x[-1]))
        for bound in (found.low, found.high)
    )
    axes.plot([low, high], [0.5, 0.5], color=colour, linewidth=3.0, alpha=0.35)
    axes.plot([found.at], [0.5], "|", color=colour, markersize=9.0)


def _maps(plan: Plan, axes_of: tuple[int, int], cells: list[CellRow]) -> Figure:
    """Draw maps over two numbers, a row of two for each setting of the other keys."""
    grids = list(_grids(plan, axes_of, cells))[:MAX_MAPS]
    figure = new_figure(MAP_HEIGHT_IN * len(grids))
    rows = figure.subplots(len(grids), 2, squeeze=False)
    latest = max((_value(cell["medians"]["converge_s"], 0.0) for cell in cells), default=0.0)
    for row, (where, grid) in zip(rows, grids, strict=True):
        prefix = f"{where}: " if where else ""
        share = np.array([[_value(cell["pass_share"]) for cell in line] for line in grid])
        texts = [
            [f"{cell['pass']}/{cell['pass'] + cell['fail']}" for cell in line] for line in grid
        ]
        _map(row[0], plan, axes_of, (share, texts, 1.0))
        row[0].set_title(f"{prefix}{SHARE}")
        late = np.array([[_value(cell["medians"]["converge_s"]) for cell in line] for line in grid])
        shown = [["-" if np.isnan(value) else f"{value:.1f}" for value in line] for line in late]
        _map(row[1], plan, axes_of, (late, shown, max(latest, 1e-9)))
        row[1].set_title(f"{prefix}{LATE}")
    return figure


def _grids(
    plan: Plan, axes_of: tuple[int, int], cells: list[CellRow]
) -> Iterator[tuple[str, list[list[CellRow]]]]:
    """Yield the cells over two axes, the second one upwards, for each setting of the others."""
    index = {values: number for number, values in enumerate(plan.cells)}
    others = [number for number in range(len(plan.axes)) if number not in axes_of]
    across, up = (range(len(plan.axes[each].values)) for each in axes_of)
    for held in product(*(plan.axes[number].values for number in others)):
        fixed = dict(zip(others, held, strict=True))

        def cell(column: int, row: int, fixed: dict[int, str] = fixed) -> CellRow:
            chosen = fixed | {
                axes_of[0]: plan.axes[axes_of[0]].values[column],
                axes_of[1]: plan.axes[axes_of[1]].values[row],
            }
            return cells[index[tuple(chosen[number] for number in range(len(plan.axes)))]]

        where = {plan.axes[number].key: value for number, value in fixed.items()}
        yield settings_text(where), [[cell(column, row) for column in across] for row in up]


def _map(
    axes: Axes,
    plan: Plan,
    axes_of: tuple[int, int],
    drawn: "tuple[np.ndarray[tuple[int, int], np.dtype[np.float64]], list[list[str]], float]",
) -> None:
    """Draw one map. drawn: values (up, across), their texts, and the value of the full colour."""
    values, texts, most = drawn
    across, up = (plan.axes[number] for number in axes_of)
    colours = MAP if most == 1.0 else LATE_MAP
    axes.imshow(values, cmap=colours, vmin=0.0, vmax=most, origin="lower", aspect="auto")
    for row, line in enumerate(texts):
        for column, text in enumerate(line):
            value = values[row, column]
            colour = INK if np.isnan(value) else _readable(colours(value / most))
            axes.text(column, row, text, ha="center", va="center", fontsize=8.0, color=colour)
    axes.set_xticks(range(len(across.values)), across.values)
    axes.set_yticks(range(len(up.values)), up.values)
    axes.set(xlabel=across.key, ylabel=up.key)
    axes.grid(visible=False)
    axes.tick_params(colors=MUTED)
    axes.set_facecolor(GRID)


def _readable(background: tuple[float, float, float, float]) -> str:
    """Return the colour of a text that stands out the more from its background (WCAG 2.2)."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in background[:3]]
    light = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2] + 0.05
    return "white" if WHITE_LIGHT / light > light / INK_LIGHT else INK


def _value(value: float | None, missing: float = float("nan")) -> float:
    return missing if value is None else value
