"""Datagrams: what controllers say to each other in their own words, on either channel."""

from math import inf
from operator import attrgetter
from typing import Final

from agent.codec import add_checksum, decode_datagram, encode
from agent.comms.neighbours import MAX_AGE_S
from agent.controller import Outgoing, Received
from agent.messages import Datagram
from agent.rejection import RejectedError
from netem.wire.channels import CHANNELS, LOCAL, MULTIHOP, Channel

HEARD_S: Final = 2.0
"""Who sent a datagram within this time is heard [s]."""
MAX_INBOX: Final = 16
"""Most datagrams of one sender in one step; more of them are rejected as "overflow"."""


class Datagrams:
    """One agent's inbox, and how its datagrams are sent.

    slack_s: how far a stamp may lie ahead of the own observation [s]. round_period_s: of the
    multihop channel [s]; infinite where it is off.
    """

    def __init__(self, slack_s: float, round_period_s: float) -> None:
        self._slack_s = slack_s
        self._multihop = round_period_s < inf
        self._heard: dict[int, list[tuple[Channel, Datagram]]] = {}
        self._last_s: dict[int, float] = {}
        """When each agent was heard last [s]."""

    def receive(self, source: int, channel: Channel, payload: bytes, now_s: float) -> None:
        """Take a frame that holds a datagram. Raises RejectedError."""
        datagram = decode_datagram(payload)
        age_s = now_s - datagram.stamp_s
        if age_s < -self._slack_s:
            raise RejectedError("future", f"the stamp is {-age_s:.3f} s ahead")
        if age_s > MAX_AGE_S:
            raise RejectedError("old", f"the stamp is {age_s:.3f} s old")
        heard = self._heard.setdefault(source, [])
        if len(heard) >= MAX_INBOX:
            raise RejectedError("overflow", f"agent {source} says more than is taken in one step")
        heard.append((channel, datagram))
        self._last_s[source] = now_s

    def senders(self, now_s: float) -> tuple[int, ...]:
        """Return the ids of those heard of late, sorted."""
        for source in [each for each, at_s in self._last_s.items() if now_s - at_s > HEARD_S]:
            del self._last_s[source]
        return tuple(sorted(self._last_s))

    def take(self, now_s: float) -> tuple[Received, ...]:
        """Return what has come since the last call, sorted by source, channel and stamp."""
        if not self._heard:
            return ()
        inbox: list[Received] = []
        for source in sorted(self._heard):
            for channel in (LOCAL, MULTIHOP):
                said = [datagram for on, datagram in self._heard[source] if on == channel]
                said.sort(key=attrgetter("stamp_s"))
                for each in said:
                    age_s = max(0.0, now_s - each.stamp_s)
                    inbox.append(Received(source, CHANNELS[channel], age_s, each.data))
        self._heard = {}
        return tuple(inbox)

    def frames(
        self, now_s: float, messages: tuple[Outgoing, ...]
    ) -> tuple[tuple[Channel, bytes], ...]:
        """Return the frames of a controller's messages; none for a channel that is off."""
        frames: list[tuple[Channel, bytes]] = []
        for name, data in messages:
            channel: Channel = LOCAL if name == CHANNELS[LOCAL] else MULTIHOP
            if channel == LOCAL or self._multihop:
                frames.append((channel, add_checksum(encode(Datagram(now_s, data)))))
        return tuple(frames)
