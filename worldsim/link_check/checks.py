"""Every parameter of a link, configured against measured, each with its 99.9 % interval."""

from collections.abc import Callable, Iterator
from math import inf, sqrt
from typing import NamedTuple

import msgspec
import numpy as np

from netem.link import Cause, LinkModel, mean_loss, received
from netem.random_draws import SHAPES
from netem.wire.channels import LOCAL, Channel
from worldsim.link_check.intervals import (
    KOLMOGOROV,
    Z,
    delays_s,
    effective,
    farthest,
    loss_bound,
    rank_correlation,
    rank_correlation_of,
    share_bound,
)
from worldsim.link_check.packets import PACKETS, SIZE_B, Flight, close_by

EDGES = (1.2816, 0.0, -1.2816)
"""Where nine of ten frames are received, half of them, and one of ten: in shadowing_db."""


class Finding(NamedTuple):
    """A measure: what is configured, what was measured, how far off it may be."""

    name: str
    configured: float
    measured: float
    bound: float

    @property
    def held(self) -> bool:
        """Whether the measure is within its interval."""
        return abs(self.measured - self.configured) <= self.bound


Fly = Callable[..., Flight]


def findings(link: LinkModel, seed: int, channel: Channel = LOCAL) -> Iterator[Finding]:
    """Fly packets over a link, PACKETS for each parameter set, and compare."""

    def fly(model: LinkModel, **how: float) -> Flight:
        return Flight(model, seed, channel, **how)  # type: ignore[arg-type]

    near = close_by(link)
    flight = fly(near)
    yield from _losses(near, flight)
    yield from _delays(near, flight)
    yield from _rare(near, flight)
    yield from _bursts(near, fly)
    yield from _correlation(near, fly)
    yield from _edge(link, fly)
    yield from _range(link, fly)
    yield from _rate(link, fly)


def _losses(link: LinkModel, flight: Flight) -> Iterator[Finding]:
    bound = loss_bound(link, flight.packets)
    yield Finding("loss [%]", *_percent(mean_loss(link), flight.share(Cause.DROPPED_LOSS), bound))


def _delays(link: LinkModel, flight: Flight) -> Iterator[Finding]:
    """Compare delays: their distribution where there is any, else each of them."""
    came = flight.delay_s
    if not len(came):
        return
    if link.jitter_ms == 0.0 and link.reorder_percent == 0.0:
        yield Finding("delay [ms]", link.delay_ms, 1000.0 * float(came.max()), 1e-9)
        return
    quantiles = delays_s(link, SHAPES[link.distribution])
    mean_ms, deviation_ms = 1000.0 * float(quantiles.mean()), 1000.0 * float(quantiles.std())
    root = sqrt(effective(link, len(came)))
    measured_ms = 1000.0 * float(came.mean())
    yield Finding("mean delay [ms]", mean_ms, measured_ms, Z * deviation_ms / root)
    far = farthest(came, quantiles)
    yield Finding(f"delay, {link.distribution} (D)", 0.0, far, KOLMOGOROV / root)


def _rare(link: LinkModel, flight: Flight) -> Iterator[Finding]:
    """Compare duplicates among all, and turned bits and overtaking among those that came."""
    came = flight.delivered
    if link.duplicate_percent:
        yield _share("duplicate [%]", link.duplicate_percent, len(flight.copies), flight.packets)
    if link.corrupt_percent and len(came):
        turned = int(np.count_nonzero(came["turned"] >= 0.0))
        yield _share("corrupt [%]", link.corrupt_percent, turned, len(came))
    if link.reorder_percent and link.delay_ms and not link.jitter_ms and len(came):
        overtaking = int(np.count_nonzero(came["delay_s"] == 0.0))
        yield _share("reorder [%]", link.reorder_percent, overtaking, len(came))


def _bursts(link: LinkModel, fly: Fly) -> Iterator[Finding]:
    """Compare the mean burst with 1/r, where all is lost while the link is bad and nothing else."""
    model = link.gemodel
    if model is None or model.p_percent == 0.0 or model.r_percent == 0.0:
        return
    whole = msgspec.structs.replace(model, loss_bad_percent=100.0, loss_good_percent=0.0)
    bursts = fly(LinkModel(gemodel=whole)).bursts
    back = model.r_percent / 100.0
    bound = Z * sqrt((1.0 - back) / (back * back * max(1, len(bursts))))
    yield Finding("mean burst [frames]", 1.0 / back, float(bursts.mean()), bound + 1e-9)


def _correlation(link: LinkModel, fly: Fly) -> Iterator[Finding]:
    if not (link.delay_correlation_percent and link.jitter_ms):
        return
    alone = LinkModel(
        delay_ms=10.0 * link.jitter_ms,
        jitter_ms=link.jitter_ms,
        distribution="normal",
        delay_correlation_percent=link.delay_correlation_percent,
    )
    wanted = rank_correlation_of(link.delay_correlation_percent / 100.0)
    measured = rank_correlation(fly(alone).delay_s)
    yield Finding("delay correlation (ranks)", wanted, measured, Z / sqrt(PACKETS))


def _edge(link: LinkModel, fly: Fly) -> Iterator[Finding]:
    edge = link.path_loss
    if edge is None:
        return
    for sigmas in EDGES:
        room_db = edge.budget_db - sigmas * edge.shadowing_db - edge.reference_loss_db
        distance_m = edge.reference_distance_m * 10.0 ** (max(0.0, room_db) / (10 * edge.exponent))
        if distance_m > link.range_m:
            continue
        flight = fly(LinkModel(path_loss=edge), distance_m=distance_m)
        wanted = received(edge, distance_m)
        came = int(np.count_nonzero(flight.first["cause"] == int(Cause.DELIVERED)))
        yield _share(f"received at {distance_m:.3g} m [%]", 100.0 * wanted, came, flight.packets)


def _range(link: LinkModel, fly: Fly) -> Iterator[Finding]:
    """Compare what gets just within and just beyond the hard disc."""
    if link.range_m == inf:
        return
    disc = LinkModel(range_m=link.range_m)
    for side, wanted in ((1.0 - 1e-12, 100.0), (1.0 + 1e-12, 0.0)):
        flight = fly(disc, distance_m=link.range_m * side, packets=1000)
        came = 100.0 * len(flight.delivered) / flight.packets
        word = "within" if wanted else "beyond"
        yield Finding(f"received {word} range [%]", wanted, came, 0.0)


def _rate(link: LinkModel, fly: Fly) -> Iterator[Finding]:
    """Send twice as much as goes through: what comes out is the rate, what waits is the limit."""
    if link.rate_kbit == inf:
        return
    alone = LinkModel(
        rate_kbit=link.rate_kbit, rate_overhead_b=link.rate_overhead_b, limit=link.limit
    )
    size_bit = 8.0 * (SIZE_B + link.rate_overhead_b)
    each_s = size_bit / (1000.0 * link.rate_kbit)
    flight = fly(alone, gap_s=0.5 * each_s)
    came = flight.delivered
    out_s = came["count"] * flight.gap_s + came["delay_s"]
    rate_kbit = size_bit * (len(came) - 1) / float(out_s[-1] - out_s[0]) / 1000.0
    yield Finding("rate [kbit/s]", link.rate_kbit, rate_kbit, 1e-6 * link.rate_kbit)
    waiting = float(came["delay_s"].max()) / each_s
    most = min(link.limit, flight.packets // 2 + 1)
    yield Finding("limit [frames]", float(most), waiting, 1.0)


def _share(name: str, percent: float, count: int, among: int) -> Finding:
    share = count / max(1, among)
    return Finding(name, *_percent(percent / 100.0, share, share_bound(percent / 100.0, among)))


def _percent(configured: float, measured: float, bound: float) -> tuple[float, float, float]:
    return 100.0 * configured, 100.0 * measured, 100.0 * bound + 1e-9
