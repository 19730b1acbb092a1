"""The report of a sweep: one page with its curves and maps, where it breaks, and its cells."""

import json
from collections.abc import Callable, Iterator
from html import escape
from pathlib import Path
from typing import Any, Final

from worldsim.report import page_parts as parts
from worldsim.report.page_parts import DrawnFigure, Figure
from worldsim.report.report import refuse_existing, write
from worldsim.sweep.figures import SweepFigure, sweep_figures
from worldsim.sweep.flight_row import FlightRow
from worldsim.sweep.journal import Identity, read_sweep
from worldsim.sweep.plan import FlightKey, Plan
from worldsim.sweep.result import BreakRow, CellRow, Rows, breaks_of, cells_of
from worldsim.sweep.sweep_text import cells_table, settings_text

SUMMARY: Final = "summary.json"
FAILURES: Final = 20
"""Failed flights that are listed."""
CURVES: Final = (
    "Left: the share of flights that pass, with Wilson's 95 % intervals, and the fitted curve; the"
    " bar at one half is the interval of the break. Right: the median time to converge, where all"
    " formations of a flight did."
)
MAPS: Final = "A cell for each pair of values: flights that pass of those judged; median time."


def report_sweep(folder: Path, file: Path, progress: Callable[[str], None]) -> Path:
    """Write the page of a sweep's folder, complete or not, and return the figures' folder.

    All is computed from the lines of its flights; only the host is read from its summary. Raises
    RunDirectoryError where the folder holds no sweep, ReportError where the page exists, or cannot
    be written.
    """
    refuse_existing(file)
    progress(f"reading {folder}")
    plan, identity, rows = read_sweep(folder)
    cells = cells_of(plan, rows)
    drawn = []
    for each in sweep_figures(plan, cells):
        drawn.append(_captioned(each))
        progress(f"{identity['scenario']}: drew {each.name}")
    summary = _summary(folder)
    return write(file, _page(plan, identity, rows, (cells, drawn, summary)), {"": drawn})


def _summary(folder: Path) -> dict[str, Any]:
    """Return the sweep's summary; nothing where it has none yet, or none that can be read."""
    try:
        found = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _captioned(figure: SweepFigure) -> DrawnFigure:
    kind, _, keys = figure.name.partition("-")
    title = f"Over {keys.replace('-by-', ' and ')}" if kind == "map" else f"Along {keys}"
    caption = MAPS if kind == "map" else CURVES
    return DrawnFigure(figure.name, title, caption, figure.svg, figure.png)


def _page(
    plan: Plan,
    identity: Identity,
    rows: Rows,
    shown: tuple[list[CellRow], list[DrawnFigure], dict[str, Any]],
) -> str:
    """Return the page. shown: cells, figures, and the summary."""
    cells, drawn, summary = shown
    breaks, failures = breaks_of(plan, cells), _failures(plan, rows)
    failed = sum(cell["fail"] for cell in cells)
    head, body = cells_table(cells)
    sections = [
        '<p class="kind">qswarm report: a sweep</p>',
        f"<h1>{escape(identity['scenario'])}</h1>",
        f'<p class="lead">{escape(_lead(plan))}</p>',
        _verdict(plan, cells),
        parts.notes_box(_notes(plan, rows)),
        parts.tiles(_tiles(plan, cells)),
        "<h2>Where it breaks</h2>",
        _breaks(breaks),
        "<h2>Figures</h2>" if drawn else "",
        *(parts.drawn(each, f"{number}-") for number, each in enumerate(drawn)),
        "<h2>Cells</h2>",
        '<p class="caption">Flights with the same settings: how many pass, the share with Wilson\'s'
        " 95 % interval, and medians over the flights that measured them.</p>",
        parts.table(head, [list(map(Figure, row)) for row in body], numbers=len(plan.axes)),
        f"<h2>Flights that fail</h2>{parts.listed(failures)}" if failures else "",
        f"<p>and {failed - FAILURES} more, in flights.csv</p>" if failed > FAILURES else "",
        "<h2>Provenance</h2>",
        parts.pairs(_provenance(plan, identity, summary)),
    ]
    return parts.document(f"{identity['scenario']}, a sweep", sections)


def _lead(plan: Plan) -> str:
    cells = len(plan.cells)
    word = "seeds" if len(plan.seeds) > 1 else "seed"
    flown = f"each flown with the {word} {_seeds(plan)}, in virtual time"
    return f"{cells} cell{'s' * (cells > 1)}, {flown}."


def _seeds(plan: Plan) -> str:
    first, last = plan.seeds.start, plan.seeds.stop - 1
    return str(first) if first == last else f"{first} to {last}"


def _verdict(plan: Plan, cells: list[CellRow]) -> str:
    flown, passed = sum(each["flights"] for each in cells), sum(each["pass"] for each in cells)
    failed, open_ = sum(each["fail"] for each in cells), sum(each["inconclusive"] for each in cells)
    doubt = open_ or flown < len(plan)
    outcome = "fail" if failed else "inconclusive" if doubt else "pass"
    unjudged = f", {open_} inconclusive" if open_ else ""
    return parts.verdict_box(outcome, f"{passed} of {flown} flights pass{unjudged}")


def _notes(plan: Plan, rows: Rows) -> list[str]:
    missing = len(plan) - len(rows)
    return [f"{missing} of {len(plan)} flights are not flown yet."] if missing else []


def _tiles(plan: Plan, cells: list[CellRow]) -> Iterator[tuple[str, Figure]]:
    yield "flights", Figure(str(sum(each["flights"] for each in cells)))
    yield "pass", Figure(str(sum(each["pass"] for each in cells)))
    yield "fail", Figure(str(sum(each["fail"] for each in cells)))
    yield "cells", Figure(str(len(cells)))
    yield "cells in which all pass", Figure(str(sum(each["pass_share"] == 1.0 for each in cells)))
    yield "keys varied", Figure(str(len(plan.axes)))


def _breaks(breaks: list[BreakRow]) -> str:
    if not breaks:
        return '<p class="caption">No number is varied.</p>'
    rows = [
        [Figure(row["key"]), Figure(settings_text(row["where"]) or "-"), Figure(row["text"])]
        for row in breaks
    ]
    return (
        '<p class="caption">The value of each number at which half of the flights pass, by a'
        " logistic curve through their outcomes, the other keys held.</p>"
        + parts.table(("number", "where", ""), rows, numbers=3)
    )


def _failures(plan: Plan, rows: Rows) -> list[str]:
    """Return the first flights that fail, each as its settings and its reason."""
    failed = [key for key in sorted(rows) if rows[key]["outcome"] == "fail"]
    return [_failure(plan, key, rows[key]) for key in failed[:FAILURES]]


def _failure(plan: Plan, key: FlightKey, row: FlightRow) -> str:
    where = settings_text({**plan.settings(key.cell), "seed": str(key.seed)})
    return f"{where}: {row['reason'] or 'no reason is known'}"


def _provenance(
    plan: Plan, identity: Identity, summary: dict[str, Any]
) -> Iterator[tuple[str, str]]:
    yield "scenario", identity["scenario"]
    for axis in plan.axes:
        yield "varied", f"{axis.key} = {', '.join(axis.values)}"
    yield "seeds", _seeds(plan)
    for name, digest in identity["controllers"].items():
        yield "controller", f"{name}, SHA-256 {digest}"
    yield "content_sha256", identity["content_sha256"]
    yield from parts.provenance({**identity, "host": summary.get("host")})
