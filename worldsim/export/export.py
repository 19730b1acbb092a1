"""Exporting a run: every table in the formats that are asked for, into a folder.

Files are written into a draft folder first, so that an interrupted export leaves none behind.
"""

from collections.abc import Collection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

from worldsim.export.mcap_file import MissingPackageError, write_mcap
from worldsim.export.table_files import write_csv, write_parquet
from worldsim.results.run import Run

Format = Literal["parquet", "csv", "mcap"]
MCAP_FILE = "run.mcap"


class ExportError(Exception):
    """A run cannot be exported; one line with the path and the reason."""


def export(run: Run, formats: Collection[Format], out: Path) -> list[Path]:
    """Write a run's tables into the folder ``out``, and return the files.

    Raises ExportError where a file exists, cannot be written, or needs a package that is missing.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=out, prefix=".draft-") as draft:
            _write(run, formats, Path(draft))
            files = sorted(Path(draft).iterdir())
            taken = [out / file.name for file in files if (out / file.name).exists()]
            if taken:
                raise ExportError(f"{taken[0]}: exists; nothing is overwritten")
            return [file.rename(out / file.name) for file in files]
    except MissingPackageError as error:
        raise ExportError(str(error)) from error
    except OSError as error:
        raise ExportError(f"{out}: cannot be written: {error.strerror or error}") from error


def _write(run: Run, formats: Collection[Format], folder: Path) -> None:
    tables = run.tables.values()
    if "parquet" in formats:
        write_parquet(tables, folder)
    if "csv" in formats:
        write_csv(tables, folder)
    if "mcap" in formats:
        write_mcap(run, folder / MCAP_FILE)
