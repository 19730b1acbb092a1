"""The scenarios that come along with a checkout, each with its one line."""

import os
from pathlib import Path
from typing import NamedTuple

from worldsim.scenario.toml import ScenarioError, read

FOLDER = Path(__file__).parents[2] / "deploy" / "scenarios"


class Piece(NamedTuple):
    """A scenario of the gallery: its file, as seen from here, and what it shows."""

    file: Path
    shows: str


def gallery(folder: Path = FOLDER) -> list[Piece]:
    """Return all scenarios that come along. Raises ScenarioError where there are none."""
    files = sorted(folder.rglob("*.toml"))
    if not files:
        raise ScenarioError(folder, "", "no scenarios here: the gallery belongs to a checkout")
    return [Piece(Path(os.path.relpath(file)), _first_comment(read(file))) for file in files]


def _first_comment(text: str) -> str:
    comments = (line.removeprefix("#") for line in text.splitlines() if line.startswith("#"))
    return next(comments, "").strip()
