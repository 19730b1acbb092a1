"""Delivery latency: how long after it was due each frame was used, counted by its receiver.

A frame is due when it was sent, plus its wait in the sender's queue, plus the delay of its link. It
is used at an observation. The difference, in simulated time, is its excess: never negative, and at
most one slot and one tick on a host that keeps up.

Excesses are counted in equal bins of an eighth of a slot, which include their upper edges, so that
slots and ticks are edges. The last bin counts everything beyond.
"""

from collections.abc import Sequence
from typing import Annotated

import msgspec
from msgspec import Meta

from netem.wire.channels import CHANNELS
from netem.wire.frame import Count, Frame, unpack_typed

BINS_PER_SLOT = 8
BINNED_SLOTS = 32
BINS = BINNED_SLOTS * BINS_PER_SLOT + 2
"""The first bin is for no excess at all, the last for more than BINNED_SLOTS."""
ROUNDING_US = 1.5
"""Times on the wire are whole microseconds; so much above an edge is rounding."""
MAX_REPORT_B = 8 * 1024

Bins = Annotated[tuple[Count, ...], Meta(min_length=BINS, max_length=BINS)]


class LatencyReport(
    msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True
):
    """What an agent's process has counted since it started."""

    incarnation: Count
    counts: Annotated[tuple[Bins, ...], Meta(min_length=len(CHANNELS), max_length=len(CHANNELS))]
    """Frames in each bin, channel by channel."""
    max_us: Annotated[tuple[Count, ...], Meta(min_length=len(CHANNELS), max_length=len(CHANNELS))]
    """Greatest excess, channel by channel [us]."""


def bin_of(excess_us: int, slot_s: float) -> int:
    """Return the bin of an excess [us], where a slot lasts ``slot_s`` [s]."""
    # Rounded up: a bin includes its upper edge.
    return min(-int((ROUNDING_US - excess_us) * BINS_PER_SLOT // (1e6 * slot_s)), BINS - 1)


class LatencyHistogram:
    """Counts the frames of one agent by their excess; slot_s: duration of a slot [s]."""

    def __init__(self, slot_s: float) -> None:
        self._slot_s = slot_s
        self._counts = [[0] * BINS for _ in CHANNELS]
        self._max_us = [0] * len(CHANNELS)

    def add(self, frames: Sequence[Frame], early_us: Sequence[int], slots: int) -> None:
        """Count frames that are used ``slots`` slots after their batch's slot.

        early_us: how long before their batch's slot they were due, one by one [us].
        """
        since_us = round(1e6 * slots * self._slot_s)
        for frame, each_us in zip(frames, early_us, strict=True):
            excess_us, channel = since_us + each_us, frame.channel
            self._counts[channel][bin_of(excess_us, self._slot_s)] += 1
            self._max_us[channel] = max(self._max_us[channel], excess_us)

    def report(self, incarnation: int) -> LatencyReport:
        """Return the counts so far."""
        return LatencyReport(incarnation, tuple(map(tuple, self._counts)), tuple(self._max_us))


_report = msgspec.msgpack.Decoder(LatencyReport).decode


def unpack_report(data: bytes) -> LatencyReport:
    """Decode an agent's report, or raise WireError."""
    return unpack_typed(data, _report, MAX_REPORT_B)
