"""Radio faults as run events: from a fault order to its event, back, and in words.

The world reports each order to the medium as an event. The judge turns the event into the order
again, so it knows the faults in force from a recording as well as from a run.
"""

from collections.abc import Iterator, Sequence
from typing import Any, assert_never

import msgspec

from netem.conditions import NetworkConditions
from netem.faults import (
    FaultOrder,
    Flap,
    Group,
    Heal,
    Jam,
    LastingFault,
    Outage,
    OutageCause,
    Partition,
    PartitionKind,
    RadioFault,
    Sabotage,
)
from netem.link_parameters import Conditions
from worldsim.judge.event import By, PlannedEvent


class RadioFaultEvent(PlannedEvent, frozen=True, kw_only=True):
    """A radio fault began or ended."""

    number: int
    """The fault's number."""


class Partitioned(RadioFaultEvent, frozen=True, kw_only=True, tag="partition"):
    """A partition began."""

    groups: tuple[Group, ...]
    """The ids of each group."""
    parted: PartitionKind
    """The partition's kind."""
    bridge: tuple[int, ...]
    """Ids; for the kind "bridge"."""


class Healed(PlannedEvent, frozen=True, kw_only=True, tag="heal"):
    """One partition ended, or all."""

    number: int | None = None
    """The number of the partition that ended; None: all ended."""


class Jammed(RadioFaultEvent, frozen=True, kw_only=True, tag="jam"):
    """A jam began or ended."""

    jam: Jam | None
    """None: the jam ended."""


class FlapWindow(Flap, frozen=True):
    """A flap and its start."""

    from_s: float = 0.0
    """[s; simulated time]"""


class Flapped(RadioFaultEvent, frozen=True, kw_only=True, tag="flap"):
    """A flap began or ended."""

    flap: FlapWindow | None
    """None: the flap ended."""


class Sabotaged(RadioFaultEvent, frozen=True, kw_only=True, tag="sabotage"):
    """A saboteur began or ended to send frames by agents' radios."""

    sabotage: Sabotage | None
    """None: it ended."""


class ConditionsChanged(
    Conditions, frozen=True, kw_only=True, omit_defaults=True, tag_field="kind", tag="netem"
):
    """Link conditions changed: to its link keys, or back where a change was undone."""

    t_s: float
    """[s; simulated time]"""
    agent: int | None
    planned: bool
    by: By = None
    number: int
    """The change's number."""
    conditions: Conditions
    """All conditions in force from now on."""
    undone: Conditions | None = None
    """The change that ended."""

    @property
    def kind(self) -> str:
        """The event's key."""
        return "netem"


class NetemOutage(RadioFaultEvent, frozen=True, kw_only=True, tag="netem_outage"):
    """An outage of netem began or ended: its processes are down, and no message passes."""

    cause: OutageCause
    over: bool = False
    """Whether it ended."""


LinkRunEvent = Partitioned | Healed | Jammed | Flapped | ConditionsChanged
RadioRunEvent = LinkRunEvent | Sabotaged | NetemOutage
OUTAGE_WORDS = {
    ("kill", False): "netem is killed; no message passes",
    ("kill", True): "the kill of netem ends",
    ("pause", False): "netem is paused; no message passes",
    ("pause", True): "the pause of netem ends",
}
_CONDITION_KEYS = Conditions.__struct_fields__


def applied(order: FaultOrder, network: NetworkConditions, t_s: float, by: By) -> RadioRunEvent:
    """Apply an order to the conditions in force at a time [s]; return the event that reports it.

    Raises LookupError for the end of a fault that is not in force.
    """
    if order.fault is not None:
        network.apply(order)
        return _begin_event(order, order.fault, network, t_s, by)
    ended = network.in_force[order.number].fault
    network.apply(order)
    return _end_event(order.number, ended, network, t_s, by)


def order_of(event: RadioRunEvent) -> FaultOrder:
    """Return the order that an event reports."""
    fault, number, at_s = _begun(event), event.number or 0, _at_s(event)
    return FaultOrder(number, at_s) if fault is None else FaultOrder.begin(number, at_s, fault)


def radio_sentence(event: RadioRunEvent) -> str:
    """Return what an event did to the radio, as a sentence."""
    match event:
        case Partitioned(groups=groups, parted=kind, bridge=bridge):
            sides = " | ".join(map(_agents, groups))
            rest = " | all others" if len(groups) == 1 and not bridge else ""
            across = f", bridged by {_agents(bridge)}" if bridge else ""
            words = f"radio partitioned ({kind}): {sides}{rest}{across}"
        case Healed(number=number):
            words = "all partitions healed" if number is None else "partition healed"
        case Jammed(jam=Jam() as jam):
            words = f"radio jammed within {jam.radius_m:g} m of [{_list(jam.centre_m)}] m"
        case Jammed():
            words = "jam ended"
        case Flapped(flap=FlapWindow() as flap):
            links = ", ".join(f"a{source} -> a{to}" for source, to in flap.links) or "all links"
            words = f"links flap with a period of {flap.period_s:g} s: {links}"
        case Flapped():
            words = "flapping links restored"
        case ConditionsChanged():
            words = _changed(event)
        case Sabotaged() | NetemOutage():
            words = _by_others(event)
        case _:
            assert_never(event)
    return words


def settings_text(event: RadioRunEvent) -> str | None:
    """Return what conditions an event changes, or changes back; None for another event."""
    if not isinstance(event, ConditionsChanged):
        return None
    return f"end of {_settings(event.undone)}" if event.undone is not None else _settings(event)


def _changed(event: ConditionsChanged) -> str:
    what = "restored" if event.undone is not None else "changed"
    return f"link conditions {what}: {settings_text(event)}"


def _by_others(event: Sabotaged | NetemOutage) -> str:
    if isinstance(event, NetemOutage):
        return OUTAGE_WORDS[event.cause, event.over]
    return _sabotaged(event.sabotage)


def _sabotaged(sabotage: Sabotage | None) -> str:
    if sabotage is None:
        return "sabotage ended"
    agents = ", ".join(f"a{agent}" for agent in sabotage.agents)
    if not agents:
        return f"sabotage ({sabotage.kind}): no agent matches"
    rate = f"{sabotage.per_s:g} frames a second"
    how = f"each frame again after {sabotage.delay_s:g} s" if sabotage.kind == "replay" else rate
    return f"sabotage ({sabotage.kind}) by the radio of {agents}: {how}"


def _begin_event(
    order: FaultOrder, fault: RadioFault, network: NetworkConditions, t_s: float, by: By
) -> RadioRunEvent:
    number = order.number
    match fault:
        case Heal():
            return Healed(t_s=t_s, agent=None, planned=True, by=by)
        case Partition(groups=groups, kind=kind, bridge=bridge):
            return Partitioned(
                t_s=t_s,
                agent=None,
                planned=True,
                by=by,
                number=number,
                groups=groups,
                parted=kind,
                bridge=bridge,
            )
        case Jam():
            return Jammed(t_s=t_s, agent=None, planned=True, by=by, number=number, jam=fault)
        case Flap(period_s=period_s, links=links):
            flap = FlapWindow(period_s, links, order.at_s)
            return Flapped(t_s=t_s, agent=None, planned=True, by=by, number=number, flap=flap)
        case Conditions():
            return ConditionsChanged(
                t_s=t_s,
                agent=None,
                planned=True,
                by=by,
                number=number,
                conditions=network.conditions,
                **{key: getattr(fault, key) for key in _CONDITION_KEYS},
            )
        case Sabotage() | Outage():
            return _by_others_event(number, fault, t_s, by)
    assert_never(fault)


def _end_event(
    number: int, fault: LastingFault, network: NetworkConditions, t_s: float, by: By
) -> RadioRunEvent:
    match fault:
        case Partition():
            return Healed(t_s=t_s, agent=None, planned=True, by=by, number=number)
        case Jam():
            return Jammed(t_s=t_s, agent=None, planned=True, by=by, number=number, jam=None)
        case Flap():
            return Flapped(t_s=t_s, agent=None, planned=True, by=by, number=number, flap=None)
        case Conditions():
            return ConditionsChanged(
                t_s=t_s,
                agent=None,
                planned=True,
                by=by,
                number=number,
                conditions=network.conditions,
                undone=fault,
            )
        case Sabotage() | Outage():
            return _by_others_event(number, fault, t_s, by, ends=True)
    assert_never(fault)


def _by_others_event(
    number: int, fault: Sabotage | Outage, t_s: float, by: By, *, ends: bool = False
) -> Sabotaged | NetemOutage:
    about: dict[str, Any] = {"t_s": t_s, "agent": None, "planned": True, "by": by}
    about["number"] = number
    if isinstance(fault, Outage):
        return NetemOutage(**about, cause=fault.cause, over=ends)
    return Sabotaged(**about, sabotage=None if ends else fault)


def _at_s(event: RadioRunEvent) -> float:
    """Return the time of the order [s]; a flap reports its own, for its periods."""
    if isinstance(event, Flapped) and event.flap is not None:
        return event.flap.from_s
    return event.t_s


def _begun(event: RadioRunEvent) -> RadioFault | None:
    """Return the fault that began with an event; None where one ended."""
    match event:
        case Healed(number=number):
            return Heal() if number is None else None
        case Partitioned(groups=groups, parted=kind, bridge=bridge):
            return Partition(groups, kind, bridge)
        case Jammed(jam=jam):
            return jam
        case Flapped(flap=flap):
            return Flap(flap.period_s, flap.links) if flap is not None else None
        case ConditionsChanged(undone=undone):
            keys = {key: getattr(event, key) for key in _CONDITION_KEYS}
            return Conditions(**keys) if undone is None else None
        case Sabotaged() | NetemOutage():
            return _begun_by_others(event)
    assert_never(event)


def _begun_by_others(event: Sabotaged | NetemOutage) -> Sabotage | Outage | None:
    if isinstance(event, Sabotaged):
        return event.sabotage
    return None if event.over else Outage(event.cause)


def _settings(conditions: Conditions | ConditionsChanged) -> str:
    keys = {name: getattr(conditions, name) for name in Conditions.__struct_fields__}
    given = msgspec.to_builtins(Conditions(**keys))
    return ", ".join(f"{key} = {value}" for key, value in _dotted(given, ""))


def _dotted(table: dict[str, Any], prefix: str) -> Iterator[tuple[str, str]]:
    """Yield the values of a table and its inner tables, by dotted key."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _dotted(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", f"{value:g}" if isinstance(value, float) else str(value)


def _agents(ids: Sequence[int]) -> str:
    return ", ".join([f"a{each}" for each in ids])


def _list(values: Sequence[object]) -> str:
    return ", ".join(map(str, values))
