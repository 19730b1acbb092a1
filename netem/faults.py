"""Radio faults: everything that can be done to the radio while it runs.

These are the only types for them. A scenario's event decodes into them, the medium and the judge
apply them (``netem.conditions``), and events.jsonl reports them. A new kind is a type here, a key
of :class:`RadioEvent`, and its effect in ``NetworkConditions``.
"""

from typing import Annotated, Literal, assert_never

import msgspec
from msgspec import Meta

from netem.link_keys import Conditions, Table
from netem.wire.frame import AgentId, Count

Metres = Annotated[float, Meta(ge=-1e6, le=1e6)]
Position = tuple[Metres, Metres, Metres]
"""A point [m; world frame]."""

FlapPeriod = Annotated[float, Meta(ge=0.05, le=86_400)]
"""[s]; a faster flap would fall between two slots."""
Group = Annotated[tuple[AgentId, ...], Meta(min_length=1, max_length=1000)]
Groups = Annotated[tuple[Group, ...], Meta(min_length=1, max_length=1000)]
PartitionKind = Literal["clean", "one_way", "bridge", "ring"]


class Partition(Table, frozen=True):
    """Groups of agents that do not hear each other; unnamed agents form one more group.

    clean: a group hears only itself. one_way: a group hears all, and only itself hears it.
    bridge: clean, but the agents of ``bridge`` (in no group) hear all and are heard by all. ring:
    in a group each agent hears its two neighbours in the list; the ends are neighbours too.
    """

    groups: Groups
    kind: PartitionKind = "clean"
    bridge: Annotated[tuple[AgentId, ...], Meta(max_length=1000)] = ()


class Jam(Table, frozen=True):
    """A sphere in which no radio sends or receives."""

    centre_m: Position
    """[m; world frame]"""
    radius_m: Annotated[float, Meta(gt=0, le=1e6)]


class Flap(Table, frozen=True):
    """Links that go down and up: down for the first half of each period, from the fault's start."""

    period_s: FlapPeriod
    links: Annotated[tuple[tuple[AgentId, AgentId], ...], Meta(max_length=10_000)] = ()
    """Directed, as [from, to]; empty: all links."""


class Heal(msgspec.Struct, frozen=True):
    """The end of every partition in force."""


LastingFault = Conditions | Partition | Jam | Flap
"""A fault that is in force until it ends. Conditions are the link keys that change."""
RadioFault = LastingFault | Heal
"""What one event does to the radio."""


class RadioEvent(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True
):
    """One radio fault under its key, as a scenario and an order name it; one key is set.

    partition: groups alone are a clean partition. heal ends every partition. netem: the keys of
    [netem] that change.
    """

    partition: Groups | Partition | None = None
    heal: bool | None = None
    jam: Jam | None = None
    flap: Flap | None = None
    netem: Conditions | None = None

    @staticmethod
    def of(fault: RadioFault) -> "RadioEvent":
        """Return a fault under its key."""
        match fault:
            case Partition():
                return RadioEvent(partition=fault)
            case Heal():
                return RadioEvent(heal=True)
            case Jam():
                return RadioEvent(jam=fault)
            case Flap():
                return RadioEvent(flap=fault)
            case Conditions():
                return RadioEvent(netem=fault)
        assert_never(fault)

    @property
    def radio_fault(self) -> RadioFault | None:
        """The fault that is given; None where no key of the radio is set."""
        if self.partition is not None and not isinstance(self.partition, Partition):
            return Partition(groups=self.partition)
        if self.heal:
            return Heal()
        return self.partition or self.jam or self.flap or self.netem


class FaultOrder(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Begin a radio fault, or end the one of that number."""

    number: Count
    """Identifies the fault among those in force."""
    at_s: Annotated[float, Meta(ge=0, le=1e9)]
    """When it begins or ends [s; simulated time]."""
    event: RadioEvent | None = None
    """The fault that begins; None: the fault of that number ends."""

    @property
    def fault(self) -> RadioFault | None:
        """The fault that begins; None for an end."""
        return self.event.radio_fault if self.event is not None else None
