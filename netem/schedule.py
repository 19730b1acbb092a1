"""Conditions over time: which model a directed link has on a channel.

A link's own table wins over its channel's, and that over the one for both channels.
"""

from netem.link import LinkModel
from netem.messages import Conditions, DirectedLink, LinkKeys
from netem.wire.frame import CHANNELS


class Schedule:
    """Answers which model holds on (channel, source, destination)."""

    def __init__(self, conditions: Conditions) -> None:
        self._channels = tuple(
            _merged(conditions, getattr(conditions, channel)) for channel in CHANNELS
        )
        self._links: dict[tuple[int, int, int], LinkModel] = {}
        for link in conditions.link:
            for channel, name in enumerate(CHANNELS):
                own = _merged(conditions, getattr(conditions, name), link)
                self._links[channel, link.source, link.to] = own

    def model(self, channel: int, source: int, destination: int) -> LinkModel:
        """Return the model of one directed link on one channel."""
        if not self._links:
            return self._channels[channel]
        return self._links.get((channel, source, destination), self._channels[channel])


def _merged(*tables: LinkKeys | Conditions | DirectedLink) -> LinkModel:
    values: dict[str, float] = {}
    for table in tables:
        for key in LinkKeys.__struct_fields__:
            value = getattr(table, key)
            if value is not None:
                values[key] = value
    return LinkModel(**values)
