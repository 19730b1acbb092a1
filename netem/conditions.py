"""The link conditions and radio faults in force.

:class:`NetworkConditions` is their only holder: the medium uses it for each frame, the judge for
connectivity, the link check for the models of a scenario, the operator's control for its report.
Faults that are in force together compose: changes of conditions apply in the order in which they
began, and a link is cut where any fault cuts it. Faults end by their number, in any order.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Final, NamedTuple, TypeVar, assert_never

import msgspec

from netem.faults import (
    FaultOrder,
    Flap,
    Heal,
    Jam,
    LastingFault,
    Outage,
    OutageCause,
    Partition,
    Position,
    Sabotage,
)
from netem.link_model import LinkModel
from netem.link_parameters import RATE_KEYS, Conditions, LinkKeys
from netem.range_index import InRange
from netem.wire.channels import CHANNELS

_Keys = TypeVar("_Keys", bound=LinkKeys)
NO_KEYS = LinkKeys()
UNNAMED: Final = -1
"""The group of all agents that a partition does not name."""


class LinkModels:
    """The model of each directed link on each channel under given conditions.

    The link's own table overrides its channel's table, which overrides the table of both channels.
    """

    def __init__(self, conditions: Conditions) -> None:
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

    def of_channel(self, channel: int) -> LinkModel:
        """Return the model of a channel's links that have no table of their own."""
        return self._channels[channel]

    def common(self, channel: int, source: int) -> LinkModel | None:
        """Return the model that all links from a source share; None where a link has its own."""
        if self._reach_m and (channel, source) in self._reach_m:
            return None
        return self._channels[channel]

    def of_link(self, channel: int, source: int, destination: int) -> LinkModel:
        """Return the model of one directed link on one channel."""
        return self._links.get((channel, source, destination), self._channels[channel])

    def of_any_link(self, channel: int) -> list[LinkModel]:
        """Return the models of all links of a channel, each once or more."""
        own = [model for (at, _, _), model in self._links.items() if at == channel]
        return [self._channels[channel], *own]

    def alike(self, channel: int) -> bool:
        """Return whether no link of a channel has a model of its own."""
        return all(at != channel for at, _, _ in self._links)

    def same(self, other: "LinkModels") -> bool:
        """Return whether every link has the same model as in another set of models."""
        own = self._links.keys() | other._links.keys()
        alike = all(self.of_link(*link) == other.of_link(*link) for link in own)
        return alike and self._channels == other._channels

    def reach_m(self, channel: int, source: int) -> float:
        """Return the distance [m] beyond which no agent receives a source on a channel."""
        reach_m = self._channels[channel].reach_m
        return self._reach_m.get((channel, source), reach_m) if self._reach_m else reach_m


def differing(a: LinkModels, b: LinkModels, channel: int, source: int, near: InRange) -> int:
    """Return how many of a source's links to receivers near it differ between two sets of models.

    A link that is within its range by both, or out of it by both, does not differ by the range.
    """
    links = 0
    for receiver, distance_m in near:
        one, other = a.of_link(channel, source, receiver), b.of_link(channel, source, receiver)
        if one is not other and distance_m <= max(one.reach_m, other.reach_m):
            links += distance_m > min(one.reach_m, other.reach_m) or _differ_within(one, other)
    return links


@lru_cache(maxsize=256)
def _differ_within(one: LinkModel, other: LinkModel) -> bool:
    """Whether two links differ where both are in range."""
    return msgspec.structs.replace(one, range_m=other.range_m) != other


class PartitionCut:
    """The directed links that one partition cuts."""

    def __init__(self, partition: Partition) -> None:
        groups = partition.groups
        self._group_of = {agent: at for at, group in enumerate(groups) for agent in group}
        self._rank = {agent: rank for group in groups for rank, agent in enumerate(group)}
        self._sizes = [len(group) for group in groups]
        self._kind = partition.kind
        self._bridge = frozenset(partition.bridge)

    def cuts(self, source: int, destination: int) -> bool:
        """Return whether the link from source to destination is cut."""
        group = self._group_of.get(source, UNNAMED)
        if group == self._group_of.get(destination, UNNAMED):
            return self._cuts_within(source, destination, group)
        return self._cuts_between(source, destination, group)

    def _cuts_within(self, source: int, destination: int, group: int) -> bool:
        if self._kind != "ring" or group == UNNAMED:
            return False
        distance = (self._rank[source] - self._rank[destination]) % self._sizes[group]
        return distance not in (1, self._sizes[group] - 1)

    def _cuts_between(self, source: int, destination: int, group: int) -> bool:
        match self._kind:
            case "one_way":
                return group != UNNAMED
            case "bridge":
                return source not in self._bridge and destination not in self._bridge
            case "clean" | "ring":
                return True
        assert_never(self._kind)


class InForce(NamedTuple):
    """A fault in force."""

    since_s: float
    """When it began [s; simulated time]."""
    fault: LastingFault


class NetworkConditions:
    """The conditions in force, from a run's base conditions and the faults begun and not ended."""

    def __init__(self, base: Conditions) -> None:
        self._base = base
        self._in_force: dict[int, InForce] = {}
        # What is in force of each kind, by the fault's number.
        self._partitions: dict[int, PartitionCut] = {}
        self._jams: dict[int, Jam] = {}
        self._flaps: dict[int, tuple[float, Flap]] = {}
        """With the start of each [s; simulated time]."""
        self._outages: dict[int, OutageCause] = {}
        self.conditions = base
        """The base conditions with all changes in force."""
        self.models = LinkModels(base)
        """The link models under these conditions."""
        self.obstructed = False
        """Whether any partition, jam or flap is in force."""
        self.without: dict[int, LinkModels] = {}
        """The link models if a change of conditions were not in force, by its number.

        Of each change that alters some link; one that only repeats what others set has none.
        """

    @property
    def in_force(self) -> Mapping[int, InForce]:
        """The faults in force by number, in the order in which they began."""
        return self._in_force

    @property
    def partitioned(self) -> bool:
        """Whether a partition is in force."""
        return bool(self._partitions)

    @property
    def flapping(self) -> bool:
        """Whether a flap is in force."""
        return bool(self._flaps)

    @property
    def outages(self) -> Mapping[int, OutageCause]:
        """The causes of the outages in force, by number: while there are any, no message passes."""
        return self._outages

    def orders(self) -> tuple[FaultOrder, ...]:
        """Return the orders that bring the faults in force into force again, without outages."""
        return tuple(
            [
                FaultOrder.begin(number, since_s, fault)
                for number, (since_s, fault) in self._in_force.items()
                if number not in self._outages
            ]
        )

    def apply(self, order: FaultOrder) -> None:
        """Begin or end a fault. The end of a fault that is not in force changes nothing."""
        fault = order.fault
        match fault:
            case None:
                self._in_force.pop(order.number, None)
            case Heal():
                self._end_partitions()
            case _:
                self._in_force[order.number] = InForce(order.at_s, fault)
        self._refresh()

    def ends(self, order: FaultOrder) -> bool:
        """Return whether an order ends a fault that is in force."""
        if isinstance(order.fault, Heal):
            return self.partitioned
        return order.fault is None and order.number in self._in_force

    def partitions(self, source: int, destination: int) -> bool:
        """Return whether a partition cuts a directed link."""
        return any(partition.cuts(source, destination) for partition in self._partitions.values())

    def cutters(
        self,
        source: int,
        destination: int,
        now_s: float,
        radios: Sequence[Position | None] = (),
    ) -> list[int]:
        """Return the numbers of the faults that cut a directed link at a time [s].

        radios: the positions of its two radios [m; world frame].
        """
        found = [
            n for n, partition in self._partitions.items() if partition.cuts(source, destination)
        ]
        for number, (since_s, flap) in self._flaps.items():
            on_link = not flap.links or (source, destination) in flap.links
            if on_link and _is_down(flap, since_s, now_s):
                found.append(number)
        for number, jam in self._jams.items():
            if any(each is not None and _is_within(jam, each) for each in radios):
                found.append(number)
        return found

    def jammed(self, position: Position) -> bool:
        """Return whether a radio at a position [m; world frame] is in a jam's sphere."""
        return any(_is_within(jam, position) for jam in self._jams.values())

    def _end_partitions(self) -> None:
        self._in_force = {
            number: each
            for number, each in self._in_force.items()
            if not isinstance(each.fault, Partition)
        }

    def _refresh(self) -> None:
        """Derive the effects of the faults in force."""
        self._partitions, self._jams, self._flaps, self._outages = {}, {}, {}, {}
        changes: dict[int, Conditions] = {}
        for number, (since_s, fault) in self._in_force.items():
            match fault:
                case Conditions():
                    changes[number] = fault
                case Partition():
                    self._partitions[number] = PartitionCut(fault)
                case Jam():
                    self._jams[number] = fault
                case Flap():
                    self._flaps[number] = since_s, fault
                case Sabotage():
                    pass  # it sends frames of its own, and changes no link
                case Outage(cause=cause):
                    self._outages[number] = cause
                case _:
                    assert_never(fault)
        conditions = self._changed(changes.values())
        if conditions != self.conditions:
            self.conditions, self.models = conditions, LinkModels(conditions)
        self.without = self._without_each(changes)
        self.obstructed = bool(self._partitions or self._jams or self._flaps)

    def _without_each(self, changes: Mapping[int, Conditions]) -> dict[int, LinkModels]:
        """Return the link models if a change were not in force, for each that alters some.

        Of changes that do the same the first alters the models, the later ones none.
        """
        acting = dict(changes)
        without: dict[int, LinkModels] = {}
        for number in reversed(list(changes)):
            models = LinkModels(self._changed(acting[n] for n in acting if n != number))
            if models.same(self.models):
                del acting[number]
            else:
                without[number] = models
        return without

    def _changed(self, changes: Iterable[Conditions]) -> Conditions:
        """Return the base conditions with some changes, in this order."""
        conditions = self._base
        for change in changes:
            conditions = overlaid(conditions, change)
        return conditions


def overlaid(conditions: Conditions, change: Conditions) -> Conditions:
    """Return conditions with the keys that a change sets, table by table."""
    links = {(link.source, link.to): link for link in conditions.link}
    for link in change.link:
        ends = (link.source, link.to)
        links[ends] = _over(links[ends], link) if ends in links else link
    channels = {name: _over(getattr(conditions, name), getattr(change, name)) for name in CHANNELS}
    return msgspec.structs.replace(
        _over(conditions, change), **channels, link=tuple(links.values())
    )


def _is_down(flap: Flap, since_s: float, now_s: float) -> bool:
    return (now_s - since_s) % flap.period_s < 0.5 * flap.period_s


def _is_within(jam: Jam, position: Position) -> bool:
    dx, dy, dz = (a - b for a, b in zip(position, jam.centre_m, strict=True))
    return dx * dx + dy * dy + dz * dz <= jam.radius_m * jam.radius_m


def _over(table: _Keys, change: LinkKeys) -> _Keys:
    """Return a table with the link keys that a change sets."""
    keys = {key: getattr(change, key) for key in LinkKeys.__struct_fields__}
    return msgspec.structs.replace(
        table, **{key: value for key, value in keys.items() if value is not None}
    )


def _merged(both: LinkKeys, channel: LinkKeys, link: LinkKeys = NO_KEYS) -> LinkModel:
    """Return the model of a link from its tables: later tables override earlier ones."""
    own_rate = any(getattr(link, key) is not None for key in RATE_KEYS)
    table = _over(_over(both, channel), link)
    keys = {key: getattr(table, key) for key in LinkKeys.__struct_fields__}
    return LinkModel(**keys, own_rate=own_rate)
