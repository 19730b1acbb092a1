"""Radio faults: every change to the radio that an event can make.

These are the only types of them. A scenario's event decodes into one, the medium and the judge
apply it (``netem.conditions``), and events.jsonl reports it. A new kind is a type here, a key of
:class:`RadioEvent`, and its effect in ``NetworkConditions``.
"""

from typing import Annotated, Generic, Literal, TypeVar, assert_never

import msgspec
from msgspec import Meta

from netem.link_parameters import LEAST, Conditions, Table
from netem.wire.frame import AgentId, Count

Metres = Annotated[float, Meta(ge=-1e6, le=1e6)]
Position = tuple[Metres, Metres, Metres]
"""A point [m; world frame]."""

FlapPeriod = Annotated[float, Meta(ge=0.05, le=86_400)]
"""[s]; a shorter period could fall between two slots."""
Group = Annotated[tuple[AgentId, ...], Meta(min_length=1, max_length=1000)]
Groups = Annotated[tuple[Group, ...], Meta(min_length=1, max_length=1000)]
PartitionKind = Literal["clean", "one_way", "bridge", "ring"]
OutageCause = Literal["kill", "pause"]


class Partition(Table, frozen=True):
    """Groups of agents between which links are cut; unnamed agents form one more group.

    clean: all links between groups are cut. one_way: only links out of a named group are cut.
    bridge: clean, but links from and to the agents of ``bridge`` stay. ring: clean, and within a
    named group only the links between neighbours in the list stay; its ends are neighbours.
    """

    groups: Groups
    kind: PartitionKind = "clean"
    bridge: Annotated[tuple[AgentId, ...], Meta(max_length=1000)] = ()
    """Agents of no group, with kind "bridge" only."""


class Jam(Table, frozen=True):
    """A sphere in which no radio sends or receives."""

    centre_m: Position
    """[m; world frame]"""
    radius_m: Annotated[float, Meta(ge=LEAST, le=1e6)]


class Flap(Table, frozen=True):
    """Links that are down for the first half of each period, counted from the fault's start."""

    period_s: FlapPeriod
    links: Annotated[tuple[tuple[AgentId, AgentId], ...], Meta(max_length=10_000)] = ()
    """Directed, as [from, to]; empty: all links."""


SabotageKind = Literal["replay", "spoof", "garbage", "flood"]
"""replay: the victim's frames again; spoof: frames in other agents' names; garbage: frames that are
no messages; flood: the victim's newest frames, many times."""
Victims = Annotated[tuple[AgentId, ...], Meta(max_length=1000)]
Who = TypeVar("Who")


class SabotageKeys(Table, Generic[Who], frozen=True):
    """Frames that a saboteur sends by the radios of agents, its victims, beside their own."""

    kind: SabotageKind
    agents: Who
    """The victims."""
    per_s: Annotated[float, Meta(ge=0.1, le=2000)] = 200.0
    """Frames that it sends by each of their radios [1/s]; a replay sends each frame once more."""
    delay_s: Annotated[float, Meta(ge=LEAST, le=60)] = 2.0
    """How much later a replay sends a frame again [s]."""


class Sabotage(SabotageKeys[Victims], frozen=True):
    """Sabotage of the radios of given agents."""


class Outage(msgspec.Struct, frozen=True):
    """The radio's own processes are down; they are the router too, so no message passes.

    kill: frames in flight are lost, and what the medium remembers of its links. pause: frames in
    flight are delayed.
    """

    cause: OutageCause


class Heal(msgspec.Struct, frozen=True):
    """The end of every partition in force."""


KeyedFault = Conditions | Partition | Jam | Flap | Sabotage
"""A fault that has a key of its own in an event. Conditions are the link keys that change."""
LastingFault = KeyedFault | Outage
"""A fault that stays in force until it ends."""
RadioFault = LastingFault | Heal
"""The effect of one event on the radio."""


SabotageTable = TypeVar("SabotageTable")


class RadioKeys(
    msgspec.Struct,
    Generic[SabotageTable],
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    omit_defaults=True,
):
    """The keys of radio faults. A scenario's event selects victims that are not known yet."""

    partition: Groups | Partition | None = None
    """Groups alone are a clean partition."""
    heal: bool | None = None
    """Ends every partition."""
    jam: Jam | None = None
    flap: Flap | None = None
    netem: Conditions | None = None
    """The keys of [netem] that change."""
    sabotage: SabotageTable | None = None

    @property
    def radio_fault(self) -> KeyedFault | Heal | None:
        """The fault whose key is set; None where there is none, or one of unknown victims."""
        if self.partition is not None and not isinstance(self.partition, Partition):
            return Partition(groups=self.partition)
        if self.heal:
            return Heal()
        return self.partition or self.jam or self.flap or self.netem


class RadioEvent(RadioKeys[Sabotage], frozen=True, kw_only=True):
    """One radio fault under its key; exactly one key is set."""

    @staticmethod
    def of(fault: KeyedFault | Heal) -> "RadioEvent":
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
            case Sabotage():
                return RadioEvent(sabotage=fault)
        assert_never(fault)

    @property
    def radio_kind(self) -> str:
        """The key that is set; empty where there is none."""
        keys = RadioEvent.__struct_fields__
        return next((key for key in keys if getattr(self, key) is not None), "")

    @property
    def radio_fault(self) -> KeyedFault | Heal | None:
        """The fault whose key is set; None where there is none."""
        return self.sabotage or super().radio_fault

    @property
    def victims(self) -> tuple[int, ...]:
        """The agents that the fault strikes, whatever frames it strikes."""
        return self.sabotage.agents if self.sabotage is not None else ()


class FaultOrder(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Begins a radio fault, or ends the fault of a number."""

    number: Count
    """Identifies the fault among those in force."""
    at_s: Annotated[float, Meta(ge=0, le=1e9)]
    """When the fault begins or ends [s; simulated time]."""
    event: RadioEvent | None = None
    """The fault that begins."""
    outage: OutageCause | None = None
    """The outage that begins; without an event and an outage, the fault of that number ends."""

    @staticmethod
    def begin(number: int, at_s: float, fault: RadioFault) -> "FaultOrder":
        """Return the order that begins a fault."""
        if isinstance(fault, Outage):
            return FaultOrder(number, at_s, outage=fault.cause)
        return FaultOrder(number, at_s, RadioEvent.of(fault))

    @property
    def fault(self) -> RadioFault | None:
        """The fault that begins; None where one ends."""
        if self.outage is not None:
            return Outage(self.outage)
        return self.event.radio_fault if self.event is not None else None
