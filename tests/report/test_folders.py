"""The reports of a sweep and of a finding, and what is neither."""

import json
import shutil
from math import nan
from pathlib import Path

import numpy as np
import pytest

from tests.report.pages import Page, assert_loads_nothing
from tests.small_scenario import SMALL
from tests.sweep.test_journal import IDENTITY, row
from worldsim.commands.app import command
from worldsim.fuzz.margin_figure import curves_of, marks_of
from worldsim.scenario.file import parse
from worldsim.sweep.figures import INK, MAP, _readable
from worldsim.sweep.journal import Journal, read_sweep
from worldsim.sweep.result import breaks_of, cells_of

FINDING = Path(__file__).parent / "a_finding"
SEEDS = 6


def sweep_folder(folder: Path, lines: int) -> Path:
    """Write the folder of a sweep over three values, of which the last fails, as far as it is."""
    identity = {
        **IDENTITY,
        "vary": [("netem.loss_percent", ["0", "50", "90"])],
        "seeds": (0, SEEDS),
    }
    journal = Journal(folder, identity)  # type: ignore[arg-type]
    for number in range(lines):
        seed, cell = divmod(number, 3)
        lost = cell == 2 or (cell == 1 and seed % 3 == 0)
        flight = row(cell, seed, "fail" if lost else "pass")
        journal.append({**flight, "reason": "too <late>" if lost else None})
    journal.close()
    return folder


def test_the_report_of_a_sweep_holds_its_cells_breaks_and_curves(tmp_path: Path) -> None:
    folder = sweep_folder(tmp_path / "sweep", 3 * SEEDS)
    assert command(["report", str(folder)]) == 0
    page = Page((folder / "report" / "report.html").read_text())
    assert_loads_nothing(page)
    plan, _, rows = read_sweep(folder)
    cells = cells_of(plan, rows)
    for cell in cells:
        assert f"{cell['pass_share_low']:.2f} to {cell['pass_share_high']:.2f}" in page.text
    (found,) = breaks_of(plan, cells)
    assert found["text"] in page.text
    assert found["kind"] == "break"
    assert "10 of 18 flights pass" in page.text
    assert "netem.loss_percent = 50, seed = 3: too <late>" in page.text
    assert "not flown yet" not in page.text
    assert "c0ffee" in page.text
    drawn = {each.name for each in (folder / "report" / "figures").iterdir()}
    assert drawn == {"along-netem.loss_percent.svg", "along-netem.loss_percent.png"}
    assert [tag for tag, _ in page.tags].count("svg") == 1


def test_the_report_of_a_sweep_that_goes_on_says_what_is_missing(tmp_path: Path) -> None:
    folder = sweep_folder(tmp_path / "sweep", 7)
    out = tmp_path / "page.html"
    assert command(["report", str(folder), "--out", str(out)]) == 0
    page = Page(out.read_text())
    assert "11 of 18 flights are not flown yet" in page.text
    assert (tmp_path / "page-figures" / "along-netem.loss_percent.svg").is_file()


@pytest.fixture(scope="module")
def finding(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("found") / "blind"
    shutil.copytree(FINDING, folder)
    return folder


def test_the_report_of_a_finding_explains_it(finding: Path) -> None:
    assert command(["report", str(finding)]) == 0
    page = Page((finding / "report" / "report.html").read_text())
    assert_loads_nothing(page)
    known = json.loads((finding / "finding.json").read_text())
    assert "liveness violated (converge)line did not converge within 45 s" in page.text
    assert "First tick of trouble: 4.1 s" in page.text
    assert "after 3 flights" in page.text
    assert "a1 takes slot 1 of queue Q1" in page.text
    assert "It needs the event at 0.1 s:[[event]]" in page.text
    assert (finding / "scenario.toml").read_text().strip() in page.text
    assert known["trace_sha256"] in page.text
    assert "nearest two vehicles [m]" in page.text
    assert "nearest obstacle" not in page.text, "there is none"
    assert {each.name for each in (finding / "report" / "figures").iterdir()} == {
        "margins.svg",
        "margins.png",
    }


def test_a_finding_that_is_not_explained_yet_has_a_page_too(tmp_path: Path) -> None:
    folder = tmp_path / "new"
    shutil.copytree(FINDING, folder)
    known = json.loads((folder / "finding.json").read_text())
    for key in ("cause", "events", "margins"):
        del known[key]
    known |= {"shrunk": False, "last_event": None}
    (folder / "finding.json").write_text(json.dumps(known))
    assert command(["report", str(folder)]) == 0
    page = Page((folder / "report" / "report.html").read_text())
    assert "no fault before it" in page.text
    assert f"qswarm cause {folder}" in page.text
    assert "after 3 flights" not in page.text
    assert "svg" not in {tag for tag, _ in page.tags}


def test_margins_are_drawn_in_metres() -> None:
    scenario = parse(SMALL, "small.toml")
    margins = {"separation": [1.0, None, -0.5], "clearance": [], "slot_error_m": [None, 2.0, 0.1]}
    separation, error = curves_of(margins, scenario)
    bound_m = scenario.control.separation_m
    np.testing.assert_allclose(separation.values, [2.0 * bound_m, nan, 0.5 * bound_m])
    np.testing.assert_allclose(error.values, [nan, 2.0, 0.1])


def test_events_near_to_each_other_share_a_mark() -> None:
    assert marks_of([1.0, 1.2, 1.2, 5.0], 10.0) == [(1.0, "1-3"), (5.0, "4")]
    assert marks_of([], 10.0) == []


def test_texts_of_a_map_stand_out() -> None:
    assert _readable(MAP(0.0)) == INK
    assert _readable(MAP(1.0)) == "white"


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (
            "empty",
            "report takes runs, folders of runs, the folder of a sweep, or that of a finding",
        ),
        ("search", "name one of its findings, as "),
        ("broken", "finding.json cannot be read"),
        ("both", "a sweep or a finding is reported alone"),
        ("written", "exists; nothing is overwritten"),
        ("scenario", "scenario.toml: cannot be read"),
    ],
)
def test_what_cannot_be_reported_is_refused(
    kind: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "folder"
    shutil.copytree(FINDING, folder / "findings" / "one")
    arguments = {
        "empty": [folder / "findings"],
        "search": [folder],
        "both": [folder / "findings" / "one", folder],
    }.get(kind, [folder / "findings" / "one"])
    if kind == "search":
        (folder / "search.json").write_text("{}")
    if kind == "broken":
        (folder / "findings" / "one" / "finding.json").write_text("{")
    if kind == "written":
        (folder / "findings" / "one" / "report").mkdir()
        (folder / "findings" / "one" / "report" / "report.html").write_text("mine")
    if kind == "scenario":
        (folder / "findings" / "one" / "scenario.toml").unlink()
    assert command(["report", *map(str, arguments)]) == 2
    error = capsys.readouterr().err.strip()
    assert says in error
    assert len(error.splitlines()) == 1
