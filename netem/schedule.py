"""Conditions over time: which model a directed link has on a channel.

A link's own table wins over its channel's, and that over the one for both channels. What is said
here holds from now on: it is asked once for each frame, when the frame is sent.
"""

from itertools import chain
from typing import Any, TypeVar

import msgspec

from netem.link import LinkModel
from netem.link_keys import Conditions, DirectedLink, LinkKeys
from netem.wire.frame import CHANNELS

_Keys = TypeVar("_Keys", bound=LinkKeys)
RATE_KEYS = ("rate_kbit", "rate_overhead_b", "limit")
"""Keys that belong to a sender's channel; a link with one of its own has its own queue."""


class Schedule:
    """Answers which model holds on (channel, source, destination)."""

    def __init__(self, conditions: Conditions) -> None:
        self.change(conditions)

    def change(self, conditions: Conditions) -> None:
        """Let other conditions hold from now on, for every link."""
        self._channels = tuple(
            _merged(conditions, getattr(conditions, channel)) for channel in CHANNELS
        )
        self._links: dict[tuple[int, int, int], LinkModel] = {}
        self._reach_m: dict[tuple[int, int], float] = {}
        for link in conditions.link:
            for channel, name in enumerate(CHANNELS):
                own = _merged(conditions, getattr(conditions, name), link)
                self._links[channel, link.source, link.to] = own
                before_m = self.reach_m(channel, link.source)
                self._reach_m[channel, link.source] = max(before_m, own.reach_m)

    def sender(self, channel: int) -> LinkModel:
        """Return the model that holds on a channel where no link has its own."""
        return self._channels[channel]

    def alike(self, channel: int, source: int) -> LinkModel | None:
        """Return the one model of all links from a source, or None where one has its own."""
        return self._channels[channel] if (channel, source) not in self._reach_m else None

    def model(self, channel: int, source: int, destination: int) -> LinkModel:
        """Return the model of one directed link on one channel."""
        return self._links.get((channel, source, destination), self._channels[channel])

    def reach_m(self, channel: int, source: int) -> float:
        """Return the distance [m] beyond which nobody hears a source on a channel."""
        return self._reach_m.get((channel, source), self._channels[channel].reach_m)


def overlaid(conditions: Conditions, change: Conditions) -> Conditions:
    """Return conditions with a change over them, table by table and key by key."""
    links = {(link.source, link.to): link for link in conditions.link}
    for link in change.link:
        ends = (link.source, link.to)
        links[ends] = _over(links[ends], link) if ends in links else link
    channels = {name: _over(getattr(conditions, name), getattr(change, name)) for name in CHANNELS}
    return msgspec.structs.replace(
        _over(conditions, change), **channels, link=tuple(links.values())
    )


def _over(table: _Keys, change: LinkKeys) -> _Keys:
    """Return a table with the link keys that a change gives."""
    return msgspec.structs.replace(table, **_given(change))


def _given(table: LinkKeys) -> dict[str, Any]:
    values = ((key, getattr(table, key)) for key in LinkKeys.__struct_fields__)
    return {key: value for key, value in values if value is not None}


def _merged(*tables: LinkKeys | Conditions | DirectedLink) -> LinkModel:
    own_rate = (
        any(getattr(tables[2], key) is not None for key in RATE_KEYS) if tables[2:] else False
    )
    given = dict(chain.from_iterable(_given(table).items() for table in tables))
    return LinkModel(**given, own_rate=own_rate)
