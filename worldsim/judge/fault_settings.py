"""What a fault of the radio sets, for the entry of the fault in summary.json."""

from collections.abc import Iterator, Sequence
from typing import Any

import msgspec

from netem.faults import FaultOrder
from netem.link_parameters import DEFAULTS, Conditions, LinkKeys
from netem.wire.channels import CHANNELS


def settings_of(order: FaultOrder, conditions: Conditions) -> dict[str, Any]:
    """Return the keys of the fault that an order begins, in values of JSON.

    Those of a change of the conditions each as {"from": before, "to": after}; None is no limit, or
    no such loss. conditions: in force before.
    """
    fault = order.fault
    keys: Any = dict(_changes(fault, conditions)) if isinstance(fault, Conditions) else fault
    plain: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(keys))
    return plain


def _changes(change: Conditions, conditions: Conditions) -> Iterator[tuple[str, Any]]:
    """Yield each key that a change of conditions sets, and its value in them and after it.

    A key of a channel or a link that had no value of its own has that of the table around it.
    """
    links = {(link.source, link.to): link for link in conditions.link}
    for table in ("", *CHANNELS):
        own, now = (getattr(each, table) if table else each for each in (conditions, change))
        yield from _table_changes(f"{table}." if table else "", now, (own, conditions))
    for link in change.link:
        ends = link.source, link.to
        around = (links[ends], conditions) if ends in links else (conditions,)
        yield from _table_changes(f"link.{ends[0]}-{ends[1]}.", link, around)


def _table_changes(
    prefix: str, change: LinkKeys, around: Sequence[LinkKeys]
) -> Iterator[tuple[str, Any]]:
    """Yield the changes of one table. around: the tables that hold, the innermost first."""
    for key in LinkKeys.__struct_fields__:
        to = getattr(change, key)
        if to is not None:
            values = [getattr(table, key) for table in around]
            before = next((each for each in values if each is not None), DEFAULTS.get(key))
            yield f"{prefix}{key}", {"from": before, "to": to}
