"""How long after it was due each frame was used: counted by an agent, told to the world.

A frame is due when it was sent, plus its wait for its sender's rate, plus the delay that its link
drew for it. It is used at an observation. What lies between the two, in simulated time, is its
excess: never less than nothing, and on a host that keeps up no more than one slot and one tick.

An excess falls into one of equal bins, each an eighth of a slot and its upper edge included, so
that slots and ticks are edges; a last bin has what lies beyond.
"""

from collections.abc import Sequence
from typing import Annotated

import msgspec
from msgspec import Meta

from netem.wire.channels import CHANNELS
from netem.wire.frame import Count, Frame, unpack_typed

BINS_A_SLOT = 8
SLOTS_SEEN = 32
BINS = SLOTS_SEEN * BINS_A_SLOT + 2
"""The first bin is for no excess at all, the last for more than SLOTS_SEEN."""
SLACK_US = 1.5
"""Times are told in whole microseconds: so much above an edge is rounding."""
MAX_ARRIVALS_B = 8 * 1024

Bins = Annotated[tuple[Count, ...], Meta(min_length=BINS, max_length=BINS)]


class Arrivals(msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """What an agent's process counted since it began: bins for each channel, the greatest excess.

    most_us: channel by channel [us].
    """

    incarnation: Count
    counts: Annotated[tuple[Bins, ...], Meta(min_length=len(CHANNELS), max_length=len(CHANNELS))]
    most_us: Annotated[tuple[Count, ...], Meta(min_length=len(CHANNELS), max_length=len(CHANNELS))]


def bin_of(excess_us: int, slot_s: float) -> int:
    """Return the bin that an excess [us] belongs to, where a slot takes ``slot_s`` [s]."""
    # Rounded up: a bin has its upper edge.
    return min(-int((SLACK_US - excess_us) * BINS_A_SLOT // (1e6 * slot_s)), BINS - 1)


class Tally:
    """Counts the frames of one agent by their excess, channel by channel; slot_s: of a slot [s]."""

    def __init__(self, slot_s: float) -> None:
        self._slot_s = slot_s
        self._counts = [[0] * BINS for _ in CHANNELS]
        self._most_us = [0] * len(CHANNELS)

    def note(self, frames: Sequence[Frame], early_us: Sequence[int], slots: int) -> None:
        """Count frames that are used ``slots`` after their batch's slot.

        early_us: how long before that slot each of them was due.
        """
        since_us = round(1e6 * slots * self._slot_s)
        for frame, each_us in zip(frames, early_us, strict=True):
            excess_us, channel = since_us + each_us, frame.channel
            self._counts[channel][bin_of(excess_us, self._slot_s)] += 1
            self._most_us[channel] = max(self._most_us[channel], excess_us)

    def told(self, incarnation: int) -> Arrivals:
        """Return what was counted so far."""
        return Arrivals(incarnation, tuple(map(tuple, self._counts)), tuple(self._most_us))


_arrivals = msgspec.msgpack.Decoder(Arrivals).decode


def unpack_arrivals(data: bytes) -> Arrivals:
    """Decode what an agent told, or raise WireError."""
    return unpack_typed(data, _arrivals, MAX_ARRIVALS_B)
