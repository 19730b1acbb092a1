"""The report: its figures are those of the recording, and its page loads nothing."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib.image
import numpy as np
import pytest

import worldsim.results
from tests.cut_recordings import cut
from tests.report.pages import Page, assert_loads_nothing
from tests.small_scenario import SMALL
from worldsim.commands.app import command
from worldsim.report import report as report_module
from worldsim.report.curves import draw_distances, draw_forces, draw_turns
from worldsim.report.figures import DrawnFigure, moments_s
from worldsim.report.network import draw_packets, strength
from worldsim.report.report import report
from worldsim.report.shown import Shown
from worldsim.results.run import Run

EVENTFUL = (
    SMALL
    + """
[[obstacle]]
shape = "sphere"
centre_m = [0, 4, 0]
radius_m = 0.5
[[event]]
at_s = 2.0
kill = [1]
for_s = 1.0
[expect]
reform_within_s = 0.1
idle_faults = true
"""
)
EMPTY = ("poses", "targets", "places", "links", "metrics", "packets")
"""Tables that have no row without a tick."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that does not meet its expectations, with its report in it."""
    base = tmp_path_factory.mktemp("run")
    (base / "small.toml").write_text(EVENTFUL)
    assert command(["sim", str(base / "small.toml"), "--out", str(base / "out")]) == 1
    assert command(["report", str(base / "out")]) == 0
    return base / "out"


@pytest.fixture(scope="module")
def summary(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "summary.json").read_text())
    return content


@pytest.fixture(scope="module")
def page(folder: Path) -> Page:
    return Page((folder / "report" / "report.html").read_text())


@pytest.fixture(scope="module")
def run(folder: Path) -> Run:
    return worldsim.results.open(folder)


@pytest.fixture(scope="module")
def shown(run: Run) -> Shown:
    return Shown(run)


def _leaves(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    items = value.items() if isinstance(value, dict) else None
    if isinstance(value, list):
        items = ((str(index), each) for index, each in enumerate(value))
    if items is None:
        yield path, value
        return
    for key, each in items:
        yield from _leaves(each, f"{path}.{key}" if path else key)


@pytest.fixture
def few_figures(shown: Shown, monkeypatch: pytest.MonkeyPatch) -> list[DrawnFigure]:
    """Two figures that stand for all, to save the time that drawing takes."""
    drawn = [DrawnFigure(name, name, name, "<svg></svg>", b"") for name in ("one", "two")]
    monkeypatch.setattr(report_module, "drawn_figures", lambda shown, progress: drawn)
    return drawn


def test_its_figures_equal_the_summarys(page: Page, summary: dict[str, Any]) -> None:
    known = dict(_leaves(summary, ""))
    assert {key: value for key, (value, _) in page.figures.items()} == {
        key: known[key] for key in page.figures
    }
    assert {key.split(".")[0] for key in page.figures} == {
        "min_separation_m",
        "min_obstacle_distance_m",
        "turns_over_limit_fraction",
        "expectations",
        "phases",
        "invariants",
    }
    assert page.figures["min_separation_m"][1] == f"{summary['min_separation_m']:.3f} m"
    assert "equals the one in summary.json" in page.text


def test_every_expectation_has_its_row(page: Page, summary: dict[str, Any]) -> None:
    for index, row in enumerate(summary["expectations"]):
        assert page.figures[f"expectations.{index}.got"][0] == row["got"]
        assert page.figures[f"expectations.{index}.margin"][0] == row["margin"]
    assert page.text.count("NOT MET") == sum(not row["held"] for row in summary["expectations"])
    assert f"fail{summary['reason']}" in page.text
    assert "kill, 2 s to 3 s: struck a1" in page.text


def test_provenance_is_that_of_the_run(page: Page, summary: dict[str, Any]) -> None:
    for key in ("trace_sha256", "python", "version", "commit"):
        assert summary[key] is None or summary[key] in page.text
    for name, version in summary["packages"].items():
        assert f"{name} {version}" in page.text


def test_the_page_loads_nothing(page: Page) -> None:
    assert_loads_nothing(page)


def test_no_two_parts_of_the_page_have_one_id(page: Page) -> None:
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    for _, attributes in page.tags:
        for name in ("href", "xlink:href"):
            target = attributes.get(name) or ""
            assert not target.startswith("#") or target[1:] in ids
    drawn = [each.get("aria-label") for tag, each in page.tags if tag == "figure"]
    assert len(drawn) == len(set(drawn)) == 9


def test_each_figure_is_there_as_svg_and_png(folder: Path) -> None:
    figures = folder / "report" / "figures"
    names = {file.stem for file in figures.iterdir()}
    assert names == {
        "distances",
        "flight",
        "forces",
        "network",
        "obstacle_distances",
        "packets",
        "slot_errors",
        "snapshots",
        "turns",
    }
    for name in names:
        assert ElementTree.parse(figures / f"{name}.svg").getroot().tag.endswith("svg")
        picture = matplotlib.image.imread(figures / f"{name}.png")
        assert picture.shape[1] == 1380
        assert picture[..., :3].std() > 0.01  # something is drawn


def test_curves_are_the_measured_figures(shown: Shown, run: Run) -> None:
    separation = run.metrics["separation_m"].reshape(-1, 2).min(axis=1)
    curves = [np.asarray(line.get_ydata()) for line in draw_distances(shown).axes[0].lines]
    assert any(np.array_equal(curve, separation, equal_nan=True) for curve in curves)
    forces = draw_forces(shown).axes
    for agent, axes in enumerate(forces):
        own = run.metrics["force"].reshape(-1, 2)[:, agent]
        np.testing.assert_array_equal(axes.lines[-1].get_ydata(), own)
    limits = {float(line.get_ydata()[0]) for line in draw_turns(shown).axes[0].lines[2:4]}  # type: ignore[index]
    assert limits == {-45.0, 45.0}


def test_texts_of_a_figure_keep_their_digits(folder: Path, summary: dict[str, Any]) -> None:
    svg = (folder / "report" / "figures" / "distances.svg").read_text()
    assert f">least: {summary['min_separation_m']:.3f} m at" in svg
    assert not re.search(r' d="[^"]*\.\d{3}', svg)


def test_areas_of_packets_add_up_to_all_that_were_addressed(shown: Shown, run: Run) -> None:
    areas = draw_packets(shown).axes[0].patches
    total = 0.0
    for area in areas:
        if hasattr(area, "get_data"):
            values, edges, baseline = area.get_data()
            total += float(((values - baseline) * np.diff(edges)).sum())
    packets = run.packets
    assert total == pytest.approx(packets["addressed"][-1] - packets["in_flight"][-1])


def test_the_network_is_as_strong_as_its_links(shown: Shown) -> None:
    lambda_2, heard = strength(shown)
    alive = np.array([tick.alive.sum() for tick in shown.run.ticks])
    assert np.isnan(lambda_2[alive < 2]).all()
    assert lambda_2[-1] == 2.0  # both hear each other
    assert heard[-1] == 1.0


def test_snapshots_are_of_start_convergence_faults_and_end(shown: Shown) -> None:
    times_s = moments_s(shown)
    assert times_s == sorted(set(times_s))
    assert len(times_s) == 6
    assert (times_s[0], times_s[-1]) == (0.0, shown.until_s)
    assert shown.phases[0].converge_s in times_s
    assert 2.5 in times_s  # amid the fault


def test_several_runs_stand_side_by_side(
    folder: Path, run: Run, few_figures: list[DrawnFigure], tmp_path: Path
) -> None:
    file = tmp_path / "both.html"
    report([run, run], file, lambda _: None)
    both = Page(file.read_text())
    assert sum(tag == "figure" for tag, _ in both.tags) == 2 * len(few_figures)
    head = [
        unescape(name)
        for name in re.findall(r"<th class=\"number\"><a [^>]*>(.*?)</a>", file.read_text())
    ]
    assert head == [folder.name, folder.name]
    assert both.text.count(folder.name) >= 4  # as the heads of columns and of sections
    assert sorted(each.name for each in (tmp_path / "both-figures").iterdir()) == [
        "0-small",
        "1-small",
    ]


def test_of_many_runs_there_is_a_table(run: Run, tmp_path: Path) -> None:
    report([run] * 7, tmp_path / "seven.html", lambda _: None)
    seven = Page((tmp_path / "seven.html").read_text())
    assert sum(tag == "tr" for tag, _ in seven.tags) == 8
    assert "figure" not in {tag for tag, _ in seven.tags}
    assert not list((tmp_path / "seven-figures").iterdir())


def test_nothing_is_overwritten(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = folder / "report" / "report.html"
    before = file.read_bytes()
    assert command(["report", str(folder)]) == 2
    assert capsys.readouterr().err.endswith(f"{file}: exists; nothing is overwritten\n")
    assert file.read_bytes() == before
    assert command(["report", str(folder), str(folder)]) == 2
    assert "--out" in capsys.readouterr().err


def test_a_cut_off_recording_is_reported_with_what_is_missing(
    folder: Path, few_figures: list[DrawnFigure], tmp_path: Path
) -> None:
    (tmp_path / "run.rrd").write_bytes(cut(folder / "run.rrd", 0.7))
    assert command(["report", str(tmp_path)]) == 0
    page = Page((tmp_path / "report" / "report.html").read_text())
    assert "The recording is cut off: its end was never written." in page.text
    assert "inconclusive" in page.text
    assert sum(tag == "figure" for tag, _ in page.tags) == len(few_figures)


def test_a_run_without_a_tick_is_reported_without_figures(run: Run, tmp_path: Path) -> None:
    empty = Run(tmp_path, replace(run._readback, ticks=[], finished=False), None)
    assert all(table.rows == 0 for name, table in empty.tables.items() if name in EMPTY)
    report([empty], tmp_path / "empty.html", lambda _: None)
    page = Page((tmp_path / "empty.html").read_text())
    assert "It ends at 0 s of 5 s." in page.text
    assert "figure" not in {tag for tag, _ in page.tags}
