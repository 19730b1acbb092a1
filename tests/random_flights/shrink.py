"""The smallest scenario that still fails in the same way as a given one.

    python -m tests.random_flights.shrink runs/random-flights-7/12.toml > small.toml

Leaves out events, obstacles, agents and keys one by one, as long as ``check`` accepts the rest
without a warning and its flight fails as before.
"""

import copy
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.random_flights.campaign import failure
from tests.random_flights.children import answers
from tests.random_flights.generate import objection
from worldsim.scenario.file import as_toml
from worldsim.search.draws import Tables

LISTS = ("event", "obstacle", "agent")
TABLES = ("netem", "vehicle", "control", "comms", "sensor", "fleet", "frame", "expect")
NEEDED = ("agents", "start", "converge", "kind")
DEADLINE_S = 60.0
AFTER_S = 0.2
"""So long after the failure a flight may end."""
Fails = Callable[[Tables], dict[str, Any] | None]
"""Returns the row of tables that fail as the given ones do, else None."""


def shrunk(tables: Tables, fails: Fails) -> Tables | None:
    """Return the smallest tables found that fail; None where the given ones do not."""
    row = fails(tables)
    if row is None:
        return None
    smaller = True
    while smaller:
        smaller = False
        for candidate in candidates(tables, row):
            found = fails(candidate)
            if found is not None:
                tables, row, smaller = candidate, found, True
                break
    return tables


def candidates(tables: Tables, row: dict[str, Any]) -> Iterator[Tables]:
    """Yield tables that are smaller by one thing; the most effective first."""
    yield from _shorter(tables, row)
    yield from _without_tables(tables)
    yield from _fewer_agents(tables)
    for name in LISTS:
        yield from _without_items(tables, (name,))
    yield from _without_items(tables, ("netem", "link"))
    for name in TABLES:
        yield from _without_keys(tables, (name,))
    for name in ("proximity", "laser", "sonar"):
        yield from _without_keys(tables, ("sensor", name))
    yield from _round(tables)


def _shorter(tables: Tables, row: dict[str, Any]) -> Iterator[Tables]:
    times = [row[f"{name}_at"][0] for name in ("separation", "clearance") if f"{name}_at" in row]
    for end in sorted({round(time + AFTER_S, 1) for time in times}):
        if 0.0 < end < tables["duration_s"]:
            found = copy.deepcopy(tables) | {"duration_s": end}
            found["event"] = [each for each in found.get("event", []) if each["at_s"] < end]
            yield found


def _without_tables(tables: Tables) -> Iterator[Tables]:
    for name in (
        "netem",
        "comms",
        "sensor",
        "frame",
        "obstacle_field",
        "agent",
        "event",
        "obstacle",
    ):
        if tables.get(name):
            yield {key: value for key, value in tables.items() if key != name}


def _fewer_agents(tables: Tables) -> Iterator[Tables]:
    agents, start = tables["fleet"]["agents"], tables["fleet"]["start"]
    if start.get("kind") != "list":
        for fewer in sorted({2, agents // 2, agents - 1}):
            if 2 <= fewer < agents:
                found = copy.deepcopy(tables)
                found["fleet"]["agents"] = fewer
                yield found
        return
    for index in reversed(range(agents)):
        found = copy.deepcopy(tables)
        for name in ("positions_m", "yaws_deg"):
            if name in start:
                del found["fleet"]["start"][name][index]
        found["fleet"]["agents"] -= 1
        if agents > 2:
            yield found


def _inner(tables: Tables, path: tuple[str, ...]) -> Any:
    for name in path:
        tables = tables.get(name, {}) if isinstance(tables, dict) else {}
    return tables


def _without_items(tables: Tables, path: tuple[str, ...]) -> Iterator[Tables]:
    for index in range(len(_inner(tables, path))):
        found = copy.deepcopy(tables)
        del _inner(found, path)[index]
        yield found


def _without_keys(tables: Tables, path: tuple[str, ...]) -> Iterator[Tables]:
    for key in _inner(tables, path):
        if key not in NEEDED:
            found = copy.deepcopy(tables)
            del _inner(found, path)[key]
            yield found


def _round(tables: Tables) -> Iterator[Tables]:
    """Put usual values in place of drawn ones."""
    for path, key, usual in (
        (("fleet",), "tick_hz", 20.0),
        (("vehicle",), "max_speed_mps", 0.5),
        (("control",), "separation_m", 0.25),
        (("control",), "clearance_m", 0.5),
    ):
        if _inner(tables, path).get(key, usual) != usual:
            found = copy.deepcopy(tables)
            _inner(found, path)[key] = usual
            yield found


def flies(tables: Tables, as_before: str) -> dict[str, Any] | None:
    """Return the row of the flight of tables if it fails ``as_before``, and None otherwise."""
    text = as_toml(tables)
    if objection(text):
        return None
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "0.toml"
        file.write_text(text, encoding="utf-8")
        ((_, row),) = answers([0], lambda _: failure(file), 1, DEADLINE_S)
    same = row.get("failure") == as_before.partition(":")[0]
    return row if same and as_before.partition(":")[2] in row.get("detail", "") else None


def main() -> int:
    """Shrink the file that is named; a word after it must be in what the failure says."""
    file, *words = sys.argv[1:]
    tables = tomllib.loads(Path(file).read_text(encoding="utf-8"))
    as_before = words[0] if words else "I1"
    small = shrunk(tables, lambda each: flies(each, as_before))
    if small is None:
        print(f"{file} does not fail so: {as_before}", file=sys.stderr)
        return 1
    sys.stdout.write(as_toml({key: value for key, value in small.items() if value not in ([], {})}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
