"""How figures look: light, one accent, everything else in greys; and how they become files."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

INK, MUTED, FAINT, GRID = "#1c2430", "#66717f", "#b4bdc9", "#e8ebf0"
ACCENT, LIMIT, FAULT = "#0b6e99", "#c0392b", "#fbf1e2"
"""What a figure is about; limits that must be kept; times at which a fault was in force."""
QUEUES = (ACCENT, "#d9822b", "#5b8c5a", "#a05195", "#c9a227", "#c94f4f", "#5f6caf", "#7a6a58")
"""A colour for each queue; they repeat."""
UNPLACED, STOPPED, STARTING, SOLID = "#8a94a3", "#3a3f47", "#e3c1dd", "#b9ada0"
FAULT_BAR, JOIN_BAR = "#e6b980", STARTING
WIDTH_IN = 9.2
PNG_DPI = 150
RASTER_DPI = 170
"""Resolution of what has too many points for SVG."""
RC: Any = {
    "font.family": ["sans-serif"],
    "font.size": 9.0,
    "text.color": INK,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": MUTED,
    "axes.linewidth": 0.8,
    "axes.titlesize": 9.0,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.major.size": 0.0,
    "ytick.major.size": 0.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "legend.labelcolor": MUTED,
    "figure.facecolor": "white",
    "svg.fonttype": "none",
    "svg.hashsalt": "qswarm",
    "path.simplify_threshold": 0.4,
}
NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}
_TAG = re.compile(r"<[^>]*>")
_LONG_NUMBER = re.compile(r"(\d+\.\d\d)\d+")


@contextmanager
def drawing() -> Iterator[None]:
    """Draw and save figures in this style inside the block."""
    with mpl.rc_context(RC):
        yield


def new_figure(height_in: float) -> Figure:
    """Return an empty figure of the page's width."""
    return Figure(figsize=(WIDTH_IN, height_in), layout="constrained")


def svg_of(figure: Figure) -> str:
    """Return a figure as SVG, with coordinates in hundredths of a point."""
    file = BytesIO()
    figure.savefig(file, format="svg", dpi=RASTER_DPI, metadata=NO_METADATA)
    svg = file.getvalue().decode("utf-8")
    start = svg.index("<svg")
    return svg[:start] + _TAG.sub(_shortened, svg[start:])


def _shortened(tag: re.Match[str]) -> str:
    """Return a tag with fewer digits; texts between tags keep theirs."""
    return _LONG_NUMBER.sub(r"\1", tag[0])


def png_of(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    file = BytesIO()
    figure.savefig(file, format="png", dpi=PNG_DPI)
    return file.getvalue()


def time_axis(axes: Axes, until_s: float) -> None:
    """Label the horizontal axis as simulated time from 0 to the end."""
    axes.set_xlim(0.0, max(until_s, 1e-3))
    axes.set_xlabel("simulated time [s]")
    axes.xaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 5, 10]))


def limit_lines(axes: Axes, values: Sequence[float], label: str) -> None:
    """Draw limits that must be kept, and name them at the right end."""
    for index, value in enumerate(values):
        axes.axhline(value, color=LIMIT, linewidth=1.2, linestyle=(0, (4, 2)))
        if index == 0:
            axes.annotate(
                label,
                (1.0, value),
                xycoords=axes.get_yaxis_transform(),
                xytext=(-3, 3),
                textcoords="offset points",
                color=LIMIT,
                fontsize=8.0,
                ha="right",
                va="bottom",
            )
