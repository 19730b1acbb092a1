"""Many numbers of one base: flown in children, kept in a file, and summed up in one table."""

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

from tests.random_flights.children import answers
from tests.random_flights.fly import flown, trace_of_fresh_interpreter
from tests.random_flights.generate import Generated
from worldsim.results.progress_line import ProgressLine

FAILURES = ("exception", "hang", "crash", "I1", "unequal traces")
FRESH_EVERY = 8
"""The second flight of every eighth number is in an interpreter of its own."""
ROUNDING_M = 1e-9
"""A distance that is smaller than its bound by no more than this is not too small [m]."""
SHOWN = 40
SLOW_CHECK_S = 1.0
"""CPU time in which ``check`` must have answered [s]."""
Generate = Callable[[int], Generated]


class Campaign(NamedTuple):
    """What to fly, and how."""

    generate: Generate
    folder: Path
    """Of results.jsonl, and of the scenario of each number that failed."""
    jobs: int = 1
    deadline_s: float = 120.0
    twice_every: int = 1
    """Every so many numbers are flown twice; 0: none."""

    @property
    def results(self) -> Path:
        return self.folder / "results.jsonl"

    def rows(self) -> dict[int, dict[str, Any]]:
        """Return the rows that are kept, by number."""
        if not self.results.exists():
            return {}
        lines = self.results.read_text(encoding="utf-8").splitlines()
        kept = [json.loads(line) for line in lines if line.endswith("}")]
        return {row["number"]: row for row in kept}

    def fly(self, numbers: range) -> dict[int, dict[str, Any]]:
        """Fly the numbers that have no row yet; return the rows of all of them."""
        self.folder.mkdir(parents=True, exist_ok=True)
        rows = self.rows()
        left, line = [number for number in numbers if number not in rows], ProgressLine()
        with self.results.open("a", encoding="utf-8") as kept:
            for number, row in answers(left, self._row, self.jobs, self.deadline_s):
                rows[number] = {"number": number, **row}
                kept.write(json.dumps(rows[number]) + "\n")
                kept.flush()
                self._tidy(number, rows[number])
                line.update(progress(rows, numbers))
        line.clear()
        return {number: rows[number] for number in numbers if number in rows}

    def file(self, number: int) -> Path:
        return self.folder / f"{number}.toml"

    def _row(self, number: int) -> dict[str, Any]:
        """Make and fly one number, in a child."""
        made = self.generate(number)
        self.file(number).write_text(made.text, encoding="utf-8")
        row: dict[str, Any] = {
            "drafts": made.drafts,
            "objections": dict(made.objections),
            "check_s": round(made.check_s, 3),
        }
        row |= failure(self.file(number))
        if self.twice_every and number % self.twice_every == 0:
            again = self._again(number)
            if again != row["trace"]:
                row |= {"failure": "unequal traces", "detail": f"{row['trace']} {again}"}
        return row

    def _again(self, number: int) -> str:
        if number % (FRESH_EVERY * self.twice_every) == 0:
            return trace_of_fresh_interpreter(self.file(number))
        return flown(self.file(number)).trace

    def _tidy(self, number: int, row: dict[str, Any]) -> None:
        """Keep the scenarios of those that failed only."""
        if "failure" not in row:
            self.file(number).unlink()


def failure(file: Path) -> dict[str, Any]:
    """Fly a file; return what it showed as a row, with its failure where I1 does not hold."""
    shown = flown(file)
    row = asdict(shown)
    if "I1" in shown.broken or shown.least_margin_m < -ROUNDING_M:
        row |= {"failure": "I1", "detail": _nearest(row)}
    return row


def _nearest(row: dict[str, Any]) -> str:
    """Return how near vehicles came to each other and to obstacles, where too near."""
    told = []
    for name in ("separation", "clearance"):
        least, bound = row[f"{name}_m"], row[f"{name}_bound_m"]
        if least is not None and least < bound:
            when_s, agent, state = row[f"{name}_at"]
            told.append(
                f"{name} {least:.6f} of {bound:g} m, agent {agent} ({state}) at {when_s:.3f} s"
            )
    return "; ".join(told) or "only by the judge's figures"


def progress(rows: dict[int, dict[str, Any]], numbers: range) -> str:
    done = [rows[number] for number in numbers if number in rows]
    failed = sum("failure" in row for row in done)
    return f"{len(done)} of {len(numbers)} flown, {failed} failed"


def report(rows: dict[int, dict[str, Any]]) -> str:
    """Return one table over all rows: what failed, and what is worth knowing beside."""
    failures = {
        name: [row for row in rows.values() if row.get("failure") == name] for name in FAILURES
    }
    lines = ["| failure | flights | numbers |", "|---|---|---|"]
    for name, found in failures.items():
        numbers = ", ".join(str(row["number"]) for row in found[:SHOWN])
        lines.append(f"| {name} | {len(found)} | {numbers or '-'} |")
    lines += ["", *details(rows), "", *information(list(rows.values()))]
    return "\n".join(lines)


def details(rows: dict[int, dict[str, Any]]) -> list[str]:
    failed = [row for row in rows.values() if "failure" in row]
    return [
        f"{row['number']}: {row['failure']}: {row['detail']} ({', '.join(row.get('features', []))})"
        for row in failed
    ]


def information(rows: list[dict[str, Any]]) -> list[str]:
    """Return what is no failure: drafts that check refused, other invariants, outcomes."""
    drawn = [row for row in rows if "drafts" in row]
    at_once = sum(not row["objections"] for row in drawn) / max(1, len(drawn))
    objections, broken = Counter[str](), Counter[str]()
    for row in drawn:
        objections.update(row["objections"])
        broken.update(row.get("broken", {}).keys())
    slow = {row["number"]: row["check_s"] for row in drawn if row["check_s"] > SLOW_CHECK_S}
    outcomes = Counter(row["outcome"] for row in rows if "outcome" in row)
    return [
        f"first drafts that check accepts without a warning: {at_once:.0%}",
        f"keys that check objected to: {_counted(objections)}",
        f"checks over {SLOW_CHECK_S:g} s: {slow or 'none'}",
        f"flights with a violated invariant: {_counted(broken)}",
        f"outcomes: {_counted(outcomes)}",
    ]


def _counted(counts: Counter[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.most_common()) or "none"
