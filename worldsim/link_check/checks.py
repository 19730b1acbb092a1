"""Every parameter of a link: configured against measured, with its 99.9 % interval."""

from collections.abc import Callable, Iterator
from math import inf, sqrt
from typing import NamedTuple

import msgspec
import numpy as np

from netem.link import Cause, mean_loss, reception_probability
from netem.link_model import LinkModel
from netem.random_draws import SHAPES
from netem.wire.channels import LOCAL, Channel
from worldsim.link_check.intervals import (
    KOLMOGOROV,
    Z,
    delay_quantiles_s,
    effective_count,
    kolmogorov_smirnov,
    loss_bound,
    rank_correlation,
    rank_correlation_of,
    share_bound,
)
from worldsim.link_check.packets import PACKETS, SIZE_B, Flight, without_range_and_rate

EDGES = (1.2816, 0.0, -1.2816)
"""Where 90 %, 50 % and 10 % of the frames are received: below the budget, in shadowing_db."""


class Finding(NamedTuple):
    """One parameter, as configured and as measured; all three values in the unit of its name."""

    name: str
    configured: float
    measured: float
    tolerance: float
    """Half width of the 99.9 % interval."""

    @property
    def ok(self) -> bool:
        """Whether the measured value is within the interval."""
        return abs(self.measured - self.configured) <= self.tolerance


Fly = Callable[..., Flight]


def findings(link: LinkModel, seed: int, channel: Channel = LOCAL) -> Iterator[Finding]:
    """Fly up to PACKETS packets over a link for each of its parameters, and compare."""

    def fly(model: LinkModel, **how: float) -> Flight:
        return Flight(model, seed, channel, **how)  # type: ignore[arg-type]  # packets is an int

    near = without_range_and_rate(link)
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
    """Compare the distribution of delays, or where the delay is constant, the greatest one."""
    delay_s = flight.delay_s
    if not len(delay_s):
        return
    if link.jitter_ms == 0.0 and link.reorder_percent == 0.0:
        yield Finding("delay [ms]", link.delay_ms, 1000.0 * float(delay_s.max()), 1e-9)
        return
    quantiles = delay_quantiles_s(link, SHAPES[link.distribution])
    mean_ms, deviation_ms = 1000.0 * float(quantiles.mean()), 1000.0 * float(quantiles.std())
    root = sqrt(effective_count(link, len(delay_s)))
    measured_ms = 1000.0 * float(delay_s.mean())
    yield Finding("mean delay [ms]", mean_ms, measured_ms, Z * deviation_ms / root)
    distance = kolmogorov_smirnov(delay_s, quantiles)
    yield Finding(f"delay, {link.distribution} (D)", 0.0, distance, KOLMOGOROV / root)


def _rare(link: LinkModel, flight: Flight) -> Iterator[Finding]:
    """Compare duplicates among all packets, corruption and reordering among the delivered ones."""
    delivered = flight.delivered
    if link.duplicate_percent:
        yield _share("duplicate [%]", link.duplicate_percent, len(flight.copies), flight.packets)
    if link.corrupt_percent and len(delivered):
        flipped = int(np.count_nonzero(delivered["flipped_at"] >= 0.0))
        yield _share("corrupt [%]", link.corrupt_percent, flipped, len(delivered))
    if link.reorder_percent and link.delay_ms and not link.jitter_ms and len(delivered):
        overtaking = int(np.count_nonzero(delivered["delay_s"] == 0.0))
        yield _share("reorder [%]", link.reorder_percent, overtaking, len(delivered))


def _bursts(link: LinkModel, fly: Fly) -> Iterator[Finding]:
    """Compare the mean burst with 1/r, on a link that loses all while bad and none while good."""
    model = link.gemodel
    if model is None or model.p_percent == 0.0 or model.r_percent == 0.0:
        return
    all_or_none = msgspec.structs.replace(model, loss_bad_percent=100.0, loss_good_percent=0.0)
    bursts = fly(LinkModel(gemodel=all_or_none)).bursts
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
    configured = rank_correlation_of(link.delay_correlation_percent / 100.0)
    measured = rank_correlation(fly(alone).delay_s)
    yield Finding("delay correlation (ranks)", configured, measured, Z / sqrt(PACKETS))


def _edge(link: LinkModel, fly: Fly) -> Iterator[Finding]:
    """Compare the share that is received at three distances of the soft edge."""
    edge = link.path_loss
    if edge is None:
        return
    for sigmas in EDGES:
        room_db = edge.budget_db - sigmas * edge.shadowing_db - edge.reference_loss_db
        distance_m = edge.reference_distance_m * 10.0 ** (max(0.0, room_db) / (10 * edge.exponent))
        if distance_m > link.range_m:
            continue
        flight = fly(LinkModel(path_loss=edge), distance_m=distance_m)
        configured = 100.0 * reception_probability(edge, distance_m)
        received = int(np.count_nonzero(flight.first["cause"] == int(Cause.DELIVERED)))
        name = f"received at {distance_m:.3g} m [%]"
        yield _share(name, configured, received, flight.packets)


def _range(link: LinkModel, fly: Fly) -> Iterator[Finding]:
    """Compare what is received just within and just beyond the range."""
    if link.range_m == inf:
        return
    limited = LinkModel(range_m=link.range_m)
    for side, configured in ((1.0 - 1e-12, 100.0), (1.0 + 1e-12, 0.0)):
        flight = fly(limited, distance_m=link.range_m * side, packets=1000)
        measured = 100.0 * len(flight.delivered) / flight.packets
        where = "within" if configured else "beyond"
        yield Finding(f"received {where} range [%]", configured, measured, 0.0)


def _rate(link: LinkModel, fly: Fly) -> Iterator[Finding]:
    """Offer twice the rate: compare the rate of delivery, and the longest wait with the limit."""
    if link.rate_kbit == inf:
        return
    alone = LinkModel(
        rate_kbit=link.rate_kbit, rate_overhead_b=link.rate_overhead_b, limit=link.limit
    )
    size_bit = 8.0 * (SIZE_B + link.rate_overhead_b)
    each_s = size_bit / (1000.0 * link.rate_kbit)
    flight = fly(alone, gap_s=0.5 * each_s)
    delivered = flight.delivered
    out_s = delivered["count"] * flight.gap_s + delivered["delay_s"]
    rate_kbit = size_bit * (len(delivered) - 1) / float(out_s[-1] - out_s[0]) / 1000.0
    yield Finding("rate [kbit/s]", link.rate_kbit, rate_kbit, 1e-6 * link.rate_kbit)
    waiting = float(delivered["delay_s"].max()) / each_s
    most = min(link.limit, flight.packets // 2 + 1)
    yield Finding("limit [frames]", float(most), waiting, 1.0)


def _share(name: str, percent: float, count: int, among: int) -> Finding:
    share = count / max(1, among)
    return Finding(name, *_percent(percent / 100.0, share, share_bound(percent / 100.0, among)))


def _percent(configured: float, measured: float, bound: float) -> tuple[float, float, float]:
    return 100.0 * configured, 100.0 * measured, 100.0 * bound + 1e-9
