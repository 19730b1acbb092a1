"""Writing a report: the page, and each figure as SVG and PNG beside it."""

from collections.abc import Callable, Sequence
from pathlib import Path
from shutil import rmtree

from worldsim.report.figures import DrawnFigure, drawn_figures
from worldsim.report.page import MAX_DRAWN, page
from worldsim.report.shown import Shown
from worldsim.results.run import Run

PAGE = "report.html"
FIGURES = "figures"
Progress = Callable[[str], None]


class ReportError(Exception):
    """A report cannot be written; one line with the path and the reason."""


def report(runs: Sequence[Run], file: Path, progress: Progress) -> Path:
    """Write the page ``file`` of some runs and their figures, and return the figures' folder.

    The figures of several runs are in a folder each; of many runs none are drawn. progress: gets
    what is being drawn. Raises ReportError where the page or the folder exists, or cannot be
    written.
    """
    folder = file.with_name(FIGURES if file.name == PAGE else f"{file.stem}-{FIGURES}")
    for path in (file, folder):
        if path.exists():
            raise ReportError(f"{path}: exists; nothing is overwritten")
    few = len(runs) <= MAX_DRAWN
    drawn = [(run, _drawn(run, progress) if few else []) for run in runs]
    try:
        folder.mkdir(parents=True)
        try:
            for number, (run, figures) in enumerate(drawn if few else ()):
                own = folder if len(drawn) == 1 else folder / f"{number}-{run.scenario.name}"
                _write(figures, own)
            file.write_text(page(drawn), encoding="utf-8")
        except OSError:
            rmtree(folder, ignore_errors=True)
            raise
    except OSError as error:
        raise ReportError(f"{file}: cannot be written: {error.strerror or error}") from error
    return folder


def _drawn(run: Run, progress: Progress) -> list[DrawnFigure]:
    if not run.ticks:
        return []
    name = run.scenario.name
    progress(f"{name}: judging {len(run.ticks)} ticks")
    shown = Shown(run)
    return list(drawn_figures(shown, lambda title: progress(f"{name}: drawing {title}")))


def _write(figures: Sequence[DrawnFigure], folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for figure in figures:
        (folder / f"{figure.name}.svg").write_text(figure.svg, encoding="utf-8")
        (folder / f"{figure.name}.png").write_bytes(figure.png)
