"""The network over time: packets by cause, strength of the network, and the faults.

The strength is lambda_2, the algebraic connectivity: 0 where the team is parted.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from worldsim.judge.network_strength import algebraic_connectivity
from worldsim.judge.tick import Tick
from worldsim.report import style
from worldsim.report.curves import mark_times
from worldsim.report.shown import ABSENT, DOWN, STARTING, Fault, Shown
from worldsim.report.style import (
    ACCENT,
    FAINT,
    INK,
    MUTED,
    UNPLACED,
    new_figure,
    time_axis,
)
from worldsim.truth.vehicle import Floats

FATES = {
    "delivered": ("delivered", "#cfe3ec"),
    "dropped_range": ("out of range", "#b4bdc9"),
    "dropped_loss": ("lost", "#7fb2c9"),
    "dropped_partition": ("cut by a fault", "#d9822b"),
    "dropped_queue": ("queue full", "#a05195"),
    "dropped_medium": ("receiver gone", "#3a3f47"),
}
"""What becomes of a frame: its words and colour."""
BINS = 120
ROLES = {
    "vertex": ("vertex", ACCENT),
    "sub-vertex": ("sub-vertex", "#63a6c2"),
    "member": ("member", "#d5e4ec"),
    "distress": ("distress", "#e39a8f"),
    "": ("no role yet", "#eceff3"),
}
IDLE = {
    DOWN: ("not running", style.STOPPED),
    STARTING: ("starting", style.STARTING),
    ABSENT: ("not in the world", "none"),
}
"""The words and colour of an agent that does not run."""
MAX_LANES = 30
"""Of more agents or faults, no lanes are drawn."""


def draw_packets(shown: Shown) -> Figure:
    """Draw what became of frames in each second, by cause."""
    figure = new_figure(3.0)
    axes = figure.subplots()
    edges_s, rates = _rates(shown)
    mark_times(axes, shown)
    bottom = np.zeros(len(edges_s) - 1)
    for name, (words, colour) in FATES.items():
        if not rates[name].any():
            continue
        top = bottom + rates[name]
        axes.stairs(
            top, edges_s, baseline=bottom, fill=True, color=colour, label=words, linewidth=0.0
        )
        bottom = top
    axes.autoscale_view()
    time_axis(axes, shown.until_s)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("frames to a receiver [1/s]")
    handles = axes.get_legend_handles_labels()[0]
    if handles:
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(handles))
    return figure


def _rates(shown: Shown) -> tuple[Floats, dict[str, Floats]]:
    """Return the edges of equal spans [s], and the frames a second of each fate in each span."""
    packets = shown.run.packets
    edges_s = np.linspace(0.0, max(shown.until_s, 1e-3), BINS + 1)
    rates = {}
    for name in FATES:
        known_s = np.concatenate(([0.0], packets["t_s"]))
        counted = np.interp(edges_s, known_s, np.concatenate(([0.0], packets[name])))
        rates[name] = np.maximum(np.diff(counted), 0.0) / np.diff(edges_s)
    return edges_s, rates


def draw_network(shown: Shown) -> Figure:
    """Draw the network's strength, each agent's role, and every fault and join, over time."""
    lanes = shown.agents <= MAX_LANES
    changes = shown.changes[:MAX_LANES]
    heights = [1.5, *([0.19 * shown.agents + 0.2] if lanes else [])]
    heights += [0.24 * len(changes) + 0.3] if changes else []
    figure = new_figure(0.7 + 1.08 * sum(heights))
    panels = figure.subplots(
        len(heights), 1, sharex=True, height_ratios=heights, squeeze=False
    ).ravel()
    _draw_strength(panels[0], shown)
    if lanes:
        _draw_roles(panels[1], shown)
    if changes:
        _draw_changes(panels[-1], shown, changes)
    for axes in panels:
        time_axis(axes, shown.until_s)
        axes.label_outer()
    return figure


def strength(shown: Shown) -> tuple[Floats, Floats]:
    """Return at each tick lambda_2 of the running agents, and the mean of agents heard directly.

    Both are NaN for fewer than two running agents.
    """
    lambda_2, heard = np.full((2, len(shown.times_s)), np.nan)
    last: tuple[bytes, bytes] | None = None
    for row, tick in enumerate(shown.run.ticks):
        key = (tick.links.tobytes(), tick.alive.tobytes())
        if key == last:
            lambda_2[row], heard[row] = lambda_2[row - 1], heard[row - 1]
            continue
        last = key
        linked = _linked(tick)
        value = algebraic_connectivity(linked & linked.T)
        if value is not None:
            lambda_2[row], heard[row] = value, linked.sum() / len(linked)
    return lambda_2, heard


def _linked(tick: Tick) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Return which of the running agents hears which, (R, R)."""
    everyone = np.zeros((len(tick.alive),) * 2, dtype=np.bool_)
    everyone[tick.links[:, 0], tick.links[:, 1]] = True
    return everyone[np.ix_(tick.alive, tick.alive)]


def _draw_strength(axes: Axes, shown: Shown) -> None:
    lambda_2, heard = strength(shown)
    mark_times(axes, shown)
    axes.step(
        shown.times_s, heard, where="post", color=FAINT, linewidth=1.4, label="agents heard, mean"
    )
    axes.step(
        shown.times_s,
        lambda_2,
        where="post",
        color=ACCENT,
        linewidth=1.6,
        label="strength $\\lambda_2$",
    )
    axes.set_ylim(bottom=-0.2)
    axes.yaxis.set_major_locator(MaxNLocator(5))
    axes.set_ylabel("agents, $\\lambda_2$")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)


def _draw_roles(axes: Axes, shown: Shown) -> None:
    states = shown.run.places["role"].reshape(len(shown.times_s), shown.agents).astype(object)
    for state, (name, _) in IDLE.items():
        states[shown.states == state] = name
    words = {**ROLES, **{name: (name, colour) for name, colour in IDLE.values()}}
    absent = IDLE[ABSENT][0]
    present = [name for name in words if name != absent and (states == name).any()]
    ends_s = np.append(shown.times_s, shown.until_s)
    for agent, column in enumerate(states.T):
        changes = np.flatnonzero(column[1:] != column[:-1]) + 1
        starts = np.concatenate(([0], changes)).astype(np.intp)
        ends = np.concatenate((changes, [len(column)])).astype(np.intp)
        spans = [
            (ends_s[a], max(ends_s[b] - ends_s[a], 0.0)) for a, b in zip(starts, ends, strict=True)
        ]
        colours = [words.get(column[start], ("", UNPLACED))[1] for start in starts]
        axes.broken_barh(spans, (agent - 0.38, 0.76), facecolors=colours, linewidth=0.0)
    axes.set_yticks(range(shown.agents), shown.names)
    axes.set_ylim(shown.agents - 0.4, -0.6)
    axes.grid(visible=False)
    axes.set_title("role of each agent")
    handles = [axes.barh(0, 0, color=words[name][1], label=words[name][0]) for name in present]
    axes.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=max(1, len(handles))
    )


def _draw_changes(axes: Axes, shown: Shown, changes: list[Fault]) -> None:
    for row, fault in enumerate(changes):
        length_s = fault.to_s - fault.from_s
        axes.barh(row, length_s, left=fault.from_s, height=0.7, color=fault.colour, linewidth=0.0)
        late = fault.from_s > 0.75 * shown.until_s
        axes.annotate(
            fault.kind,
            (fault.from_s, row),
            xytext=(-4 if late else 4, 0),
            textcoords="offset points",
            ha="right" if late else "left",
            va="center",
            fontsize=8.0,
            color=INK,
        )
    axes.set_yticks([])
    axes.set_ylim(len(changes) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")
    more = len(shown.changes) - len(changes)
    what = "faults" if len(shown.changes) == len(shown.faults) else "faults and joins"
    axes.set_title(f"{what}{f' (the first {len(changes)}; {more} more)' if more else ''}")
    axes.tick_params(colors=MUTED)
