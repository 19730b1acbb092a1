"""A JUnit file of runs: for each run a case for its outcome, each expectation and each invariant.

A run that is not judged must not look like one that passed, so the case of its outcome is an error.
What such a run missed, and what it could not test, is skipped: it says nothing of the fleet. So is
all that a run met that ended before it flew.
"""

import os
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

from worldsim.judge.finding import ExpectationRow
from worldsim.results.expectation_text import expectation_texts, was_tested
from worldsim.results.judge_rows import InvariantRow
from worldsim.results.output_streams import escaped
from worldsim.results.overall import FailedRun, Made, Result
from worldsim.results.run_folder import RunDirectoryError, unwritable
from worldsim.results.summary import Summary
from worldsim.results.verdict_text import circumstances, violation_text

HEAD_B = 512
"""So much of a file tells whether it is XML [bytes]."""
NOT_XML = {0xFFFE: "\\ufffe", 0xFFFF: "\\uffff"}
"""Characters that XML cannot hold, and that are no controls."""


class _Finding(NamedTuple):
    """Why a case did not pass: an element of its own."""

    element: str  # "failure", "error" or "skipped"
    message: str
    type: str = ""
    details: str = ""


def check_junit_file(file: Path, new_folder: Path | None = None) -> None:
    """Raise RunDirectoryError where a file cannot be written, or holds something other than XML.

    new_folder: a folder that is yet to be made; a file in it is not looked at.
    """
    if new_folder is not None and file.parent == new_folder:
        return
    if file.is_dir():
        raise RunDirectoryError(file, "is a folder; --junit takes a file")
    try:
        existed = file.exists()
        if existed and not file.is_file():
            if not os.access(file, os.W_OK):
                raise RunDirectoryError(file, "permission denied")
            return  # opening a pipe waits for its reader
        with file.open("ab"):
            pass
        if not existed:
            file.unlink()
        elif not _may_be_replaced(file):
            raise RunDirectoryError(file, "exists, and is no XML file; --junit names another")
    except OSError as error:
        raise unwritable(file, error) from error


def write_junit(file: Path, runs: Iterable[Made], cut_off_by: str | None = None) -> None:
    """Write a JUnit file: a suite for each scenario; an older XML file is replaced.

    cut_off_by: why not all of the runs were made; it is an error in a suite of its own. Raises
    RunDirectoryError.
    """
    check_junit_file(file)
    content = ET.tostring(_document(runs, cut_off_by), encoding="utf-8", xml_declaration=True)
    try:
        file.write_bytes(content + b"\n")
    except OSError as error:
        raise unwritable(file, error) from error


def _may_be_replaced(file: Path) -> bool:
    with file.open("rb") as opened:
        head = opened.read(HEAD_B).removeprefix(b"\xef\xbb\xbf").lstrip()
    return not head or head.startswith(b"<")


def _document(runs: Iterable[Made], cut_off_by: str | None) -> ET.Element:
    root = ET.Element("testsuites", name="qswarm")
    suites: dict[str, ET.Element] = {}
    for run in runs:
        _add_run(_suite(root, suites, _scenario_and_seed(run)[0]), run)
    if cut_off_by is not None:
        suite = ET.SubElement(root, "testsuite", name="all runs")
        _add_case(suite, "all runs", "outcome", _Finding("error", cut_off_by, "inconclusive"))
    for each in (*root, root):
        _count(each)
    ET.indent(root)
    return root


def _suite(root: ET.Element, suites: dict[str, ET.Element], name: str) -> ET.Element:
    if name not in suites:
        suites[name] = ET.SubElement(root, "testsuite", name=_clean(name))
    return suites[name]


def _count(suite: ET.Element) -> None:
    counted = Counter(each.tag for each in suite.iter())
    suite.set("tests", str(counted["testcase"]))
    for name, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(name, str(counted[tag]))


def _scenario_and_seed(run: Made) -> tuple[str, int]:
    if isinstance(run, Result):
        return run.summary["scenario"], run.summary["seed"]
    return run.scenario, run.seed


def _add_run(suite: ET.Element, run: Made) -> None:
    scenario, seed = _scenario_and_seed(run)
    class_name = f"{scenario}.{seed}"
    outcome = _add_case(suite, class_name, "outcome", _outcome(run))
    lines = [f"run: {run.folder}"]
    if isinstance(run, Result):
        lines.append(f"trace_sha256: {run.summary['trace_sha256'] or 'not measured'}")
        pace = run.summary["real_time_factor"]
        if pace:
            outcome.set("time", f"{run.summary['duration_s'] / pace:.3f}")
        for name, finding in _cases(run.summary):
            _add_case(suite, class_name, name, finding)
    ET.SubElement(outcome, "system-out").text = _clean("\n".join(lines))


def _outcome(run: Made) -> _Finding | None:
    if isinstance(run, FailedRun):
        return _Finding("error", run.error, run.outcome, run.details)
    reason = run.summary["reason"] or ""
    match run.outcome:
        case "fail":
            return _Finding("failure", reason, "fail")
        case "inconclusive":
            return _Finding("error", reason, "inconclusive")
        case "pass":
            return None


def _cases(summary: Summary) -> Iterator[tuple[str, _Finding | None]]:
    """Yield each expectation and each invariant, by a name of its own in the run."""
    conclusive = summary["outcome"] != "inconclusive"
    met = (
        None
        if summary["duration_s"] > 0.0
        else _Finding("skipped", "not judged: nothing was flown")
    )
    rows = summary["expectations"]
    seen: Counter[str] = Counter()
    for row, text in zip(rows, expectation_texts(rows, circumstances(summary)), strict=True):
        seen[row["name"]] += 1
        count = seen[row["name"]]
        name = row["name"] if count == 1 else f"{row['name']} ({count})"
        yield name, _of_expectation(row, text, conclusive=conclusive) or met
    for name, tally in summary["invariants"].items():
        yield f"invariant {name}", _of_invariant(name, tally, conclusive=conclusive) or met


def _of_expectation(row: ExpectationRow, text: str, *, conclusive: bool) -> _Finding | None:
    if row["held"] is None:
        return _Finding("skipped", f"not judged: {text}")
    if not was_tested(row):
        return _Finding("skipped", f"not tested: {text}")
    if row["held"]:
        return None
    if not conclusive:
        return _Finding("skipped", f"not met, but the run is inconclusive: {text}")
    figures = {"required": row["wanted"], "got": row["got"], "margin": row["margin"]}
    details = "\n".join(f"{what}: {_figure(value)}" for what, value in figures.items())
    return _Finding("failure", text, "not met", details)


def _figure(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _of_invariant(name: str, tally: InvariantRow, *, conclusive: bool) -> _Finding | None:
    if not tally["ticks"]:
        return _Finding("skipped", "never evaluated")
    if not tally["violations"]:
        return None
    text = violation_text(name, tally)
    if not conclusive:
        return _Finding("skipped", f"violated, but the run is inconclusive: {text}")
    details = f"required: 0 ticks\ngot: {tally['violations']} ticks\nmargin: -"
    return _Finding("failure", text, "violated", details)


def _add_case(
    suite: ET.Element, class_name: str, name: str, finding: _Finding | None
) -> ET.Element:
    case = ET.SubElement(suite, "testcase", classname=_clean(class_name), name=_clean(name))
    if finding is not None:
        element = ET.SubElement(case, finding.element, message=_clean(finding.message))
        if finding.type:
            element.set("type", finding.type)
        element.text = _clean(finding.details) or None
    return case


def _clean(text: str) -> str:
    """Return a text with escapes for the characters that XML cannot hold."""
    return escaped(text).translate(NOT_XML)
