"""Packets over one link: what the medium's journal says became of them.

Two radios and nothing else, so what is measured is the medium object that flies fleets.
"""

from dataclasses import fields, replace
from math import inf

import numpy as np
from numpy.typing import NDArray

from netem.delivery_log import entries
from netem.link import Cause, LinkModel
from netem.link_keys import Conditions, LinkKeys
from netem.medium import Medium
from netem.messages import MediumSetup
from netem.wire.channels import LOCAL, Channel
from netem.wire.frame import Outgoing, Transmission

PACKETS = 100_000
AT_ONCE = 100
SIZE_B = 200
DELIVERED = int(Cause.DELIVERED)


def conditions_of(model: LinkModel) -> Conditions:
    """Return the conditions under which every link is like a model."""
    names = set(LinkKeys.__struct_fields__)
    values = {each.name: getattr(model, each.name) for each in fields(model) if each.name in names}
    return Conditions(**{name: value for name, value in values.items() if value != np.inf})


def close_by(link: LinkModel) -> LinkModel:
    """Return a link as it is at no distance and where nothing waits to be sent."""
    return replace(link, path_loss=None, rate_kbit=inf, own_rate=False)


class Flight:
    """What became of packets sent one by one from agent 0 to agent 1, ``gap_s`` apart.

    first: the packets themselves, in the order in which they were sent, as journal entries; copies:
    their duplicates. A packet that is out of range has no entry.
    """

    def __init__(
        self,
        model: LinkModel,
        seed: int,
        channel: Channel = LOCAL,
        distance_m: float = 0.0,
        gap_s: float = 0.01,
        packets: int = PACKETS,
    ) -> None:
        self.packets = packets
        self.gap_s = gap_s
        medium = Medium(MediumSetup(seed, 2, 4, 80.0, conditions_of(model)))
        medium.place(((0.0, 0.0, 0.0), (distance_m, 0.0, 0.0)))
        noted = entries(_noted(medium, channel, gap_s, packets))
        self.first = noted[noted["copy"] == 0]
        self.copies = noted[noted["copy"] == 1]

    @property
    def delivered(self) -> NDArray[np.void]:
        """The packets that got across, without their duplicates."""
        came: NDArray[np.void] = self.first[self.first["cause"] == DELIVERED]
        return came

    @property
    def delay_s(self) -> NDArray[np.float64]:
        """The delays of the packets that got across, in the order in which they were sent [s]."""
        return np.asarray(self.delivered["delay_s"])

    def share(self, cause: Cause) -> float:
        """Return the share of packets that met a fate."""
        return float(np.count_nonzero(self.first["cause"] == int(cause))) / self.packets

    @property
    def bursts(self) -> NDArray[np.int64]:
        """How many packets were lost in each run of losses."""
        lost = np.zeros(self.packets + 2, dtype=np.int8)
        gone = self.first["cause"] == int(Cause.DROPPED_LOSS)
        lost[np.asarray(self.first["count"])[gone] + 1] = 1
        turns = np.flatnonzero(np.diff(lost))
        return turns[1::2] - turns[::2]


def _noted(medium: Medium, channel: Channel, gap_s: float, packets: int) -> bytes:
    """Send packets from agent 0; return what is noted of agent 1."""
    one = Transmission(0, 0, (Outgoing(channel, bytes(SIZE_B)),))
    pages = []
    for start in range(0, packets, AT_ONCE):
        for count in range(start, min(start + AT_ONCE, packets)):
            medium.transmit(0, count * gap_s, one)
        medium.discard(1)
        pages.append(medium.pages().get(1, b""))
    return b"".join(pages)
