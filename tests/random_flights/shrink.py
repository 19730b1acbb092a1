"""The smallest scenario that still fails in the same way as a given one.

    python -m tests.random_flights.shrink runs/random-flights-7/12.toml > small.toml

Leaves out events, obstacles, agents and keys one by one, as long as ``check`` accepts the rest
without a warning and its flight fails as before.
"""

import sys
import tempfile
import tomllib
from pathlib import Path

from tests.random_flights.campaign import failure
from tests.random_flights.children import answers
from tests.random_flights.generate import objection
from worldsim.scenario.file import as_toml
from worldsim.search.draws import Tables
from worldsim.search.shrink import shrunk, tidy

DEADLINE_S = 60.0


def flies(tables: Tables, as_before: str) -> float | None:
    """Return when the flight of tables fails ``as_before`` [s], its end at the latest."""
    text = as_toml(tidy(tables))
    if objection(text):
        return None
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "0.toml"
        file.write_text(text, encoding="utf-8")
        ((_, row),) = answers([0], lambda _: failure(file), 1, DEADLINE_S)
    same = row.get("failure") == as_before.partition(":")[0]
    if not same or as_before.partition(":")[2] not in row.get("detail", ""):
        return None
    end_s: float = tables["duration_s"]
    times = [row[f"{name}_at"][0] for name in ("separation", "clearance") if f"{name}_at" in row]
    return max(times, default=end_s)


def main() -> int:
    """Shrink the file that is named; a word after it must be in what the failure says."""
    file, *words = sys.argv[1:]
    tables = tomllib.loads(Path(file).read_text(encoding="utf-8"))
    as_before = words[0] if words else "I1"
    small = shrunk(tables, lambda each: flies(each, as_before))
    if small is None:
        print(f"{file} does not fail so: {as_before}", file=sys.stderr)
        return 1
    sys.stdout.write(as_toml(tidy(small)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
