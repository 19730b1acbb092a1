"""Flying a sweep: orders to a site, a line of the journal for each flight, results at the end."""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from netem.wire.shutdown import StopRequest, stop_requests
from worldsim.campaign.flight_site import FlightSite, Order, SiteError
from worldsim.export.table_files import write_csv, write_parquet
from worldsim.results.controller_code import code_sha256, user_controllers
from worldsim.results.exit_status import EXIT_STATUS, INTERRUPTED, INTERRUPTION
from worldsim.results.progress_line import ProgressLine
from worldsim.results.provenance import provenance
from worldsim.results.run_folder import RunWriteError, write_json
from worldsim.scenario.file import dump
from worldsim.scenario.tables import Scenario
from worldsim.sweep.figures import sweep_figures
from worldsim.sweep.flight_row import row_of
from worldsim.sweep.journal import SCHEMA, Identity, Journal
from worldsim.sweep.plan import FlightKey, Plan
from worldsim.sweep.result import Summary, cells_of, summary_of
from worldsim.sweep.sweep_tables import cells_table, flights_table

SUMMARY, FIGURES, SCRATCH = "summary.json", "figures", ".flights"


class Sweep(NamedTuple):
    """What is flown."""

    plan: Plan
    scenarios: Mapping[FlightKey, Scenario]

    @property
    def name(self) -> str:
        """The name of the scenario; that of the first cell where it is varied."""
        return next(iter(self.scenarios.values())).name


class Ended(NamedTuple):
    """A sweep that has ended, complete or not."""

    summary: Summary
    status: int


def identity_of(sweep: Sweep) -> Identity:
    """Return what a sweep is. A user's controllers are known by the files of their package."""
    first, known = sweep.plan.seeds.start, provenance()
    chosen = [sweep.scenarios[FlightKey(cell, first)] for cell in range(len(sweep.plan.cells))]
    return {
        "schema": SCHEMA,
        "scenario": sweep.name,
        "vary": [(axis.key, list(axis.values)) for axis in sweep.plan.axes],
        "seeds": (first, sweep.plan.seeds.stop),
        "content_sha256": _digest(dump(scenario) for scenario in chosen),
        "controllers": {
            str(each): code_sha256(each.name, each.command) for each in user_controllers(chosen)
        },
        "version": known["version"],
        "commit": known["commit"],
        "commit_dirty": known["commit_dirty"],
        "python": known["python"],
        "packages": known["packages"],
    }


def fly(sweep: Sweep, journal: Journal, site: FlightSite, line: ProgressLine) -> Ended:
    """Fly what the journal lacks, and write tables, figures and summary into its folder.

    Ctrl-C ends it between two slots of its flights; what was flown is kept. Raises RunWriteError
    where the folder cannot be written any more.
    """
    with stop_requests() as stop:
        lost = _fly_missing(sweep, journal, site, stop, line)
        cut_off_by = INTERRUPTION if stop.requested else lost
        summary = summary_of(sweep.plan, sweep.name, journal.rows, cut_off_by)
        write_results(journal.folder, sweep.plan, journal, summary, line.update)
    line.clear()
    status = INTERRUPTED if stop.requested else EXIT_STATUS[summary["outcome"]]
    return Ended(summary, status)


def write_results(
    folder: Path,
    plan: Plan,
    journal: Journal,
    summary: Summary,
    progress: Callable[[str], None] = lambda _: None,
) -> None:
    """Write tables, figures and summary, over those of before. Raises RunWriteError."""
    cells = cells_of(plan, journal.rows)
    tables = [flights_table(plan, journal.rows), cells_table(plan, cells)]
    try:
        write_csv(tables, folder)
        write_parquet(tables, folder)
        (folder / FIGURES).mkdir(exist_ok=True)
        progress("drawing the figures")
        for figure in sweep_figures(plan, cells):
            (folder / FIGURES / f"{figure.name}.svg").write_text(figure.svg, encoding="utf-8")
            (folder / FIGURES / f"{figure.name}.png").write_bytes(figure.png)
    except OSError as error:
        raise RunWriteError(folder, error.strerror or str(error)) from error
    write_json(folder / SUMMARY, summary)


def _fly_missing(
    sweep: Sweep, journal: Journal, site: FlightSite, stop: StopRequest, line: ProgressLine
) -> str | None:
    """Fly what the journal lacks; return why the site could not fly it all."""
    missing = [key for key in sweep.plan.flights() if key not in journal.rows]
    named = {_name(key): key for key in missing}
    passed = sum(row["outcome"] == "pass" for row in journal.rows.values())
    pace = _Pace(len(sweep.plan), len(journal.rows), passed)
    orders = _orders(sweep, missing)
    try:
        for flown in site.fly(orders, stop):
            journal.append(row_of(named[flown.key], flown))
            line.update(pace.after(flown.outcome == "pass"))
    except SiteError as error:
        return str(error)
    return None


def _orders(sweep: Sweep, keys: Iterable[FlightKey]) -> Iterator[Order]:
    return (Order(_name(key), sweep.scenarios[key]) for key in keys)


def _name(key: FlightKey) -> str:
    return f"cell{key.cell}-seed{key.seed}"


class _Pace:
    """How far a sweep is, and how long the rest takes.

    flights: in all; before, passed: those that were flown earlier, and how many of them passed.
    """

    def __init__(self, flights: int, before: int, passed: int) -> None:
        self._flights, self._before = flights, before
        self._flown, self._passed = before, passed
        self._began_s = monotonic()

    def after(self, passes: bool) -> str:
        """Count one more flight, and return how far the sweep is."""
        self._flown += 1
        self._passed += passes
        each_s = (monotonic() - self._began_s) / (self._flown - self._before)
        left = _time(each_s * (self._flights - self._flown))
        earlier = f" ({self._before} earlier)" if self._before else ""
        return (
            f"{self._flown} of {self._flights} flights{earlier}, {self._passed} pass, {left} left"
        )


def _time(seconds: float) -> str:
    return f"{seconds / 60.0:.0f} min" if seconds >= 120.0 else f"{seconds:.0f} s"


def _digest(texts: Iterable[str]) -> str:
    digest = hashlib.sha256()
    for text in texts:
        digest.update(text.encode("utf-8") + b"\0")
    return digest.hexdigest()
