"""The library: the scenarios and formations that belong to qswarm, found by name.

In a checkout they are in ``deploy``; a wheel holds a copy beside the code, in ``worldsim/library``.
"""

import os
import re
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

from worldsim.scenario.toml import ScenarioError, read

_PACKAGE = Path(__file__).resolve().parents[1]
_IN_WHEEL = _PACKAGE / "library"
LIBRARY = _IN_WHEEL if _IN_WHEEL.is_dir() else _PACKAGE.parent / "deploy"
SCENARIOS = LIBRARY / "scenarios"
FORMATIONS = LIBRARY / "formations"
CLOSEST = 3
"""How many names an error suggests at most."""


class Entry(NamedTuple):
    """A scenario of the library: its name, its file, and what it shows, in one line."""

    name: str
    file: Path
    shows: str


def scenarios(folder: Path = SCENARIOS) -> list[Entry]:
    """Return the scenarios of the library by name. Raises ScenarioError if there are none."""
    files = _files(folder)
    if not files:
        raise ScenarioError(folder, "", "the library's scenarios are missing; install qswarm again")
    return [Entry(name, file, _first_comment(read(file))) for name, file in files.items()]


def find_scenario(given: str) -> Path:
    """Return the file of a scenario that is given by its path, or by its name in the library.

    An existing file wins over a name. Raises ScenarioError for a name that does not exist.
    """
    return _find(given, SCENARIOS, "scenario", "qswarm run --list shows all")


def find_formation(given: str) -> Path:
    """Return the file of a formation that is given by its path, or by its name in the library."""
    return _find(given, FORMATIONS, "formation", f"they are in {_shown(FORMATIONS)}")


def formation_from(folder: Path, given: str) -> Path:
    """Return the file of a formation that a file in ``folder`` names, by path or library name.

    An existing file wins over a name. Raises FileNotFoundError with the reason, in words.
    """
    path, files = folder / given, _files(FORMATIONS)
    if _is_file(path):
        return path
    if given in files:
        return files[given]
    close = _closest(path.stem, files)
    hint = f"they are in {_shown(FORMATIONS)}"
    detail = f"no such file: {path}, and no such formation in the library; {close}{hint}"
    raise FileNotFoundError(detail)


def _find(given: str, folder: Path, what: str, hint: str) -> Path:
    path, files = Path(given), _files(folder)
    if _readable(path):
        return path
    if given in files:
        return _shown(files[given])
    if path.name == given and path.suffix != ".toml":
        detail = f"no such file, and no such {what} in the library; {_closest(given, files)}{hint}"
        raise ScenarioError(given, "", detail)
    if path.stem in files and not path.exists():
        raise ScenarioError(path, "", f"no such file; the library has {path.stem!r}")
    return path  # reading it fails with the reason


def _readable(path: Path) -> bool:
    try:
        return path.exists() and not path.is_dir()
    except OSError:
        return True  # reading it fails with the reason


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False


def _closest(name: str, files: dict[str, Path]) -> str:
    """Return the names that are similar to a name, most similar first, as part of an error."""
    close = get_close_matches(name, files, n=CLOSEST)
    return f"closest: {', '.join(close)}; " if close else ""


def _files(folder: Path) -> dict[str, Path]:
    return {file.stem: file for file in sorted(folder.rglob("*.toml"), key=_by_number)}


def _by_number(file: Path) -> list[tuple[int, str]]:
    """Return a key that sorts the numbers in names by their size: wedge-9 before wedge-20."""
    parts = re.split(r"([0-9]+)", file.stem)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]


def _shown(path: Path) -> Path:
    """Return a path relative to the current folder if it is below it, for messages."""
    relative = os.path.relpath(path)
    return path if relative.startswith(os.pardir) else Path(relative)


def _first_comment(text: str) -> str:
    comments = (line.removeprefix("#") for line in text.splitlines() if line.startswith("#"))
    return next(comments, "").strip()
