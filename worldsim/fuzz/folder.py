"""The folder of a search: what it searches, a line for each seed, its findings."""

import fcntl
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from worldsim.results.run_folder import RunDirectoryError, unwritable, write_json

SEARCH: Final = "search.json"
SEEDS: Final = "seeds.jsonl"
TABLE: Final = "table.md"
FINDINGS: Final = "findings"
SCENARIO: Final = "scenario.toml"
ORIGINAL: Final = "original.toml"
FINDING: Final = "finding.json"
PAGE: Final = "finding.md"
Row = dict[str, Any]
"""What is kept of a seed, or of a finding."""


class SearchFolder:
    """Reads and writes the folder of a search. Raises RunDirectoryError where it cannot."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._seeds = path / SEEDS

    @contextmanager
    def opened(self, terms: Mapping[str, Any]) -> Iterator[None]:
        """Begin a search of such terms, or go on with it, and keep others out meanwhile.

        The folder of another search is refused, and one in which a search is at work.
        """
        kept = self.path / SEARCH
        if kept.exists():
            self._check(json.loads(kept.read_text(encoding="utf-8")), terms)
        elif self.path.exists() and any(self.path.iterdir()):
            raise RunDirectoryError(self.path, "is not empty, and no folder of a search")
        else:
            try:
                (self.path / FINDINGS).mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise unwritable(self.path, error) from error
            write_json(kept, terms)
        with kept.open("rb") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                detail = "another search is at work in it; wait for it, or choose another --out"
                raise RunDirectoryError(self.path, detail) from error
            yield

    def _check(self, kept: Mapping[str, Any], terms: Mapping[str, Any]) -> None:
        for name in terms:
            if kept.get(name) != terms[name]:
                was, now = (_shown(each) for each in (kept.get(name), terms[name]))
                detail = f"holds another search: {name} is {was} there, and {now} here"
                raise RunDirectoryError(self.path, f"{detail}; choose another --out")

    def rows(self) -> dict[int, Row]:
        """Return the seeds that have flown; a line that was cut off is left out."""
        if not self._seeds.exists():
            return {}
        lines = self._seeds.read_text(encoding="utf-8").splitlines()
        rows = [json.loads(line) for line in lines if line.endswith("}")]
        return {row["seed"]: row for row in rows}

    def add(self, row: Row) -> None:
        """Append the line of a seed that has flown."""
        try:
            cut = self._seeds.exists() and not self._seeds.read_bytes().endswith(b"\n")
            with self._seeds.open("a", encoding="utf-8") as file:
                file.write(("\n" if cut else "") + json.dumps(row, allow_nan=False) + "\n")
        except OSError as error:
            raise unwritable(self._seeds, error) from error

    def finding(self, name: str) -> Path:
        """Return the folder of a finding."""
        return self.path / FINDINGS / name


def read_finding(folder: Path) -> Row:
    """Return what is known of a finding. Raises RunDirectoryError where there is none."""
    file = folder / FINDING
    try:
        row: Row = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        detail = f"is not a finding of `qswarm fuzz`: {FINDING} cannot be read"
        raise RunDirectoryError(folder, detail) from error
    return row


def findings_in(folder: Path) -> list[Path]:
    """Return the folders of the findings in a folder, by name."""
    return sorted(file.parent for file in folder.glob(f"*/{FINDING}"))


def _shown(value: Any) -> str:
    return "not given" if value is None else str(value)
