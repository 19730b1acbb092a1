"""The margins of a finding's flight over time as curves, with its events and faults marked."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from worldsim.report.curves import FLOOR_M
from worldsim.report.style import (
    ACCENT,
    FAULT,
    LIMIT,
    MUTED,
    drawing,
    limit_lines,
    new_figure,
    png_of,
    svg_of,
    time_axis,
)
from worldsim.scenario.tables import CONVERGED_M, Scenario

PANEL_IN, HEAD_IN = 1.7, 0.7
ROOM = 1.3
"""Of the height of a curve: above it, the line of the trouble is named."""
NEAR = 0.03
"""Events so near to each other share a mark [of the flight]."""


class Curve(NamedTuple):
    """One margin over time, in metres, and its limit."""

    name: str
    values: "np.ndarray[tuple[int], np.dtype[np.float64]]"  # (T,) [m], NaN: not measured
    limit_m: float
    limit: str


def curves_of(margins: dict[str, Any], scenario: Scenario) -> list[Curve]:
    """Return the curves of a finding's margins, of those that were measured.

    Distances are kept as shares of what is required; here they are metres.
    """
    separation_m, clearance_m = scenario.control.separation_m, scenario.obstacle_bound_m
    known = (
        ("nearest two vehicles [m]", "separation", separation_m, "required separation"),
        ("nearest obstacle [m]", "clearance", clearance_m, "required distance"),
        ("largest slot error [m]", "slot_error_m", CONVERGED_M, "in place"),
    )
    found = []
    for name, key, limit_m, limit in known:
        values = np.array(margins.get(key) or [], dtype=np.float64)
        if np.isfinite(values).any():
            in_m = values if key.endswith("_m") else limit_m * (1.0 + values)
            found.append(Curve(name, in_m, limit_m, limit))
    return found


def marks_of(times_s: Sequence[float], until_s: float) -> list[tuple[float, str]]:
    """Return a mark for each group of events that are near to each other: its time, its numbers.

    times_s: of the events, in order; they count from 1.
    """
    groups: list[list[int]] = []
    for number, time_s in enumerate(times_s):
        if groups and time_s - times_s[groups[-1][0]] < NEAR * until_s:
            groups[-1].append(number)
        else:
            groups.append([number])
    return [
        (times_s[each[0]], f"{each[0] + 1}-{each[-1] + 1}" if each[1:] else str(each[0] + 1))
        for each in groups
    ]


def draw_margins(finding: dict[str, Any], scenario: Scenario) -> tuple[str, bytes] | None:
    """Return the margins of a finding as SVG and PNG; None where it has none yet."""
    margins = finding.get("margins") or {}
    curves = curves_of(margins, scenario)
    if not curves:
        return None
    with drawing():
        figure = _figure(finding, scenario, curves)
        return svg_of(figure), png_of(figure)


def _figure(finding: dict[str, Any], scenario: Scenario, curves: list[Curve]) -> Figure:
    times_s = np.array(finding["margins"]["t_s"], dtype=np.float64)
    until_s = float(times_s[-1])
    figure = new_figure(HEAD_IN + PANEL_IN * len(curves))
    panels = figure.subplots(len(curves), 1, sharex=True, squeeze=False).ravel()
    for axes, curve in zip(panels, curves, strict=True):
        _shade(axes, scenario)
        axes.axvline(finding["trouble_s"], color=LIMIT, linewidth=1.2)
        for time_s, _ in marks_of([each["t_s"] for each in finding["events"]], until_s):
            axes.axvline(time_s, color=MUTED, linewidth=0.8, linestyle=(0, (1, 2)))
        if curve.name.startswith("largest"):
            axes.set_yscale("log")
            low_m, high_m = float(np.nanmin(curve.values)), float(np.nanmax(curve.values))
            axes.set_ylim(max(FLOOR_M, 0.3 * min(low_m, curve.limit_m)), 5.0 * max(1.0, high_m))
        axes.plot(times_s, np.maximum(curve.values, FLOOR_M), color=ACCENT, linewidth=1.4)
        limit_lines(axes, [curve.limit_m], curve.limit)
        time_axis(axes, until_s)
        axes.set_title(curve.name)
        axes.label_outer()
        if axes.get_yscale() == "linear":
            axes.set_ylim(0.0, ROOM * max(curve.limit_m, float(np.nanmax(curve.values))))
    _name_marks(panels[0], finding, until_s)
    return figure


def _shade(axes: Axes, scenario: Scenario) -> None:
    """Shade the times of faults that end by themselves."""
    for event in scenario.event:
        for_s = getattr(event, "for_s", None)
        if for_s is not None:
            axes.axvspan(event.at_s, event.at_s + for_s, color=FAULT, linewidth=0.0, zorder=0.2)


def _name_marks(axes: Axes, finding: dict[str, Any], until_s: float) -> None:
    """Write the numbers of events, and what the line of the trouble is, above the first panel."""
    axes.set_title(axes.get_title(loc="left"), pad=16.0)
    for time_s, numbers in marks_of([each["t_s"] for each in finding["events"]], until_s):
        _above(axes, time_s, numbers, MUTED)
    trouble_s = finding["trouble_s"]
    late = trouble_s > 0.7 * until_s
    axes.annotate(
        f"trouble: {trouble_s:g} s",
        (trouble_s, 1.0),
        xycoords=axes.get_xaxis_transform(),
        xytext=(-4 if late else 4, -4),
        textcoords="offset points",
        ha="right" if late else "left",
        va="top",
        fontsize=8.0,
        fontweight="bold",
        color=LIMIT,
    )


def _above(axes: Axes, time_s: float, text: str, colour: str) -> None:
    axes.annotate(
        text,
        (time_s, 1.0),
        xycoords=axes.get_xaxis_transform(),
        xytext=(0, 3),
        textcoords="offset points",
        ha="center",
        va="bottom",
        fontsize=7.5,
        color=colour,
    )
