"""The code of a user's controller, as a hash: a sweep must not go on with another one."""

import hashlib
import shutil
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path


def code_sha256(name: str, command: Sequence[str] | None) -> str:
    """Return the hash of the files of a controller's top-level package, or of its program.

    name: "package.module:Class". command: of a controller that is a program; its arguments that
    name files count too. "" where no file is found.
    """
    digest = hashlib.sha256()
    files = _programs(command) if command is not None else _sources(name)
    for file in sorted(files):
        digest.update(file.name.encode("utf-8") + b"\0" + file.read_bytes())
    return digest.hexdigest() if files else ""


def _programs(command: Sequence[str]) -> list[Path]:
    named = [shutil.which(command[0]) or command[0], *command[1:]]
    return [path for path in map(Path, named) if path.is_file()]


def _sources(name: str) -> list[Path]:
    """Return the Python files of the top-level package, which is found but not imported."""
    try:
        spec = find_spec(name.partition(":")[0].partition(".")[0])
    except (ImportError, ValueError):
        return []
    if spec is None:
        return []
    folders = spec.submodule_search_locations
    if folders is not None:
        return [file for folder in folders for file in Path(folder).rglob("*.py")]
    return [Path(spec.origin)] if spec.origin and Path(spec.origin).is_file() else []
