"""The commands that make something of finished runs: ``report`` a page, ``export`` tables."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from worldsim.commands.options import complain, examples
from worldsim.results.exit_status import BAD_INPUT, PASS

if TYPE_CHECKING:
    from worldsim.export.export import Format

commands = typer.Typer()
RecordedRun = Annotated[
    Path, typer.Argument(metavar="RUN", help="The output directory of a run, or its recording.")
]


@commands.command(
    epilog=examples(
        "qswarm export runs/mine --parquet",
        "qswarm export runs/mine --csv --mcap --out /tmp/mine",
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
    folder = (run if run.is_dir() else run.parent) / "export"
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
    )
)
def report(
    runs: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN", help="Run directories, directories of many runs, or recordings."
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
    """
    from worldsim.recording.readback import RecordingError
    from worldsim.recording.viewer import recordings
    from worldsim.report.report import PAGE, ReportError
    from worldsim.report.report import report as write
    from worldsim.results.progress_line import ProgressLine
    from worldsim.results.run import open as open_run

    found = [_folder_of(recording) for recording in recordings(runs)]
    if len(found) > 1 and out is None:
        raise typer.BadParameter("several runs need a file to write to", param_hint="--out")
    progress = ProgressLine()
    try:
        opened = []
        for run in found:
            progress.update(f"reading {run}")
            opened.append(open_run(run))
        folder = found[0] if found[0].is_dir() else found[0].parent
        page = out or folder / "report" / PAGE
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


def _folder_of(recording: Path) -> Path:
    """Return the run folder that a recording is in; the recording where it is in none."""
    from worldsim.recording.layout import RECORDING_FILE

    return recording.parent if recording.name == RECORDING_FILE else recording
