"""Stills of a run: one moment in 3D, from above and from the side, with what goes on at it."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from worldsim.report import style
from worldsim.report.figures import moments_s
from worldsim.report.shown import STARTING, Shown
from worldsim.report.style import ACCENT, FAINT, INK, MUTED, UNPLACED, drawing
from worldsim.report.views import (
    FROM_ABOVE,
    FROM_THE_SIDE,
    MAX_LINKED,
    Region,
    Space,
    draw_flat,
    draw_moment,
    moment_region,
    queue_colour,
)

SIZE_IN = (12.8, 7.2)
DPI = 100
BAR = (0.045, 0.072, 0.91, 0.018)
FLAT = (
    ((0.64, 0.53, 0.33, 0.36), FROM_ABOVE, "from above"),
    ((0.64, 0.15, 0.33, 0.3), FROM_THE_SIDE, "from the side"),
)
MARKS = 1.5
"""Scale of marks and names in 3D, beside those of a report."""


class Stills:
    """Draws stills of a run on one figure."""

    def __init__(self, shown: Shown) -> None:
        self.shown = shown
        self.figure = Figure(figsize=SIZE_IN, dpi=DPI)

    def draw(self, row: int, region: Region) -> None:
        """Draw a tick in place of what was drawn before. region: the part of space to show."""
        shown, figure = self.shown, self.figure
        figure.clear()
        space: Space = figure.add_axes((0.0, 0.1, 0.6, 0.8), projection="3d")
        draw_moment(space, shown, row, region, MARKS)
        space.set_box_aspect(region.size.tolist(), zoom=1.05)
        for place, plane, title in FLAT:
            axes = figure.add_axes(place)
            draw_flat(axes, shown, row, plane, region)
            axes.set_title(title)
        self._write_head(row)
        self._draw_bar(row)

    def _write_head(self, row: int) -> None:
        shown, figure = self.shown, self.figure
        time_s = float(shown.times_s[row])
        figure.text(0.03, 0.945, shown.scenario.name, fontsize=17.0, fontweight="bold", color=INK)
        figure.text(0.97, 0.945, f"{time_s:.1f} s", fontsize=17.0, color=ACCENT, ha="right")
        figure.text(0.03, 0.912, ", ".join(facts(shown, row)), fontsize=10.5, color=MUTED)
        phase = shown.phase_at(time_s)
        named = [(queue_colour(k), q.name) for k, q in enumerate(phase.formation.queues)]
        used = named if shown.forms else []
        states = [*used, (UNPLACED, "no place"), (style.STOPPED, "process stopped")]
        if (shown.states == STARTING).any():
            states.append((style.STARTING, "process starting"))
        handles = [
            Line2D([], [], marker="o", linestyle="", color=colour, label=name)
            for colour, name in states
        ]
        figure.legend(handles=handles, loc="lower center", ncols=len(handles), borderpad=0.1)

    def _draw_bar(self, row: int) -> None:
        """Draw how far the run is, with the times of faults, joins and new formations."""
        shown = self.shown
        axes = self.figure.add_axes(BAR)
        axes.axvspan(0.0, shown.until_s, color="#eef1f5", linewidth=0.0)
        for change in shown.changes:
            axes.axvspan(change.from_s, change.to_s, color=change.colour, linewidth=0.0)
        for phase in shown.phases[1:]:
            axes.axvline(phase.from_s, color=FAINT, linewidth=2.0)
        axes.axvline(shown.times_s[row], color=ACCENT, linewidth=3.0)
        axes.set_xlim(0.0, max(shown.until_s, 1e-3))
        axes.set_axis_off()


def facts(shown: Shown, row: int) -> list[str]:
    """Return what goes on at a tick: formation, nearest pair, faults in force."""
    time_s = float(shown.times_s[row])
    found = [shown.phase_at(time_s).formation.name] if shown.forms else []
    separation = shown.separation[row]
    if not np.isnan(separation).all():
        found.append(f"nearest pair {np.nanmin(separation):.2f} m")
    members = int(np.count_nonzero(shown.members_at(time_s)))
    running = int(np.count_nonzero(shown.run.ticks[row].alive))
    if running < members:
        found.append(f"{running} of {members} agents running")
    if starting := int(np.count_nonzero(shown.states[row] == STARTING)):
        found.append(f"{starting} starting")
    kinds = dict.fromkeys(
        fault.kind for fault in shown.faults if fault.from_s <= time_s < fault.to_s
    )
    if shown.agents > MAX_LINKED:
        found.append(f"links not drawn (more than {MAX_LINKED} agents)")
    return found + ([f"in force: {', '.join(kinds)}"] if kinds else [])


def write_stills(
    shown: Shown, times_s: Sequence[float], folder: Path, progress: Callable[[str], None]
) -> list[Path]:
    """Write a still (PNG) for each time [s] into a new folder, and return the files.

    Without times, the moments of the report are drawn. Raises OSError.
    """
    folder.mkdir(parents=True)
    files = []
    with drawing():
        stills = Stills(shown)
        for time_s in times_s or moments_s(shown):
            progress(f"{shown.scenario.name}: drawing {time_s:g} s")
            row = shown.tick_at(time_s)
            stills.draw(row, moment_region(shown, row))
            files.append(folder / f"{shown.times_s[row]:07.2f}s.png")
            stills.figure.savefig(files[-1])
    return files
