"""The commands that make something of finished runs: a page, pictures, a film, tables."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from worldsim.commands.options import complain, examples
from worldsim.results.exit_status import BAD_INPUT, PASS

if TYPE_CHECKING:
    from collections.abc import Callable

    from worldsim.export.export import Format
    from worldsim.report.shown import Shown
    from worldsim.results.progress_line import ProgressLine

commands = typer.Typer()
REPORTED = (
    "report takes runs, folders of runs, the folder of a sweep, or that of a finding of"
    " `qswarm fuzz`"
)
RecordedRun = Annotated[
    Path, typer.Argument(metavar="RUN", help="The output directory of a run, or its recording.")
]


@commands.command(
    epilog=examples(
        "qswarm export runs/mine --parquet",
        "qswarm export runs/mine --csv --mcap --out tables",
        "python -c \"import pandas; pandas.read_parquet('runs/mine/export/poses.parquet').info()\"",
    )
)
def export(
    run: RecordedRun,
    parquet: Annotated[
        bool, typer.Option("--parquet", help="A Parquet file for each table (the default).")
    ] = False,
    csv: Annotated[bool, typer.Option("--csv", help="A CSV file for each table.")] = False,
    mcap: Annotated[
        bool, typer.Option("--mcap", help="One MCAP file to open in Foxglove.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Output directory.", show_default="RUN/export"),
    ] = None,
) -> int:
    """Write a run's tables into files for pandas, polars, a spreadsheet or Foxglove.

    Tables: agents, poses, targets, places, links, events, metrics, packets. Every column has its
    unit in its name; docs/results.md describes each.
    """
    from worldsim.export.export import ExportError
    from worldsim.export.export import export as write
    from worldsim.recording.readback import RecordingError
    from worldsim.results.run import open as open_run

    chosen: dict[Format, bool] = {"parquet": parquet, "csv": csv, "mcap": mcap}
    formats: list[Format] = [name for name, wanted in chosen.items() if wanted] or ["parquet"]
    folder = _beside(run) / "export"
    try:
        opened = open_run(run)
        files = write(opened, formats, out or folder)
    except (RecordingError, ExportError) as error:
        complain(" ".join(str(error).splitlines()))
        return BAD_INPUT
    for note in opened.notes:
        complain(f"{run}: {note}")
    print("\n".join(map(str, files)))
    return PASS


@commands.command(
    epilog=examples(
        "qswarm report runs/mine",
        "qswarm report runs/mine runs/theirs --out both.html",
        "qswarm report runs/twenty --out twenty.html    # a folder of many runs",
        "qswarm report runs/radio    # the folder of a sweep: curves, maps, where it breaks",
        "qswarm report runs/lf/findings/reform-3    # what a search found, and its cause",
    )
)
def report(
    runs: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN",
            help="Run directories, directories of many runs, or recordings; or one directory of"
            " a sweep, or of a finding of `qswarm fuzz`.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.html",
            help="The page; its figures go into a folder beside it.",
            show_default="RUN/report/report.html",
        ),
    ] = None,
) -> int:
    """Write a page about a run, with the figures of the paper as SVG and PNG.

    Expectations with their margins, forces, distances, turns, packets, the network, faults and
    provenance. The page is one file that loads nothing, to keep or to send. Several runs stand side
    by side. Every figure is computed from the recording and compared with summary.json.

    Of a sweep the page holds its curves and maps, where it breaks, and the table of its cells; of a
    finding its explanation, its margins over time, its scenario, and the reports of runs in it.
    """
    special = [each for each in map(_special, runs) if each is not None]
    if len(runs) == 1 and special:
        return _report_special(special[0], runs[0], out)
    if special:
        raise typer.BadParameter("a sweep or a finding is reported alone", param_hint="RUN")
    return _report_runs(runs, out)


class _Special(NamedTuple):
    """How to report a folder that is none of runs."""

    write: "Callable[[Path, Path, Callable[[str], None]], Path]"


def _special(folder: Path) -> _Special | None:
    """Return how to report the folder of a sweep or of a finding; None for any other path."""
    from worldsim.fuzz.finding_page import is_finding, report_finding
    from worldsim.sweep.journal import is_sweep
    from worldsim.sweep.sweep_page import report_sweep

    if is_sweep(folder):
        return _Special(report_sweep)
    return _Special(report_finding) if is_finding(folder) else None


def _report_special(special: _Special, folder: Path, out: Path | None) -> int:
    """Write the page of a sweep or of a finding."""
    from worldsim.recording.readback import RecordingError
    from worldsim.report.report import PAGE, ReportError
    from worldsim.results.progress_line import ProgressLine
    from worldsim.results.run_folder import RunDirectoryError
    from worldsim.scenario.toml import ScenarioError

    progress, page = ProgressLine(), out or folder / "report" / PAGE
    try:
        figures = special.write(folder, page, progress.update)
    except (RunDirectoryError, ScenarioError, RecordingError, ReportError) as error:
        progress.clear()
        complain(" ".join(str(error).splitlines()))
        return BAD_INPUT
    progress.clear()
    print(f"{page}\n{figures}/")
    return PASS


def _report_runs(runs: list[Path], out: Path | None) -> int:
    """Write the page of some runs."""
    from worldsim.fuzz.finding_page import search_hint
    from worldsim.recording.readback import RecordingError
    from worldsim.recording.viewer import ViewerError, recordings
    from worldsim.report.report import PAGE, ReportError
    from worldsim.report.report import report as write
    from worldsim.results.progress_line import ProgressLine
    from worldsim.results.run import open as open_run

    try:
        found = [_folder_of(recording) for recording in recordings(runs)]
    except ViewerError as error:
        hint = next((hint for hint in map(search_hint, runs) if hint is not None), None)
        complain(hint or f"{error}; {REPORTED}")
        return BAD_INPUT
    if len(found) > 1 and out is None:
        raise typer.BadParameter("several runs need a file to write to", param_hint="--out")
    progress = ProgressLine()
    try:
        opened = []
        for run in found:
            progress.update(f"reading {run}")
            opened.append(open_run(run))
        page = out or _beside(found[0]) / "report" / PAGE
        figures = write(opened, page, progress.update)
    except (RecordingError, ReportError) as error:
        progress.clear()
        complain(" ".join(str(error).splitlines()))
        return BAD_INPUT
    progress.clear()
    for each in opened:
        for note in each.notes:
            complain(f"{each.path}: {note}")
    print(f"{page}\n{figures}/")
    return PASS


@commands.command(
    epilog=examples(
        "qswarm picture runs/mine",
        "qswarm picture runs/mine --at 3,10,20 --out stills",
    )
)
def picture(
    run: RecordedRun,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="T,T,...",
            help="Simulated times [s].",
            show_default="up to 9: start, convergence, changes, faults, joins, end",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Output directory.", show_default="RUN/pictures"),
    ] = None,
) -> int:
    """Draw stills of a run (PNG): in 3D, from above and from the side. No display is needed.

    Vehicles with names and trails in the colours of their queues, slots, links and obstacles.
    """
    from worldsim.report.stills import write_stills

    def write(shown: "Shown", progress: "ProgressLine") -> list[Path]:
        times_s = _times_of(at, shown.until_s) if at is not None else []
        return write_stills(shown, times_s, folder, progress.update)

    folder = out or _beside(run) / "pictures"
    return _draw(run, folder, write)


@commands.command(
    epilog=examples(
        "qswarm video runs/mine",
        "qswarm video runs/mine --speed 4 --out mine.gif",
        "pip install 'qswarm[video]'    # for .mp4, where there is no ffmpeg",
    )
)
def video(
    run: RecordedRun,
    speed: Annotated[
        float | None,
        typer.Option(
            metavar="X",
            min=0.1,
            max=1000.0,
            help="Simulated seconds in a second of the film.",
            show_default="1, or what fits into 20 s",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="The film, .mp4 (needs ffmpeg, or qswarm[video]) or .gif.",
            show_default="RUN/video.mp4; .gif without ffmpeg",
        ),
    ] = None,
) -> int:
    """Draw a film of a run: its stills, ten in a second. No display is needed."""
    from worldsim.report.film import default_speed, film_suffix, write_film

    def write(shown: "Shown", progress: "ProgressLine") -> list[Path]:
        write_film(shown, file, speed or default_speed(shown), progress.update)
        return [file]

    file = out or _beside(run) / f"video{film_suffix()}"
    return _draw(run, file, write)


def _draw(run: Path, out: Path, write: "Callable[[Shown, ProgressLine], list[Path]]") -> int:
    """Draw something of a run into a file or folder that must not exist, and print the files."""
    from worldsim.recording.readback import RecordingError
    from worldsim.report.film import FilmError
    from worldsim.report.shown import Shown
    from worldsim.results.progress_line import ProgressLine
    from worldsim.results.run import open as open_run

    progress = ProgressLine()
    try:
        if out.exists():
            raise FilmError(f"{out}: exists; nothing is overwritten")
        progress.update(f"reading {run}")
        opened = open_run(run)
        if not opened.ticks:
            raise FilmError(f"{run}: the recording holds no tick")
        files = write(Shown(opened), progress)
    except (RecordingError, FilmError) as error:
        complain(" ".join(str(error).splitlines()))
        return BAD_INPUT
    except OSError as error:
        complain(f"{out}: cannot be written: {error.strerror or error}")
        return BAD_INPUT
    finally:
        progress.clear()
    for note in opened.notes:
        complain(f"{run}: {note}")
    print("\n".join(map(str, files)))
    return PASS


def _times_of(text: str, until_s: float) -> list[float]:
    """Return the times [s] of a text such as 3,10,20. Raises typer.BadParameter."""
    try:
        times_s = [float(part) for part in text.split(",")]
    except ValueError:
        times_s = []
    if not times_s or not all(0.0 <= time_s <= until_s for time_s in times_s):
        detail = f"{text!r}; write times from 0 to {until_s:g} s, as 3,10,20"
        raise typer.BadParameter(detail, param_hint="--at")
    return times_s


def _beside(run: Path) -> Path:
    """Return the folder of a run, which may be given by its recording."""
    return run if run.is_dir() else run.parent


def _folder_of(recording: Path) -> Path:
    """Return the run folder that a recording is in; the recording where it is in none."""
    from worldsim.recording.layout import RECORDING_FILE

    return recording.parent if recording.name == RECORDING_FILE else recording
