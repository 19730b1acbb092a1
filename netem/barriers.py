"""What lets no frame across, whatever the link is like: partitions, jams and flapping links.

A pure function of who, where and when. Whatever stops a frame here is counted as partition.
"""

from netem.messages import Flap, Groups, Jam, PartitionKind, Position

OTHERS = -1
"""The group of the agents that no group names."""


class Partition:
    """One partition: whom it parts, in one direction."""

    def __init__(self, groups: Groups, kind: PartitionKind, bridge: tuple[int, ...]) -> None:
        self._group_of = {agent: at for at, group in enumerate(groups) for agent in group}
        self._rank = {agent: rank for group in groups for rank, agent in enumerate(group)}
        self._sizes = [len(group) for group in groups]
        self._kind = kind
        self._bridge = frozenset(bridge)

    def parts(self, source: int, destination: int) -> bool:
        """Whether the destination does not hear the source."""
        mine = self._group_of.get(source, OTHERS)
        if mine != self._group_of.get(destination, OTHERS):
            return self._parts_groups(source, destination, mine)
        return self._kind == "ring" and mine != OTHERS and not self._beside(source, destination)

    def _parts_groups(self, source: int, destination: int, group: int) -> bool:
        if self._kind == "one_way":
            return group != OTHERS
        return not (self._bridge and (source in self._bridge or destination in self._bridge))

    def _beside(self, one: int, other: int) -> bool:
        around = self._sizes[self._group_of[one]]
        return (self._rank[one] - self._rank[other]) % around in (1, around - 1)


def down(flap: Flap, now_s: float) -> bool:
    """Whether the links of a flap are down at a time [s]."""
    return (now_s - flap.from_s) % flap.period_s < 0.5 * flap.period_s


def within(jam: Jam, where: Position) -> bool:
    """Whether a place [m] is within a jam's sphere."""
    dx, dy, dz = (a - b for a, b in zip(where, jam.centre_m, strict=True))
    return dx * dx + dy * dy + dz * dz <= jam.radius_m * jam.radius_m


class Barriers:
    """All that stands at present; ``raised``: whether anything does.

    Of partitions there is one, the last; jams and flaps have numbers, so that each can end.
    """

    def __init__(self) -> None:
        self.raised = False
        self._partition: Partition | None = None
        self._jams: dict[int, Jam] = {}
        self._flaps: dict[int, Flap] = {}

    @property
    def flapping(self) -> bool:
        """Whether any links go up and down."""
        return bool(self._flaps)

    def partition(
        self, groups: Groups, kind: PartitionKind = "clean", bridge: tuple[int, ...] = ()
    ) -> None:
        """Let a partition take the place of the one before."""
        self._partition = Partition(groups, kind, bridge)
        self.raised = True

    def heal(self) -> None:
        """End the partition."""
        self._partition = None
        self._look()

    def jam(self, number: int, jam: Jam | None) -> None:
        """Begin a jam, or with None end it."""
        self._jams.pop(number, None)
        if jam is not None:
            self._jams[number] = jam
        self._look()

    def flap(self, number: int, flap: Flap | None) -> None:
        """Let links flap, or with None let them be."""
        self._flaps.pop(number, None)
        if flap is not None:
            self._flaps[number] = flap
        self._look()

    def parts(self, source: int, destination: int) -> bool:
        """Whether a partition keeps a destination from hearing a source."""
        return self._partition is not None and self._partition.parts(source, destination)

    def cut(self, source: int, destination: int, now_s: float) -> bool:
        """Whether anything but a jam stands between two agents at a time [s]."""
        if self.parts(source, destination):
            return True
        return any(
            down(flap, now_s)
            for flap in self._flaps.values()
            if not flap.links or (source, destination) in flap.links
        )

    def jammed(self, where: Position) -> bool:
        """Whether a radio at a place [m] is within a jam."""
        return any(within(jam, where) for jam in self._jams.values())

    def _look(self) -> None:
        self.raised = self._partition is not None or bool(self._jams or self._flaps)
