"""The file of `qswarm bench --save`: figures, and what they were measured with.

To change the format so that older readers fail, raise SCHEMA.
"""

import json
from collections.abc import Iterable
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import msgspec

from worldsim.bench.circumstances import Circumstances
from worldsim.bench.measures import Row
from worldsim.scenario.decoding import decode
from worldsim.scenario.toml import ScenarioError, read

FORMAT, SCHEMA = "qswarm-bench", 1


class SavedRow(msgspec.Struct, frozen=True):
    """A row as it was measured."""

    name: str
    unit: str
    measured: float | None
    more: bool


class SavedHost(msgspec.Struct, frozen=True):
    """The kind of machine; see results.provenance."""

    os: str
    machine: str
    cpus: int
    cpu: str | None


class Saved(msgspec.Struct, frozen=True):
    """The part of the file that a comparison uses."""

    format: Literal["qswarm-bench"]
    schema: Literal[1]
    code: str
    commit: str | None
    commit_dirty: bool | None
    python: str
    packages: dict[str, str | None]
    host: SavedHost
    repeats: int
    seconds: float | None  # that every fleet of processes flew; None: each its own time
    rows: tuple[SavedRow, ...]


def content(
    rows: Iterable[Row], measured_with: Circumstances, repeats: int, seconds: float | None
) -> dict[str, Any]:
    """Return the content of a file of figures."""
    return {
        "format": FORMAT,
        "schema": SCHEMA,
        "taken": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        **measured_with,
        "repeats": repeats,
        "seconds": seconds,
        "rows": [{**asdict(row), "reached": row.reached} for row in rows],
    }


def saved(file: Path) -> Saved:
    """Return the figures of a file. Raises ScenarioError that names file and key."""
    try:
        data = json.loads(read(file))
    except (ValueError, RecursionError) as error:
        if isinstance(error, ScenarioError):
            raise
        raise ScenarioError(file, "", f"not JSON: {error}") from error
    if not isinstance(data, dict):
        raise ScenarioError(file, "", "not a file of qswarm bench --save")
    if data.get("format") != FORMAT:
        found = data.get("format")
        got = "is missing" if found is None else f"got {found!r}"
        raise ScenarioError(file, "format", f"{got}; {FORMAT!r} of qswarm bench --save is needed")
    return decode(data, Saved, file)


def of(content_: dict[str, Any]) -> Saved:
    """Return the comparable part of what is about to be saved."""
    return msgspec.convert(content_, Saved)
