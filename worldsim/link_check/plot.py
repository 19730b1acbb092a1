"""A picture of a survey: delays, bursts and reception, measured and configured, link by link."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from netem.link import Cause, LinkModel, received
from netem.random_draws import SHAPES
from worldsim.link_check.intervals import delays_s
from worldsim.link_check.packets import Flight, close_by
from worldsim.link_check.parameter_sets import ParameterSet

mpl.use("agg")
PACKETS = 20_000
BINS = 80
PLACES = 16
"""Distances at which reception is measured."""
LONGEST = 40
"""Bursts longer than that are not drawn [frames]."""


def plot(sets: list[ParameterSet], seed: int, file: Path) -> None:
    """Draw each parameter set, a row of three, into a file. Raises OSError."""
    figure = drawn(sets, seed)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)


def drawn(sets: list[ParameterSet], seed: int) -> Figure:
    """Return the picture of all parameter sets, a row of three each."""
    figure = Figure(figsize=(13.0, 3.2 * len(sets)), layout="constrained")
    axes = figure.subplots(len(sets), 3, squeeze=False)
    for row, each in zip(axes, sets, strict=True):
        near = Flight(close_by(each.link), seed, each.channel, packets=PACKETS)
        _draw_delays(row[0], each, near)
        _draw_bursts(row[1], near)
        _draw_reach(row[2], each, seed)
    return figure


def _draw_delays(axes: Axes, each: ParameterSet, flight: Flight) -> None:
    quantiles = 1000.0 * delays_s(each.link, SHAPES[each.link.distribution])
    came = 1000.0 * flight.delay_s
    axes.set(title=each.name, xlabel="delay [ms]", ylabel="density", yticks=[])
    if not len(came):
        _say(axes, "nothing came")
        return
    top = max([float(quantiles[-1]), *came.tolist()]) * 1.05 + 1e-6
    bins = np.linspace(0.0, top, BINS).tolist()
    axes.hist(came, bins, density=True, color="tab:blue", alpha=0.5, label="measured")
    axes.hist(quantiles, bins, density=True, histtype="step", color="black", label="configured")
    axes.legend()


def _draw_bursts(axes: Axes, flight: Flight) -> None:
    lengths = flight.bursts
    shown = lengths[lengths <= LONGEST]
    axes.set(title="losses in a row", xlabel="frames", ylabel="share")
    if not len(shown):
        _say(axes, f"longer than {LONGEST} frames" if len(lengths) else "no losses")
        return
    counts = np.bincount(shown)[1:]
    axes.bar(np.arange(1, len(counts) + 1), counts / counts.sum(), color="tab:orange")
    axes.set_yscale("symlog", linthresh=1e-3)


def _draw_reach(axes: Axes, each: ParameterSet, seed: int) -> None:
    link = each.link
    most_m = 1.2 * (link.reach_m if link.reach_m < np.inf else 10.0)
    away_m = np.linspace(0.0, most_m, 400)
    tried_m = (np.arange(PLACES) + 0.5) / PLACES * most_m
    reach = LinkModel(range_m=link.range_m, path_loss=link.path_loss)
    came = [
        Flight(reach, seed, each.channel, far, packets=PACKETS // PLACES).share(Cause.DELIVERED)
        for far in tried_m.tolist()
    ]
    axes.plot(tried_m, came, "o", color="tab:blue", alpha=0.5, label="measured")
    axes.plot(away_m, [_received(reach, far) for far in away_m.tolist()], "k", label="configured")
    axes.set(title="reception without losses", xlabel="distance [m]", ylim=(-0.05, 1.05))
    axes.legend()


def _received(link: LinkModel, away_m: float) -> float:
    if away_m > link.range_m:
        return 0.0
    return received(link.path_loss, away_m) if link.path_loss is not None else 1.0


def _say(axes: Axes, text: str) -> None:
    """Say in words what there is no picture of."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center")
    axes.set(xticks=[], yticks=[])
