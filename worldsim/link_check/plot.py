"""The picture of a link check: delays, bursts and reception, measured and configured."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from netem.link import Cause, reception_probability
from netem.link_model import LinkModel
from netem.random_draws import SHAPES
from worldsim.link_check.intervals import delay_quantiles_s
from worldsim.link_check.packets import Flight, without_range_and_rate
from worldsim.link_check.parameter_sets import ParameterSet

mpl.use("agg")
PACKETS = 20_000
BINS = 80
DISTANCES = 16
"""Number of distances at which reception is measured."""
LONGEST = 40
"""Longest burst that is drawn [frames]."""


def plot(sets: list[ParameterSet], seed: int, file: Path) -> None:
    """Write a picture with a row of three diagrams for each parameter set. Raises OSError."""
    figure = draw(sets, seed)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)


def draw(sets: list[ParameterSet], seed: int) -> Figure:
    """Return the figure of all parameter sets, three diagrams each."""
    figure = Figure(figsize=(13.0, 3.2 * len(sets)), layout="constrained")
    axes = figure.subplots(len(sets), 3, squeeze=False)
    for row, each in zip(axes, sets, strict=True):
        near = Flight(without_range_and_rate(each.link), seed, each.channel, packets=PACKETS)
        _draw_delays(row[0], each, near)
        _draw_bursts(row[1], near)
        _draw_reception(row[2], each, seed)
    return figure


def _draw_delays(axes: Axes, each: ParameterSet, flight: Flight) -> None:
    quantiles = 1000.0 * delay_quantiles_s(each.link, SHAPES[each.link.distribution])
    delays = 1000.0 * flight.delay_s
    axes.set(title=each.name, xlabel="delay [ms]", ylabel="density", yticks=[])
    if not len(delays):
        _write(axes, "nothing was delivered")
        return
    top = max([float(quantiles[-1]), *delays.tolist()]) * 1.05 + 1e-6
    bins = np.linspace(0.0, top, BINS).tolist()
    axes.hist(delays, bins, density=True, color="tab:blue", alpha=0.5, label="measured")
    axes.hist(quantiles, bins, density=True, histtype="step", color="black", label="configured")
    axes.legend()


def _draw_bursts(axes: Axes, flight: Flight) -> None:
    lengths = flight.bursts
    shown = lengths[lengths <= LONGEST]
    axes.set(title="losses in a row", xlabel="frames", ylabel="share")
    if not len(shown):
        _write(axes, f"longer than {LONGEST} frames" if len(lengths) else "no losses")
        return
    counts = np.bincount(shown)[1:]
    axes.bar(np.arange(1, len(counts) + 1), counts / counts.sum(), color="tab:orange")
    axes.set_yscale("symlog", linthresh=1e-3)


def _draw_reception(axes: Axes, each: ParameterSet, seed: int) -> None:
    link = each.link
    last_m = 1.2 * (link.reach_m if link.reach_m < np.inf else 10.0)
    distance_m = np.linspace(0.0, last_m, 400)
    measured_m = (np.arange(DISTANCES) + 0.5) / DISTANCES * last_m
    reach = LinkModel(range_m=link.range_m, path_loss=link.path_loss)
    measured = [
        Flight(reach, seed, each.channel, far, packets=PACKETS // DISTANCES).share(Cause.DELIVERED)
        for far in measured_m.tolist()
    ]
    axes.plot(measured_m, measured, "o", color="tab:blue", alpha=0.5, label="measured")
    axes.plot(
        distance_m, [_received(reach, far) for far in distance_m.tolist()], "k", label="configured"
    )
    axes.set(title="reception without losses", xlabel="distance [m]", ylim=(-0.05, 1.05))
    axes.legend()


def _received(link: LinkModel, distance_m: float) -> float:
    if distance_m > link.range_m:
        return 0.0
    edge = link.path_loss
    return reception_probability(edge, distance_m) if edge is not None else 1.0


def _write(axes: Axes, text: str) -> None:
    """Write why there is nothing to draw."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center")
    axes.set(xticks=[], yticks=[])
