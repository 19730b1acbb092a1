"""Two runs side by side: their figures, their scenarios, and the tick at which they part."""

import json
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypedDict

import numpy as np

from worldsim.judge.tick import Tick
from worldsim.recording.layout import RECORDING_FILE, SUMMARY_FILE
from worldsim.recording.readback import RecordingError
from worldsim.results.run import open as open_run
from worldsim.results.run_folder import RunDirectoryError
from worldsim.sweep.flight_row import FIGURES, figures_of

SCENARIO_FILE = "scenario.toml"
ABOUT = ("scenario", "seed", "mode", "agents", "duration_s", "outcome", "version", "commit")
"""Keys of summary.json that are shown beside the figures."""


class Side(NamedTuple):
    """One of the two runs."""

    folder: Path
    summary: dict[str, Any]
    scenario: dict[str, Any]  # flat: dotted keys

    @property
    def recorded(self) -> bool:
        """Whether it has a recording."""
        return (self.folder / RECORDING_FILE).is_file()


class Parting(TypedDict):
    """The first tick at which two recordings differ."""

    tick: int
    t_s: float
    agent: int | None  # the first that differs; None: a run has ended
    what: str


class RunPair(TypedDict):
    """Two runs compared: pairs are (first, second)."""

    kind: str
    runs: tuple[str, str]
    figures: dict[str, tuple[Any, Any]]
    scenario_differs: dict[str, tuple[Any, Any]]  # by key; None: absent
    same_trace: bool | None  # None where one has none
    parting: Parting | None
    trace_text: str


def is_run(folder: Path) -> bool:
    """Return whether a folder is one of a single run."""
    return (folder / SUMMARY_FILE).is_file() and (folder / SCENARIO_FILE).is_file()


def read_side(folder: Path) -> Side:
    """Return a run's summary and scenario. Raises RunDirectoryError."""
    try:
        summary = json.loads((folder / SUMMARY_FILE).read_text(encoding="utf-8"))
        scenario = tomllib.loads((folder / SCENARIO_FILE).read_text(encoding="utf-8"))
        figures_of(summary)
    except OSError as error:
        raise RunDirectoryError(folder, f"cannot be read: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise RunDirectoryError(folder, f"{SUMMARY_FILE} or {SCENARIO_FILE} is damaged") from error
    return Side(folder, summary, dict(_flat(scenario, "")))


def compare_runs(first: Side, second: Side) -> RunPair:
    """Return two runs side by side; their recordings are read where their traces differ.

    Raises RecordingError for a damaged recording.
    """
    sides = (first, second)
    shown = [{name: side.summary.get(name) for name in ABOUT} for side in sides]
    measured = [figures_of(side.summary) for side in sides]
    figures = {name: (shown[0][name], shown[1][name]) for name in ABOUT}
    figures |= {each.name: (measured[0][each.name], measured[1][each.name]) for each in FIGURES}
    keys = sorted(first.scenario.keys() | second.scenario.keys())
    both = {key: (first.scenario.get(key), second.scenario.get(key)) for key in keys}
    same, parting, text = _traces(first, second)
    return {
        "kind": "runs",
        "runs": (str(first.folder), str(second.folder)),
        "figures": figures,
        "scenario_differs": {key: pair for key, pair in both.items() if pair[0] != pair[1]},
        "same_trace": same,
        "parting": parting,
        "trace_text": text,
    }


def parting_of(first: Sequence[Tick], second: Sequence[Tick]) -> Parting | None:
    """Return the first tick at which two recordings differ in what an agent does, to the bit.

    Positions, places and running processes are compared. None: they are equal to the end.
    """
    for one, other in zip(first, second, strict=False):
        found = _parted(one, other)
        if found is not None:
            agent, what = found
            return {"tick": one.index, "t_s": one.time_s, "agent": agent, "what": what}
    if len(first) == len(second):
        return None
    longer = max(first, second, key=len)
    after = longer[min(len(first), len(second))]
    which = "first" if longer is second else "second"
    return {"tick": after.index, "t_s": after.time_s, "agent": None, "what": f"the {which} ended"}


def _parted(one: Tick, other: Tick) -> tuple[int | None, str] | None:
    """Return the first agent that differs in a tick, and how."""
    if len(one.position) != len(other.position):
        return None, f"{len(one.position)} agents in the first, {len(other.position)} in the second"
    moved = ~((one.position == other.position) | (_nan(one) & _nan(other))).all(axis=1)
    apart = (_nan(one) != _nan(other)).any(axis=1)
    for differs, words in (
        (apart, "it is in the world of one of them alone"),
        (moved, ""),
        ((one.place != other.place).any(axis=1), "it claims another place"),
        (one.alive != other.alive, "its process runs in one of them alone"),
    ):
        if differs.any():
            agent = int(np.flatnonzero(differs)[0])
            return agent, words or f"its positions are {_apart(one, other, agent)} apart"
    return None


def _nan(tick: Tick) -> Any:
    return np.isnan(tick.position)


def _apart(one: Tick, other: Tick, agent: int) -> str:
    distance_m = float(np.linalg.norm(one.position[agent] - other.position[agent]))
    return f"{distance_m:.3g} m"


def _traces(first: Side, second: Side) -> tuple[bool | None, Parting | None, str]:
    """Return whether the traces are equal, where the recordings part, and both in words."""
    traces = [side.summary.get("trace_sha256") for side in (first, second)]
    if None in traces:
        bare = next(side for side, trace in zip((first, second), traces, strict=True) if not trace)
        mode = bare.summary.get("mode")
        return None, None, f"traces: {bare.folder} has none (mode {mode}: no two runs are equal)"
    if traces[0] == traces[1]:
        return True, None, "traces: equal, so poses, commands and the radio's verdicts are"
    unrecorded = next((side.folder for side in (first, second) if not side.recorded), None)
    if unrecorded is not None:
        return False, None, f"traces: differ; {unrecorded} has no recording that tells where"
    try:
        parting = parting_of(open_run(first.folder).ticks, open_run(second.folder).ticks)
    except RecordingError as error:
        return False, None, f"traces: differ; {error}"
    if parting is None:
        return False, None, "traces: differ, though not in what is recorded"
    agent = f"agent {parting['agent']}: " if parting["agent"] is not None else ""
    at = f"tick {parting['tick']} ({parting['t_s']:g} s)"
    return False, parting, f"traces: part at {at}: {agent}{parting['what']}"


def _flat(value: Any, key: str) -> Iterator[tuple[str, Any]]:
    """Yield the values of nested tables under dotted keys."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flat(inner, f"{key}.{name}" if key else name)
    elif isinstance(value, list) and any(isinstance(each, dict) for each in value):
        for index, inner in enumerate(value):
            yield from _flat(inner, f"{key}[{index}]")
    else:
        yield key, value
