"""The code of users' controllers, as hashes: flights of one sweep must have the same."""

import hashlib
import shutil
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from agent.controller import BUILT_IN
from worldsim.scenario.tables import Scenario


class UserController(NamedTuple):
    """A controller that is not built in."""

    name: str  # as in the scenario: "package.module:Class", or that of a command
    command: tuple[str, ...] | None  # the program, where it is one

    def __str__(self) -> str:
        return " ".join(self.command or (self.name,))


def user_controllers(scenarios: Iterable[Scenario]) -> list[UserController]:
    """Return the controllers of some scenarios that are not built in, each once."""
    controls = (scenario.control for scenario in scenarios)
    found = {
        UserController(control.controller, tuple(control.command) if control.command else None)
        for control in controls
        if control.controller not in BUILT_IN
    }
    return sorted(found, key=str)


def code_sha256(name: str, command: Sequence[str] | None, folder: str = "") -> str:
    """Return the hash of the files of a controller's top-level package, or of its program.

    name: "package.module:Class". command: of a controller that is a program; its arguments that
    name files count too. folder: where the package may be beside the import path. "" where no file
    is found.
    """
    digest = hashlib.sha256()
    files = _programs(command) if command is not None else _sources(name, folder)
    for file in sorted(files):
        digest.update(file.name.encode("utf-8") + b"\0" + file.read_bytes())
    return digest.hexdigest() if files else ""


def _programs(command: Sequence[str]) -> list[Path]:
    named = [shutil.which(command[0]) or command[0], *command[1:]]
    return [path for path in map(Path, named) if path.is_file()]


def _sources(name: str, folder: str) -> list[Path]:
    """Return the Python files of the top-level package, which is found but not imported."""
    top = name.partition(":")[0].partition(".")[0]
    try:
        spec = find_spec(top)
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        return _below(Path(folder) / top) or _below(Path(folder) / f"{top}.py") if folder else []
    if spec.submodule_search_locations is not None:
        return [file for each in spec.submodule_search_locations for file in _below(Path(each))]
    return _below(Path(spec.origin or ""))


def _below(path: Path) -> list[Path]:
    """Return a file, or the Python files in a folder."""
    return list(path.rglob("*.py")) if path.is_dir() else [path] if path.is_file() else []
