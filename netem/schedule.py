"""Conditions over time: which model a directed link has on a channel, and whom a partition parts.

A link's own table wins over its channel's, and that over the one for both channels. What is said
here holds from now on: it is asked once for each frame, when the frame is sent.
"""

from itertools import chain
from typing import TypeVar

import msgspec

from netem.link import LinkModel
from netem.messages import Conditions, DirectedLink, Groups, LinkKeys
from netem.wire.frame import CHANNELS

_Keys = TypeVar("_Keys", bound=LinkKeys)


class Schedule:
    """Answers which model holds on (channel, source, destination), and which links are cut."""

    def __init__(self, conditions: Conditions) -> None:
        self._group_of: dict[int, int] = {}
        self.parted = False
        self.change(conditions)

    def change(self, conditions: Conditions) -> None:
        """Let other conditions hold from now on, for every link."""
        self._channels = tuple(
            _merged(conditions, getattr(conditions, channel)) for channel in CHANNELS
        )
        self._links: dict[tuple[int, int, int], LinkModel] = {}
        for link in conditions.link:
            for channel, name in enumerate(CHANNELS):
                own = _merged(conditions, getattr(conditions, name), link)
                self._links[channel, link.source, link.to] = own

    def partition(self, groups: Groups) -> None:
        """Cut every link between two groups; whoever is in none belongs to one group more.

        It takes the place of the partition before.
        """
        self._group_of = {agent: index for index, group in enumerate(groups) for agent in group}
        self.parted = True

    def heal(self) -> None:
        """Join the groups again."""
        self._group_of = {}
        self.parted = False

    def cut(self, source: int, destination: int) -> bool:
        """Whether a partition stands between two agents."""
        return self._group_of.get(source, -1) != self._group_of.get(destination, -1)

    def model(self, channel: int, source: int, destination: int) -> LinkModel:
        """Return the model of one directed link on one channel."""
        if not self._links:
            return self._channels[channel]
        return self._links.get((channel, source, destination), self._channels[channel])


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


def _given(table: LinkKeys) -> dict[str, float]:
    values = ((key, getattr(table, key)) for key in LinkKeys.__struct_fields__)
    return {key: value for key, value in values if value is not None}


def _merged(*tables: LinkKeys | Conditions | DirectedLink) -> LinkModel:
    return LinkModel(**dict(chain.from_iterable(_given(table).items() for table in tables)))
