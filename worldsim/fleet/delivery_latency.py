"""How late frames came, from what the agents count: the last word of each process, and the sum.

An agent's word is its own, and no more: one that contradicts itself, counts backwards, or speaks
for a process that is not the agent's present one, is refused; one that counts more frames than the
radio delivered to everybody is left out.
"""

from collections.abc import Sequence
from itertools import accumulate
from typing import Any

from netem.wire.channels import CHANNELS
from netem.wire.frame import WireError
from netem.wire.latency import BINS_PER_SLOT, LatencyReport, bin_of, unpack_report

PERCENTILES = (1, 5, 50, 95, 99)
Counts = Sequence[int]


class ArrivalBook:
    """What agents told of frames that came; slots_per_tick and slot_s [s] as in the run's clock."""

    def __init__(self, slots_per_tick: int, slot_s: float) -> None:
        self._bound_bins = (1 + slots_per_tick) * BINS_PER_SLOT
        self._slot_s = slot_s
        self._bin_ms = 1e3 * slot_s / BINS_PER_SLOT
        self._told: dict[tuple[int, int], LatencyReport] = {}

    def take(self, agent: int, incarnation: int, data: bytes, now_s: float) -> None:
        """Take what an agent told of itself by ``now_s`` [s].

        Raises WireError where it is not to be believed.
        """
        told = unpack_report(data)
        if max(told.max_us) > 1e6 * now_s or not self._consistent(told):
            raise WireError("an excess that none of its frames can have")
        if told.incarnation != incarnation:
            raise WireError(f"of incarnation {told.incarnation}, where {incarnation} flies")
        before = self._told.get((agent, incarnation))
        if before is not None and _backwards(before, told):
            raise WireError("it counts backwards")
        self._told[agent, incarnation] = told

    def summary(self, delivered: int) -> dict[str, Any] | None:
        """Return the distribution as summary.json has it, None without a frame.

        delivered: how many frames the radio says it delivered at all.
        """
        told = [each for each in self._told.values() if _frames(each) <= delivered]
        whole = self._distribution(told, range(len(CHANNELS)))
        if whole is None:
            return None
        bound_ms = self._bound_bins * self._bin_ms
        each = {name: self._distribution(told, [at]) for at, name in enumerate(CHANNELS)}
        return {"bound_ms": bound_ms, **whole, "channels": each}

    def _consistent(self, told: LatencyReport) -> bool:
        """Whether the greatest excess of each channel is where its last frames are."""
        last = [max((at for at, n in enumerate(bins) if n), default=0) for bins in told.counts]
        return last == [bin_of(max_us, self._slot_s) for max_us in told.max_us]

    def _distribution(
        self, told: Sequence[LatencyReport], channels: Sequence[int]
    ) -> dict[str, Any] | None:
        bins = [each.counts[at] for each in told for at in channels]
        counts = [sum(column) for column in zip(*bins, strict=True)]
        frames = sum(counts)
        if not frames:
            return None
        most_ms = max(each.max_us[at] for each in told for at in channels) / 1000.0
        excess_ms = {
            f"p{percent}": min(at * self._bin_ms, most_ms) if at < len(counts) - 1 else most_ms
            for percent in PERCENTILES
            for at in [quantile(counts, percent)]
        }
        return {
            "frames": frames,
            "within_fraction": sum(counts[: self._bound_bins + 1]) / frames,
            "excess_ms": {**excess_ms, "max": most_ms},
        }


def quantile(counts: Counts, percent: float) -> int:
    """Return the bin at or below which so many percent of all counted lie; there is one at least.

    >>> quantile([0, 3, 0, 1], 50), quantile([0, 3, 0, 1], 99)
    (1, 3)
    """
    wanted = percent / 100.0 * sum(counts)
    return next(at for at, so_far in enumerate(accumulate(counts)) if so_far and so_far >= wanted)


def _frames(told: LatencyReport) -> int:
    return sum(map(sum, told.counts))


def _backwards(before: LatencyReport, now: LatencyReport) -> bool:
    less = any(
        one > other
        for ones, others in zip(before.counts, now.counts, strict=True)
        for one, other in zip(ones, others, strict=True)
    )
    return less or any(a > b for a, b in zip(before.max_us, now.max_us, strict=True))
