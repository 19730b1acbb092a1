"""Writing a report: the page, and each figure as SVG and PNG beside it."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from shutil import rmtree

from worldsim.report.figures import drawn_figures
from worldsim.report.page import MAX_DRAWN, page
from worldsim.report.page_parts import DrawnFigure
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
    refuse_existing(file)
    few = len(runs) <= MAX_DRAWN
    drawn = [(run, drawn_of(run, progress) if few else []) for run in runs]
    own = {f"{number}-{run.scenario.name}": each for number, (run, each) in enumerate(drawn)}
    figures = {"": drawn[0][1]} if len(runs) == 1 else own if few else {}
    return write(file, page(drawn), figures)


def refuse_existing(file: Path) -> None:
    """Raise ReportError where a page, or the folder of its figures, exists."""
    for path in (file, _folder_of(file)):
        if path.exists():
            raise ReportError(f"{path}: exists; nothing is overwritten")


def write(file: Path, text: str, figures: Mapping[str, Sequence[DrawnFigure]]) -> Path:
    """Write a page and its figures beside it; return the figures' folder.

    figures: by the folder below it, "" for itself. Raises ReportError.
    """
    refuse_existing(file)
    folder = _folder_of(file)
    try:
        folder.mkdir(parents=True)
        try:
            for name, some in figures.items():
                _write(some, folder / name)
            file.write_text(text, encoding="utf-8")
        except OSError:
            rmtree(folder, ignore_errors=True)
            raise
    except OSError as error:
        raise ReportError(f"{file}: cannot be written: {error.strerror or error}") from error
    return folder


def _folder_of(file: Path) -> Path:
    """Return the folder of a page's figures."""
    return file.with_name(FIGURES if file.name == PAGE else f"{file.stem}-{FIGURES}")


def drawn_of(run: Run, progress: Progress) -> list[DrawnFigure]:
    """Return the figures of a run; none of one without a tick."""
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
