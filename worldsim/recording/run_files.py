"""A run's scenario.toml and events.jsonl compared with what its recording holds.

Each is compared where it is there: a recording alone is enough for a verdict.
"""

import json
import tomllib
from collections import Counter
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import msgspec

from worldsim.judge.run_events import DiskFilled, RunEvent, as_row, event_of
from worldsim.recording.comparison import ABSENT, LOST, WRITTEN_S, Difference, unequal, value_at
from worldsim.recording.readback import Readback
from worldsim.scenario.file import dump, parse
from worldsim.scenario.toml import ScenarioError

SCENARIO_FILE, EVENTS_FILE = "scenario.toml", "events.jsonl"
READABLE = "readable"
MAX_EVENTS = 20
"""So many events that differ are named."""
Key = tuple[float, str]
"""The time of an event [s], and the event as JSON."""


def file_differences(folder: Path, readback: Readback, summary: Any) -> Iterator[Difference]:
    """Yield where scenario.toml and events.jsonl of a run's folder differ from its recording.

    summary: the content of summary.json, which tells whether results were lost; None: there is
    none.
    """
    scenario, events = folder / SCENARIO_FILE, folder / EVENTS_FILE
    if scenario.is_file():
        yield from _scenario_differences(scenario, readback)
    if events.is_file():
        lossy = _may_have_lost(readback, summary)
        yield from islice(_event_differences(events, readback, lossy), MAX_EVENTS)


def _scenario_differences(file: Path, readback: Readback) -> Iterator[Difference]:
    try:
        written = parse(file.read_text("utf-8"), file)
    except (OSError, ValueError, RecursionError, ScenarioError) as error:
        yield Difference("all of it", f"not {READABLE} ({error})", READABLE, SCENARIO_FILE)
        return
    if written == readback.scenario:
        return
    # As files, so that a difference is named by its key.
    in_file, recorded = (
        _bare(tomllib.loads(dump(written))),
        _bare(tomllib.loads(dump(readback.scenario))),
    )
    for key in dict.fromkeys((*recorded, *in_file)):
        before, after = in_file.get(key, ABSENT), recorded.get(key, ABSENT)
        for each in unequal(key, before, after, exact=True):
            yield Difference(each.key, each.summary, each.recording, SCENARIO_FILE)


def _may_have_lost(readback: Readback, summary: Any) -> bool:
    """Return whether events.jsonl may lack events, as on a full disk or where a run was killed."""
    lost = str(value_at(summary, "reason")).startswith(LOST)
    return summary is None or lost or any(isinstance(each, DiskFilled) for each in readback.events)


def _event_differences(file: Path, readback: Readback, lossy: bool) -> Iterator[Difference]:
    """Yield the events of which file and recording hold different numbers.

    Of a recording that is cut off, those before its last seconds.
    """
    try:
        lines = file.read_text("utf-8").splitlines()
    except (OSError, ValueError) as error:
        yield Difference("all of it", f"not {READABLE} ({error})", READABLE, EVENTS_FILE)
        return
    whole, until_s = readback.finished, readback.ticks[-1].time_s if readback.ticks else 0.0
    written: Counter[Key] = Counter()
    for number, line in enumerate(lines, 1):
        event = _event_of(line)
        if event is not None:
            written[_key(event)] += 1
        elif not lossy:
            yield Difference(f"line {number}", f"not {READABLE}", READABLE, EVENTS_FILE)
    recorded = Counter(map(_key, readback.events))
    for key in sorted(written.keys() | recorded.keys()):
        before, after = written[key], recorded[key]
        compared = whole or key[0] < until_s - WRITTEN_S
        if compared and (before > after or (before < after and not lossy)):
            yield Difference(_name(key), before, after, EVENTS_FILE)


def _event_of(line: str) -> RunEvent | None:
    """Return the event of a line; None where it holds none."""
    try:
        return event_of(json.loads(line))
    except (ValueError, RecursionError, msgspec.ValidationError):
        return None


def _key(event: RunEvent) -> Key:
    return event.t_s, json.dumps(_bare(as_row(event)), sort_keys=True)


def _bare(value: Any) -> Any:
    """Return a value without empty tables: as defaults they are left out, as copies written."""
    if isinstance(value, dict):
        bare = {key: _bare(inner) for key, inner in value.items()}
        return {key: inner for key, inner in bare.items() if inner != {}}
    return [_bare(inner) for inner in value] if isinstance(value, list | tuple) else value


def _name(key: Key) -> str:
    """Return an event in words: what it is of which agent, and when."""
    row = json.loads(key[1])
    agent = "" if row["agent"] is None else f" of a{row['agent']}"
    return f"{row['kind']}{agent} at {row['t_s']:g} s"
