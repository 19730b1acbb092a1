"""Faults of the radio as the run's events report them, back to orders, and in words.

The world turns each order to the medium into an event; the judge turns the event into the order
again, and so knows what is in force from a recording as from a flight.
"""

from collections.abc import Sequence
from typing import assert_never

import msgspec

from netem.conditions import NetworkConditions
from netem.faults import FaultOrder, Flap, Heal, Jam, Partition, RadioEvent
from netem.link_keys import Conditions
from worldsim.judge.run_events import (
    By,
    ConditionsChanged,
    Flapped,
    FlapWindow,
    Healed,
    Jammed,
    Partitioned,
    RadioRunEvent,
)

_CHANGE_KEYS = Conditions.__struct_fields__


def applied(order: FaultOrder, network: NetworkConditions, t_s: float, by: By) -> RadioRunEvent:
    """Apply an order at a time [s] to what is in force; return the event that reports it.

    Raises LookupError for the end of a fault that is not in force.
    """
    begun = order.fault
    fault = begun if begun is not None else network.in_force[order.number].fault
    network.apply(order)
    number = order.number
    match fault:
        case Heal():
            return Healed(t_s=t_s, agent=None, planned=True, by=by)
        case Partition() if begun is None:
            return Healed(t_s=t_s, agent=None, planned=True, by=by, number=number)
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
            jam = fault if begun is not None else None
            return Jammed(t_s=t_s, agent=None, planned=True, by=by, number=number, jam=jam)
        case Flap(period_s=period_s, links=links):
            flap = FlapWindow(period_s, links, order.at_s) if begun is not None else None
            return Flapped(t_s=t_s, agent=None, planned=True, by=by, number=number, flap=flap)
        case Conditions():
            return _conditions_changed(order, fault, network.conditions, t_s, by)
    assert_never(fault)


def order_of(event: RadioRunEvent) -> FaultOrder:
    """Return the order that an event reports."""
    return FaultOrder(number=_number(event), at_s=_since_s(event), event=_begun(event))


def radio_sentence(event: RadioRunEvent) -> str:
    """Return what an event did to the radio, as a sentence."""
    match event:
        case Partitioned(groups=groups, parted=kind, bridge=bridge):
            across = f", bridged by {_list(bridge)}" if bridge else ""
            words = f"radio partitioned ({kind}): {' | '.join(map(_list, groups))}{across}"
        case Healed(number=number):
            words = "all partitions healed" if number is None else "partition healed"
        case Jammed(jam=Jam() as jam):
            words = f"radio jammed within {jam.radius_m:g} m of [{_list(jam.centre_m)}] m"
        case Jammed():
            words = "jam ended"
        case Flapped(flap=FlapWindow() as flap):
            links = ", ".join(f"{source} -> {to}" for source, to in flap.links) or "all links"
            words = f"links flap with a period of {flap.period_s:g} s: {links}"
        case Flapped():
            words = "flapping links restored"
        case ConditionsChanged(undone=Conditions() as undone):
            words = f"link conditions restored: end of {_settings(undone)}"
        case ConditionsChanged():
            words = f"link conditions changed: {_settings(event)}"
        case _:
            assert_never(event)
    return words


def _conditions_changed(
    order: FaultOrder, change: Conditions, conditions: Conditions, t_s: float, by: By
) -> ConditionsChanged:
    ended = order.fault is None
    keys = {} if ended else {key: getattr(change, key) for key in _CHANGE_KEYS}
    return ConditionsChanged(
        t_s=t_s,
        agent=None,
        planned=True,
        by=by,
        number=order.number,
        conditions=conditions,
        undone=change if ended else None,
        **keys,
    )


def _number(event: RadioRunEvent) -> int:
    if isinstance(event, Healed):
        return event.number or 0
    return event.number


def _since_s(event: RadioRunEvent) -> float:
    if isinstance(event, Flapped) and event.flap is not None:
        return event.flap.from_s
    return event.t_s


def _begun(event: RadioRunEvent) -> RadioEvent | None:
    match event:
        case Healed(number=number):
            return RadioEvent(heal=True) if number is None else None
        case Partitioned(groups=groups, parted=kind, bridge=bridge):
            return RadioEvent(partition=Partition(groups, kind, bridge))
        case Jammed(jam=jam):
            return RadioEvent(jam=jam) if jam is not None else None
        case Flapped(flap=flap):
            return RadioEvent(flap=Flap(flap.period_s, flap.links)) if flap is not None else None
        case ConditionsChanged():
            if event.undone is not None:
                return None
            return RadioEvent(netem=Conditions(**{k: getattr(event, k) for k in _CHANGE_KEYS}))
    assert_never(event)


def _settings(conditions: Conditions | ConditionsChanged) -> str:
    keys = {name: getattr(conditions, name) for name in Conditions.__struct_fields__}
    given = msgspec.to_builtins(Conditions(**keys))
    return ", ".join(f"{key} = {value}" for key, value in given.items())


def _list(values: Sequence[object]) -> str:
    return ", ".join(map(str, values))
