"""What stands between radios at present, as the run's events tell it."""

from collections.abc import Iterable
from typing import Any

Event = dict[str, Any]
KEYS = {
    "partition": {"groups": "groups", "kind": "parted", "bridge": "bridge"},
    "jam": {"centre_m": "centre_m", "radius_m": "radius_m"},
    "flap": {"period_s": "period_s", "links": "links"},
}
"""For each kind the keys of its table, as an event has them."""


def in_force(events: Iterable[Event]) -> dict[str, list[dict[str, Any]]]:
    """Return what is in force of each kind, in order of its beginning: its keys, and since_s."""
    standing: dict[tuple[str, int], dict[str, Any]] = {}
    for event in events:
        kind = "partition" if event["kind"] == "heal" else event["kind"]
        if kind not in KEYS:
            continue
        key = (kind, event.get("number", 0))
        standing.pop(key, None)
        table = event if kind == "partition" else event[kind]
        if event["kind"] != "heal" and table is not None:
            keys = {name: table[told] for name, told in KEYS[kind].items()}
            standing[key] = {"since_s": event["t_s"], **keys}
    return {
        wanted: [table for (kind, _), table in standing.items() if kind == wanted]
        for wanted in KEYS
    }
