"""How late frames arrived at the agents: the last counts of each process, and their distribution.

An agent's counts are its own claim. Counts are rejected when they contradict each other, decrease,
or belong to another process than the agent's current one; an agent that counts more frames than the
radio delivered in total is left out.
"""

from collections.abc import Sequence
from itertools import accumulate

import msgspec

from netem.wire.channels import CHANNELS
from netem.wire.frame import WireError
from netem.wire.latency import BINS_PER_SLOT, LatencyReport, bin_of, unpack_report

PERCENTILES = (1, 5, 50, 95, 99)
Counts = Sequence[int]


class ChannelLatency(msgspec.Struct, frozen=True):
    """The extra delay of one channel's frames, in summary.json's keys."""

    frames: int
    within_fraction: float  # share of frames within ``bound_ms``
    excess_ms: dict[str, float]  # percentiles "p1" to "p99", and "max" [ms]


class DeliveryLatency(msgspec.Struct, frozen=True):
    """The extra delay of all frames, in summary.json's keys."""

    bound_ms: float  # one slot and one tick [ms]
    frames: int
    within_fraction: float  # share of frames within ``bound_ms``
    excess_ms: dict[str, float]  # percentiles "p1" to "p99", and "max" [ms]
    channels: dict[str, ChannelLatency | None]  # by name; None without a frame


class LatencyCollector:
    """Collects the agents' counts of arrived frames by their extra delay.

    slots_per_tick and slot_s [s] are those of the run's clock.
    """

    def __init__(self, slots_per_tick: int, slot_s: float) -> None:
        self._bound_bins = (1 + slots_per_tick) * BINS_PER_SLOT
        self._slot_s = slot_s
        self._bin_ms = 1e3 * slot_s / BINS_PER_SLOT
        self._latest: dict[int, LatencyReport] = {}  # by agent
        self._ended: dict[int, LatencyReport] = {}  # of replaced processes together, by agent

    def add(self, agent: int, incarnation: int, data: bytes, now_s: float) -> None:
        """Take the encoded counts of an agent's current process at simulated time ``now_s`` [s].

        Raises WireError when they do not decode or are not plausible.
        """
        report = unpack_report(data)
        if max(report.max_us) > 1e6 * now_s or not self._consistent(report):
            raise WireError("an extra delay that none of the counted frames can have")
        if report.incarnation != incarnation:
            raise WireError(f"of incarnation {report.incarnation}; {incarnation} is running")
        previous = self._latest.get(agent)
        if previous is not None and previous.incarnation != incarnation:
            ended = self._ended.get(agent)
            self._ended[agent] = previous if ended is None else _together(ended, previous)
        elif previous is not None and _decreased(previous, report):
            raise WireError("counts have decreased")
        self._latest[agent] = report

    def summary(self, delivered: int) -> DeliveryLatency | None:
        """Return the distribution over all agents, None without a frame.

        delivered: number of frames that the radio delivered in total.
        """
        every = [*self._latest.values(), *self._ended.values()]
        counted = [each for each in every if _frames(each) <= delivered]
        total = self._distribution(counted, range(len(CHANNELS)))
        if total is None:
            return None
        return DeliveryLatency(
            self._bound_bins * self._bin_ms,
            total.frames,
            total.within_fraction,
            total.excess_ms,
            {name: self._distribution(counted, [at]) for at, name in enumerate(CHANNELS)},
        )

    def _consistent(self, report: LatencyReport) -> bool:
        """Return whether the greatest delay of each channel lies in its last bin with frames."""
        last = [max((at for at, n in enumerate(bins) if n), default=0) for bins in report.counts]
        return last == [bin_of(max_us, self._slot_s) for max_us in report.max_us]

    def _distribution(
        self, counted: Sequence[LatencyReport], channels: Sequence[int]
    ) -> ChannelLatency | None:
        bins = [each.counts[at] for each in counted for at in channels]
        counts = [sum(column) for column in zip(*bins, strict=True)]
        frames = sum(counts)
        if not frames:
            return None
        most_ms = max(each.max_us[at] for each in counted for at in channels) / 1000.0
        excess_ms = {
            f"p{percent}": min(at * self._bin_ms, most_ms) if at < len(counts) - 1 else most_ms
            for percent in PERCENTILES
            for at in [quantile(counts, percent)]
        }
        within = sum(counts[: self._bound_bins + 1]) / frames
        return ChannelLatency(frames, within, {**excess_ms, "max": most_ms})


def quantile(counts: Counts, percent: float) -> int:
    """Return the bin of a percentile: the first at which so many percent are counted.

    At least one count must not be zero.

    >>> quantile([0, 3, 0, 1], 50), quantile([0, 3, 0, 1], 99)
    (1, 3)
    """
    wanted = percent / 100.0 * sum(counts)
    return next(at for at, so_far in enumerate(accumulate(counts)) if so_far and so_far >= wanted)


def _together(one: LatencyReport, other: LatencyReport) -> LatencyReport:
    """Return the counts of two processes of an agent together."""
    counts = [
        tuple(map(sum, zip(a, b, strict=True)))
        for a, b in zip(one.counts, other.counts, strict=True)
    ]
    max_us = tuple(map(max, zip(one.max_us, other.max_us, strict=True)))
    return LatencyReport(other.incarnation, tuple(counts), max_us)


def _frames(report: LatencyReport) -> int:
    return sum(map(sum, report.counts))


def _decreased(previous: LatencyReport, current: LatencyReport) -> bool:
    fewer = any(
        now < before
        for befores, nows in zip(previous.counts, current.counts, strict=True)
        for before, now in zip(befores, nows, strict=True)
    )
    return fewer or any(
        now < before for before, now in zip(previous.max_us, current.max_us, strict=True)
    )
