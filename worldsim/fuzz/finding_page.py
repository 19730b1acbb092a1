"""The report of a finding: one page that explains it, with its margins drawn and its scenario."""

import shlex
from collections.abc import Callable, Iterator
from html import escape
from pathlib import Path
from typing import Any, Final

import msgspec

from worldsim.fuzz.folder import FINDING, SCENARIO, SEARCH, Row, findings_in, read_finding
from worldsim.fuzz.margin_figure import draw_margins
from worldsim.fuzz.pages import kind_of
from worldsim.judge.event_text import sentence
from worldsim.judge.run_events import event_of
from worldsim.recording.layout import RECORDING_FILE
from worldsim.report import page_parts as parts
from worldsim.report.page import MAX_DRAWN, run_section
from worldsim.report.page_parts import DrawnFigure, Figure
from worldsim.report.report import drawn_of, refuse_existing, write
from worldsim.results.run import Run
from worldsim.results.run import open as open_run
from worldsim.scenario.file import as_toml
from worldsim.scenario.tables import Scenario
from worldsim.scenario.toml import ScenarioError
from worldsim.search.drafts import loaded
from worldsim.search.margins import WORDS

MARGINS: Final = (
    "The least distances and the largest slot error of each part of the flight, of the smallest"
    " scenario. Red: the first tick of trouble. Dotted: the events below, by their numbers. Shaded:"
    " faults in force."
)


def is_finding(folder: Path) -> bool:
    """Return whether a folder is one of a finding."""
    return (folder / FINDING).is_file()


def search_hint(folder: Path) -> str | None:
    """Return what to report instead of the folder of a search; None for any other folder."""
    if not (folder / SEARCH).is_file():
        return None
    found = [str(each) for each in findings_in(folder / "findings")]
    named = f"name one of its findings, as {found[0]}" if found else "it has no finding"
    return f"{folder}: is a search of `qswarm fuzz`; {named}"


def report_finding(folder: Path, file: Path, progress: Callable[[str], None]) -> Path:
    """Write the page of a finding's folder, and return the figures' folder.

    Runs in the folder, such as its replay, follow with their own reports. Raises RunDirectoryError
    where the folder holds no finding, ScenarioError for its scenario, RecordingError for a run in
    it, ReportError where the page exists, or cannot be written.
    """
    refuse_existing(file)
    progress(f"reading {folder}")
    finding, text = read_finding(folder), _scenario_text(folder)
    scenario = loaded(text, folder / SCENARIO)
    progress(f"{finding['name']}: drawing the margins")
    drawn = draw_margins(finding, scenario)
    figures = [DrawnFigure("margins", "Margins over time", MARGINS, *drawn)] if drawn else []
    runs = [open_run(each.parent) for each in sorted(folder.glob(f"*/{RECORDING_FILE}"))]
    flown = [(run, drawn_of(run, progress)) for run in runs[:MAX_DRAWN]]
    page = _page(folder, (finding, scenario, text), figures, flown)
    own = {f"{number}-{run.scenario.name}": each for number, (run, each) in enumerate(flown)}
    return write(file, page, {"": figures, **own})


def _scenario_text(folder: Path) -> str:
    try:
        return (folder / SCENARIO).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(folder / SCENARIO, "", f"cannot be read: {error}") from error


def _page(
    folder: Path,
    found: tuple[Row, Scenario, str],
    figures: list[DrawnFigure],
    flown: list[tuple[Run, list[DrawnFigure]]],
) -> str:
    """Return the page. found: the finding, its scenario, and that as text."""
    finding, scenario, text = found
    name, violated = finding["name"], finding["property"]
    sections = [
        '<p class="kind">qswarm report: a finding</p>',
        f"<h1>{escape(name)}</h1>",
        f'<p class="lead">{escape(WORDS[violated].capitalize())}.</p>',
        parts.verdict_box(
            f"{kind_of(violated)} violated ({violated})", finding["reason"] or "", "fail"
        ),
        parts.tiles(_tiles(finding)),
        "<h2>What happens</h2>",
        f'<p class="caption">{escape(_trouble(finding, scenario))}</p>',
        *(parts.drawn(figure, f"{figure.name}-") for figure in figures),
        _events(finding, scenario),
        "<h2>Cause</h2>",
        _cause(finding, folder),
        "<h2>How small it is</h2>",
        parts.table(("", "faults", "agents", "duration"), _sizes(finding), numbers=1),
        "<h2>Scenario</h2>",
        '<p class="caption">Replay it, and see it:</p>',
        parts.code(_commands(folder)),
        parts.code(text),
        "<h2>Provenance</h2>",
        parts.pairs(_provenance(finding)),
        *(run_section(run, each, number) for number, (run, each) in enumerate(flown)),
    ]
    return parts.document(f"{name}, a finding", sections)


def _tiles(finding: Row) -> Iterator[tuple[str, Figure]]:
    size = finding["size"]
    yield "first tick of trouble", Figure(f"{finding['trouble_s']:g} s")
    yield "faults", Figure(str(size["faults"]))
    yield "agents", Figure(str(size["agents"]))
    yield "duration", Figure(f"{size['duration_s']:g} s")


def _sizes(finding: Row) -> Iterator[list[Figure]]:
    flights = finding["shrink_flights"]
    rows = [("as drawn", finding["original_size"])]
    rows += [(f"after {flights} flights", finding["size"])] if finding["shrunk"] else []
    for name, size in rows:
        duration = f"{size['duration_s']:g} s"
        yield [
            Figure(name),
            Figure(str(size["faults"])),
            Figure(str(size["agents"])),
            Figure(duration),
        ]


def _trouble(finding: Row, scenario: Scenario) -> str:
    last = finding["last_event"]
    before = (
        "no fault before it"
        if last is None
        else f"the last fault before it: {_said(last, scenario)}"
    )
    return f"First tick of trouble: {finding['trouble_s']:g} s; {before}."


def _events(finding: Row, scenario: Scenario) -> str:
    events = finding.get("events") or []
    if not events:
        return ""
    lines = "".join(f"<li>{escape(_said(each, scenario))}</li>" for each in events)
    return f"<h3>The last {len(events)} events before the trouble</h3><ol>{lines}</ol>"


def _said(event: dict[str, Any], scenario: Scenario) -> str:
    """Return an event as its time and a sentence; one of another version as it is."""
    queues = [queue.name for queue in scenario.formation.queue]
    try:
        words = sentence(event_of(event), queues)
    except msgspec.ValidationError:
        words = str(event["kind"])
    return f"{event['t_s']:g} s: {words}"


def _cause(finding: Row, folder: Path) -> str:
    cause = finding.get("cause")
    if cause is not None:
        text, needed = str(cause["text"]), cause.get("needed")
        if needed is None:
            return f"<p>{escape(text)}</p>"
        # Its text ends with the event, as a program writes it; here it is as in the scenario.
        told = f"<p>{escape(text.partition(': {')[0])}:</p>"
        return told + parts.code(as_toml({"event": [needed]}))
    asked = parts.code(f"qswarm cause {shlex.quote(str(folder))}")
    return f'<p class="caption">Not looked for yet. When did the failure become certain?</p>{asked}'


def _commands(folder: Path) -> str:
    file, replay = (shlex.quote(str(folder / name)) for name in (SCENARIO, "replay"))
    return f"qswarm sim {file} --out {replay}\nqswarm view {replay}"


def _provenance(finding: Row) -> Iterator[tuple[str, str]]:
    yield "seed", f"{finding['seed']}, {finding['how']}"
    yield "qswarm", str(finding.get("version") or parts.UNKNOWN)
    yield "commit", str(finding.get("commit") or parts.UNKNOWN)
    yield "trace_sha256", str(finding.get("trace_sha256") or parts.UNKNOWN)
