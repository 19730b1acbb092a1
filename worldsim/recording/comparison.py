"""A run's summary.json compared with the figures that its recording shows, and with itself.

A summary has every key of its format: one that is missing is named, as a figure that differs is.
Only a recording of an older version may have a summary without the keys that were added since.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

SCHEMA = 1
"""The version of the format of summary.json."""
ABSENT = "no such key"
"""Stands for a value that is not there."""
ADDED_LATER = (
    "sub_formations",
    "recoveries",
    "encounters",
    "faults",
    "in_formation_fraction",
    "max_slot_error_m",
    "margin",
    "min_lambda2",
    "I5",
    "timed_from_s",
    "asked_s",
    "overtaken_s",
    "in_place_from_s",
    "changed",
    "settings",
    "datagrams",
    "safety_filter",
    "coverage",
    "refused",
)
"""Keys that the summary of an older recording lacks."""
UNRECORDED = (
    *("reason", "rejected_by_cause", "refused", "direct_links", "needed_links", "bytes_per_s"),
    *("datagrams", "safety_filter"),
    *("delivery", "delivery_late_ms", "late_tick_fraction", "real_time_factor", "overload"),
    *("resources", "trace_sha256", "version", "commit", "commit_dirty", "python", "packages"),
    "host",
)
"""Keys of which a recording shows nothing, so that only their absence is named."""
COUNTED = {
    **dict.fromkeys(("partition", "jam", "flap", "netem", "sabotage"), "frames"),
    **dict.fromkeys(("sensor", "clock", "pose"), "readings"),
    **dict.fromkeys(("slow", "starve"), "steps"),
    "disk_full": "writes",
}
"""What a fault counts that it struck, by its kind; the count is not recorded."""
COUNTS = ("frames", "readings", "steps", "messages", "observations", "stopped_s", "writes")
REPEATABLE = ("lockstep", "virtual")
"""Modes that wait for a slow host: the radio's counters at the last tick are the summary's."""
FIXED = ("scenario", "seed", "mode", "agents")
"""Figures that do not depend on how much of the run was recorded."""
LEAST = ("min_separation_m", "min_obstacle_distance_m")
"""Figures that can only fall as a run goes on."""
LOST = "results were lost"
"""How the reason begins of a run that did not fail, of which results could not be written."""
WRITTEN_S = 2.0
"""So long before the end of a recording that is cut off, its events are all there [s]."""
TIME_SLACK_S = 1e-6
"""Event times are rounded to the microsecond."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A figure of which a file of the run, summary.json first of all, and recording differ."""

    key: str  # the path in summary.json, joined by dots
    summary: Any
    recording: Any
    file: str = "summary.json"


class Shown(NamedTuple):
    """What a recording shows of a run."""

    figures: dict[str, Any]
    """Under the keys of summary.json."""
    outcome: str
    """That of the recorded ticks: "pass", "fail", or "inconclusive" where they are too few."""
    exact: bool
    """Whether the recording is none of an older version."""
    until_s: float
    """Time of the last recorded tick [s]."""

    @property
    def repeatable(self) -> bool:
        """Whether the clock waits for the host, so that no host is too slow for it."""
        return self.figures["mode"] in REPEATABLE


def differences(summary: Any, shown: Shown) -> Iterator[Difference]:
    """Yield the figures that differ of a run that was recorded to its end.

    A figure that the summary lacks differs too.
    """
    yield from _form_differences(summary, shown)
    for key, figure in shown.figures.items():
        summarised, recorded = value_at(summary, key), figure
        if key == "packets" and isinstance(summarised, dict):
            summarised, recorded = _comparable_packets(summarised, recorded)
        if key == "faults":
            operated = shown.figures["mode"] != "virtual"
            summarised = _comparable(summarised, recorded, operated)
        yield from unequal(key, summarised, recorded, shown.exact)
    outcome = value_at(summary, "outcome")
    if not _may_be(outcome, summary, shown):
        yield Difference("outcome", outcome, shown.outcome)


def differences_in_part(summary: Any, shown: Shown, longest_s: float) -> Iterator[Difference]:
    """Yield the figures that differ whatever came after the recording's end.

    longest_s: the duration that the scenario asks for [s].
    """
    yield from _form_differences(summary, shown)
    for key in FIXED:
        yield from unequal(key, value_at(summary, key), shown.figures[key], shown.exact)
    duration_s = value_at(summary, "duration_s")
    if not _is_number(duration_s) or not shown.until_s <= duration_s + TIME_SLACK_S <= (
        longest_s + 2 * TIME_SLACK_S
    ):
        yield Difference("duration_s", duration_s, longest_s)
    for key in LEAST:
        summarised, least = value_at(summary, key), shown.figures[key]
        if least is not None and not (_is_number(summarised) and summarised <= least):
            yield Difference(key, summarised, least)
    yield from _faults_over(value_at(summary, "faults"), shown)


def contradictions(summary: Any, shown: Shown, idle_faults: bool) -> Iterator[str]:
    """Yield where a summary contradicts itself, in words; each begins with the key.

    idle_faults: whether the scenario allows faults that strike nothing.
    """
    if not isinstance(summary, dict):
        return
    packets, by_cause = value_at(summary, "packets"), value_at(summary, "rejected_by_cause")
    radio = isinstance(packets, dict) and packets.get("sent") is not None
    if isinstance(packets, dict) and radio and (shown.exact or "rejected" in packets):
        rejected, added = packets.get("rejected", ABSENT), _sum_of(by_cause)
        if added is not None and (rejected != added or isinstance(rejected, bool)):
            yield f"packets.rejected is {rejected}, the sum of rejected_by_cause {added}"
    for index, row in enumerate(_rows(summary)):
        key = COUNTED.get(str(row.get("kind"))) if row.get("process") is None else None
        if key is not None and (radio or key != "frames"):
            count = row.get(key, ABSENT)
            if not _is_number(count) or count < 0:
                yield f"faults.{index}.{key} is {count}, no count"
    idle = [f"faults.{index}" for index, row in enumerate(_rows(summary)) if is_idle(row)]
    if value_at(summary, "outcome") == "pass" and idle and not idle_faults:
        yield f"outcome is pass, but {', '.join(idle)} struck nothing"


def is_idle(row: dict[str, Any]) -> bool:
    """Return whether a fault of a summary struck nothing, by its counts."""
    counts = [row.get(key) for key in COUNTS]
    counted = (
        row.get("readings") is not None
        or row.get("steps") is not None
        or (row.get("kind") == "intruder")
    )
    agents = row.get("agents")
    if not counted and isinstance(agents, list):
        counts.append(len(agents))
    return any(_is_number(count) and count == 0 for count in counts)


def value_at(summary: Any, key: str) -> Any:
    """Return the value of a key; ABSENT where there is none."""
    return summary.get(key, ABSENT) if isinstance(summary, dict) else ABSENT


def _form_differences(summary: Any, shown: Shown) -> Iterator[Difference]:
    """Yield another version of the format, and the keys that it lacks and no recording shows."""
    if value_at(summary, "schema") != SCHEMA:
        yield Difference("schema", value_at(summary, "schema"), SCHEMA)
    for key in UNRECORDED if shown.exact else ():
        if value_at(summary, key) == ABSENT:
            yield Difference(key, ABSENT, "not recorded")


def _may_be(outcome: Any, summary: Any, shown: Shown) -> bool:
    """Return whether a run may have had an outcome.

    A run that fails is inconclusive only where a slow host may be why. One that passes is so too
    where faults struck nothing, or results were lost.
    """
    if outcome != "inconclusive":
        failed = outcome == "fail" and shown.outcome == "inconclusive"  # a controller may crash
        return failed or bool(outcome == shown.outcome)
    if not shown.repeatable or shown.outcome == "inconclusive":
        return True
    lost = str(value_at(summary, "reason")).startswith(LOST)
    return shown.outcome == "pass" and (lost or any(map(is_idle, _rows(summary))))


def _faults_over(faults: Any, shown: Shown) -> Iterator[Difference]:
    """Yield what differs of the faults that were over before the recording's end."""
    over = {
        number: row
        for number, row in shown.figures.get("faults", {}).items()
        if row.get("to_s") is not None and row["to_s"] < shown.until_s - WRITTEN_S
    }
    if isinstance(faults, list):
        named = [each for each in faults if isinstance(each, dict)]
        faults = [each for each in named if str(each.get("number")) in over]
    yield from unequal("faults", _comparable(faults, over, operated=False), over, shown.exact)


def _comparable_packets(
    summarised: dict[str, Any], recorded: dict[str, int]
) -> tuple[dict[str, Any], dict[str, int]]:
    """Return the counters of summary and recording by the same names; none where none is recorded.

    A counter that a recording lacks is 0 to its end. What components rejected is not recorded.
    """
    names = sorted((set(summarised) | set(recorded)) - {"rejected"}) if recorded else []
    return (
        {name: summarised.get(name, ABSENT) for name in names},
        {name: recorded.get(name, 0) for name in names},
    )


def _comparable(faults: Any, recorded: dict[str, Any], operated: bool) -> Any:
    """Return a summary's faults by number, with the keys that a recording shows of each.

    operated: whether there may be faults that found no agent and left no event.
    """
    if not isinstance(faults, list) or not all(isinstance(each, dict) for each in faults):
        return faults
    found: dict[str, Any] = {}
    for each in faults:
        number = str(each.get("number"))
        if number in found:
            return faults
        if operated and number not in recorded and each.get("agents") == []:
            continue
        names = set(recorded.get(number) or each)
        found[number] = {name: value for name, value in each.items() if name in names}
    return found


def unequal(key: str, summarised: Any, recorded: Any, exact: bool) -> Iterator[Difference]:
    """Yield the differences of two values and of all that they hold."""
    if summarised == ABSENT and not exact and key.rpartition(".")[2] in ADDED_LATER:
        return
    before, after = _items(summarised), _items(recorded)
    if after is None or (before is None and not after):
        # JSON has true and 1 apart, Python takes them for equal.
        if summarised != recorded or isinstance(summarised, bool) != isinstance(recorded, bool):
            yield Difference(key, summarised, recorded)
        return
    for name in dict.fromkeys((*after, *(before or {}))):
        inner, shown = (before or {}).get(name, ABSENT), after.get(name, ABSENT)
        yield from unequal(f"{key}.{name}", inner, shown, exact)


def _items(value: Any) -> dict[str, Any] | None:
    """Return what a table, or a list of tables, holds; None for a plain value."""
    if isinstance(value, list) and any(isinstance(each, dict) for each in value):
        return {str(index): each for index, each in enumerate(value)}
    return value if isinstance(value, dict) else None


def _rows(summary: Any) -> list[dict[str, Any]]:
    """Return the faults of a summary; none where it has no list of them."""
    faults = value_at(summary, "faults")
    if not isinstance(faults, list) or not all(isinstance(each, dict) for each in faults):
        return []
    return faults


def _sum_of(by_cause: Any) -> int | None:
    """Return how many messages components refused; None where nothing tells it."""
    if not isinstance(by_cause, dict):
        return None
    tables = list(by_cause.values())
    if not all(isinstance(each, dict) and all(map(_is_number, each.values())) for each in tables):
        return None
    return sum(sum(each.values()) for each in tables)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
