"""Packets over one link, and what the medium's delivery log says became of them.

Two radios and the medium that flies fleets, nothing else.
"""

from math import inf

import msgspec
import numpy as np
from numpy.typing import NDArray

from netem.delivery_log import entries
from netem.link import Cause
from netem.link_model import LinkModel
from netem.link_parameters import Conditions, LinkKeys
from netem.medium import Medium
from netem.messages import MediumSetup
from netem.wire.channels import Channel
from netem.wire.frame import Outgoing, Transmission

PACKETS = 100_000
PACKETS_PER_SLOT = 100
SIZE_B = 200
DELIVERED = int(Cause.DELIVERED)


def conditions_of(model: LinkModel) -> Conditions:
    """Return the conditions under which every link is like a model."""
    values = {key: getattr(model, key) for key in LinkKeys.__struct_fields__}
    return Conditions(**{key: value for key, value in values.items() if value != np.inf})


def without_range_and_rate(link: LinkModel) -> LinkModel:
    """Return a link whose frames get across at any distance and never wait in a queue."""
    return msgspec.structs.replace(link, path_loss=None, rate_kbit=inf, own_rate=False)


class Flight:
    """Packets sent one by one from agent 0 to agent 1, and their fates."""

    def __init__(
        self,
        model: LinkModel,
        seed: int,
        channel: Channel = 0,
        distance_m: float = 0.0,
        gap_s: float = 0.01,
        packets: int = PACKETS,
    ) -> None:
        self.packets = packets
        self.gap_s = gap_s
        """Time between two packets [s]."""
        medium = Medium(MediumSetup(seed, 2, 4, 80.0, conditions_of(model)))
        medium.place(((0.0, 0.0, 0.0), (distance_m, 0.0, 0.0)))
        logged = entries(_logged(medium, channel, gap_s, packets))
        self.first = logged[logged["copy"] == 0]
        """Log entries of the packets, in the order sent; none for a packet out of range."""
        self.copies = logged[logged["copy"] == 1]
        """Log entries of their duplicates."""

    @property
    def delivered(self) -> NDArray[np.void]:
        """The log entries of the delivered packets, without their duplicates."""
        delivered: NDArray[np.void] = self.first[self.first["cause"] == DELIVERED]
        return delivered

    @property
    def delay_s(self) -> NDArray[np.float64]:
        """The delays of the delivered packets, in the order sent [s]."""
        return np.asarray(self.delivered["delay_s"])

    def share(self, cause: Cause) -> float:
        """Return the share of packets that ended with a cause."""
        return float(np.count_nonzero(self.first["cause"] == int(cause))) / self.packets

    @property
    def bursts(self) -> NDArray[np.int64]:
        """The number of packets in each run of consecutive losses."""
        lost = np.zeros(self.packets + 2, dtype=np.int8)
        gone = self.first["cause"] == int(Cause.DROPPED_LOSS)
        lost[np.asarray(self.first["count"])[gone] + 1] = 1
        turns = np.flatnonzero(np.diff(lost))
        return turns[1::2] - turns[::2]


def _logged(medium: Medium, channel: Channel, gap_s: float, packets: int) -> bytes:
    """Send packets from agent 0; return the delivery log's pages for agent 1."""
    one = Transmission(0, 0, (Outgoing(channel, bytes(SIZE_B)),))
    pages = []
    for start in range(0, packets, PACKETS_PER_SLOT):
        for count in range(start, min(start + PACKETS_PER_SLOT, packets)):
            medium.transmit(0, count * gap_s, one)
        medium.discard(1)
        pages.append(medium.pages().get(1, b""))
    return b"".join(pages)
