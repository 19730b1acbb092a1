"""The commands that make something of a finished run: ``export`` its tables."""

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
