"""What people read of a search: the table over all seeds, and the page of a finding."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from worldsim.fuzz.folder import PAGE, SCENARIO, Row
from worldsim.search.margins import CONSERVATION, LIVENESS, PROPERTIES, SAFETY, WORDS

BLOCKS = "▁▂▃▄▅▆▇█"
CURVE = 60
"""Characters of a curve."""
SEEN_AT_REST_S = 5.0
"""A rest that begins later before the end of a flight says little [s]."""


def table(rows: Iterable[Row]) -> str:
    """Return the table over all seeds: each property, its violations and its least margin."""
    flown = list(rows)
    lines = [
        "| property | kind | judged | violated | least margin | of seed | seeds that violate it |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in PROPERTIES:
        judged = [row for row in flown if name in row["margins"]]
        if judged:
            lines.append(_table_row(name, judged))
    guided = [row for row in flown if row["how"] == "guided"]
    random = [row for row in flown if row["how"] == "random"]
    lines += ["", *(_half(name, half) for name, half in (("random", random), ("guided", guided)))]
    return "\n".join(lines)


def _table_row(name: str, judged: list[Row]) -> str:
    bad = sorted(row["seed"] for row in judged if name in row["violated"])
    least = min(judged, key=lambda row: (row["margins"][name], row["seed"]))
    shown = ", ".join(map(str, bad[:10])) + (" ..." if len(bad) > 10 else "") or "-"
    margin = f"{least['margins'][name]:.3f}"
    return (
        f"| {name} | {kind_of(name)} | {len(judged)} | {len(bad)} | {margin} | {least['seed']}"
        f" | {shown} |"
    )


def _half(name: str, rows: list[Row]) -> str:
    violated = sorted(row["seed"] for row in rows if row["violated"])
    first = "none violates anything"
    if violated:
        before = sum(row["seed"] <= violated[0] for row in rows)
        first = f"{len(violated)} violate something, the first of them is number {before}"
    return f"{name} seeds: {len(rows)} flown, {first}"


def kind_of(name: str) -> str:
    """Return the kind of a property."""
    kinds = (("safety", SAFETY), ("conservation", CONSERVATION), ("liveness", LIVENESS))
    return next(kind for kind, names in kinds if name in names)


def page(finding: Row) -> str:
    """Return the page of a finding."""
    name, found = finding["property"], finding["size"]
    lines = [
        f"# {finding['name']}: {kind_of(name)} violated ({name})",
        "",
        f"{WORDS[name].capitalize()}. {finding['reason'] or ''}".strip(),
        "",
        f"Replay it in this folder: `qswarm sim {SCENARIO} --out replay`, `qswarm view replay`.",
        "When did it become certain? `qswarm cause .`",
        "",
        "| | faults | agents | duration |",
        "|---|---|---|---|",
        _size_row("as drawn", finding["original_size"]),
        _size_row(f"after {finding['shrink_flights']} flights", found),
        "",
        f"First tick of trouble: {_seconds(finding['trouble_s'])}.",
        f"Last event before it: {_event_text(finding['last_event'])}.",
        *_rest(finding),
        *_as_drawn(finding),
        "",
        *_curves(finding.get("margins") or {}),
        *_events(finding.get("events") or []),
    ]
    if "cause" in finding:
        lines += ["## Cause", "", finding["cause"]["text"], ""]
    return "\n".join(lines).rstrip() + "\n"


def _seconds(time_s: float | None) -> str:
    return "not known" if time_s is None else f"{time_s:g} s"


def _rest(finding: Row) -> list[str]:
    """Return from when on no vehicle moves: then more time would not help a team."""
    since_s, end_s = finding.get("rest_since_s"), finding["size"]["duration_s"]
    if since_s is None or end_s - since_s < SEEN_AT_REST_S:
        return []
    return [f"All vehicles stand still from {since_s:g} s on."]


def _as_drawn(finding: Row) -> list[str]:
    """Return that a finding is as large as it was drawn, where shrinking could not begin."""
    if not finding.get("shrunk") or finding["shrink_flights"]:
        return []
    return ["It was not made smaller: flown again, it does not show, or not each time."]


def _size_row(name: str, size: Mapping[str, Any]) -> str:
    return f"| {name} | {size['faults']} | {size['agents']} | {size['duration_s']:g} s |"


def _curves(margins: Mapping[str, Sequence[float | None]]) -> list[str]:
    """Return each margin over the time of the flight, as a row of blocks."""
    times = margins.get("t_s") or []
    if not times:
        return []
    lines = ["## Margins over time", "", "```text"]
    for name in ("separation", "clearance", "slot_error_m"):
        values = margins.get(name) or []
        known = [each for each in values if each is not None]
        if known:
            unit = " m" if name.endswith("_m") else ""
            spread = f"{min(known):.3g} to {max(known):.3g}{unit}"
            lines.append(f"{name:<13}{curve(values)} {spread}")
    return [*lines, f"{'':<13}0 s{times[-1]:>{CURVE - 5}.0f} s", "```", ""]


def curve(values: Sequence[float | None]) -> str:
    """Return values over time as blocks: each the least of its part; a space without any."""
    known = [each for each in values if each is not None]
    low, high = min(known), max(known)
    width = min(CURVE, len(values))
    text = ""
    for column in range(width):
        part = values[column * len(values) // width : (column + 1) * len(values) // width]
        seen = [each for each in part if each is not None]
        share = (min(seen) - low) / (high - low) if seen and high > low else 0.0
        text += BLOCKS[min(7, int(8 * share))] if seen else " "
    return text


def _events(events: list[Row]) -> list[str]:
    if not events:
        return []
    lines = [f"## The last {len(events)} events before the trouble", "", "```text"]
    return [*lines, *map(_event_text, events), "```", ""]


def _event_text(event: Mapping[str, Any] | None) -> str:
    if event is None:
        return "none"
    rest = {k: v for k, v in event.items() if k not in ("t_s", "kind") and v is not None}
    told = ", ".join(f"{key} {value}" for key, value in rest.items())
    return f"{event['t_s']:g} s: {event['kind']}" + (f" ({told})" if told else "")


def closing(findings: list[Row], states: Mapping[str, str]) -> list[str]:
    """Return a line for each finding. states: new, known or fixed, by name."""
    lines = []
    for each in findings:
        size, state = each["size"], states.get(each["name"], "new")
        after = "" if each["trouble_s"] is None else f" after {each['trouble_s']:g} s"
        lines.append(
            f"{state}: {each['name']}: {each['property']}{after};"
            f" {size['faults']} faults, {size['agents']} agents, {size['duration_s']:g} s"
        )
    counted = Counter(states.values())
    if counted:
        lines.append(", ".join(f"{count} {state}" for state, count in sorted(counted.items())))
    return lines


__all__ = ["PAGE", "closing", "curve", "kind_of", "page", "table"]
