"""A picture of a survey: delays and bursts, measured against configured, link by link."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from netem.chance import SHAPES
from netem.link import received
from worldsim.survey.flight import Flight, close_by
from worldsim.survey.intervals import delays_s
from worldsim.survey.sets import ParameterSet

mpl.use("agg")
PACKETS = 20_000
BINS = 80
LONGEST = 40
"""Bursts longer than that are not drawn [frames]."""


def plot(sets: list[ParameterSet], seed: int, file: Path) -> None:
    """Draw each parameter set, a row of three, into a PNG file. Raises OSError."""
    figure = Figure(figsize=(13.0, 3.2 * len(sets)), layout="constrained")
    axes = figure.subplots(len(sets), 3, squeeze=False)
    for row, each in zip(axes, sets, strict=True):
        near = Flight(close_by(each.link), seed, each.channel, packets=PACKETS)
        _draw_delays(row[0], each, near)
        _draw_bursts(row[1], near)
        _draw_reach(row[2], each)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)


def _draw_delays(axes: Axes, each: ParameterSet, flight: Flight) -> None:
    quantiles = 1000.0 * delays_s(each.link, SHAPES[each.link.distribution])
    came = 1000.0 * flight.delay_s
    axes.set(title=each.name, xlabel="delay [ms]", ylabel="density", yticks=[])
    if not len(came):
        return
    top = max([float(quantiles[-1]), *came.tolist()]) * 1.05 + 1e-6
    bins = np.linspace(0.0, top, BINS).tolist()
    axes.hist(came, bins, density=True, color="tab:blue", alpha=0.5, label="measured")
    axes.hist(quantiles, bins, density=True, histtype="step", color="black", label="configured")
    axes.legend()


def _draw_bursts(axes: Axes, flight: Flight) -> None:
    lengths = flight.bursts
    counts = np.bincount(lengths[lengths <= LONGEST], minlength=2)[1:]
    axes.bar(np.arange(1, len(counts) + 1), counts / max(1, counts.sum()), color="tab:orange")
    axes.set(title="losses in a row", xlabel="frames", ylabel="share")
    axes.set_yscale("symlog", linthresh=1e-3)


def _draw_reach(axes: Axes, each: ParameterSet) -> None:
    link = each.link
    reach_m = link.reach_m if link.reach_m < np.inf else 10.0
    away_m = np.linspace(0.0, 1.2 * reach_m, 400)
    share = [
        0.0 if far > link.range_m else received(link.path_loss, far) if link.path_loss else 1.0
        for far in away_m.tolist()
    ]
    axes.plot(away_m, share, color="black")
    axes.set(title="reception without losses", xlabel="distance [m]", ylim=(-0.05, 1.05))
