"""Compiled modules: they run instead of the pure ones for as long as they match them.

``deploy/compile.sh`` compiles what is hot, into ``build/compiled`` beside the packages, and writes
a manifest last; a compiled wheel holds the same in a folder of its own. The compiled modules run
only if the manifest fits this Python and every source file: after an edit, or half a build, pure
Python runs, and before the first flight a line says why. It is never a mixture.
QSWARM_PURE=1 asks for pure Python.

This module comes before all others, so it imports none of them.
"""

import json
import os
import sys
from collections.abc import Mapping, Sequence
from hashlib import sha256
from importlib.abc import MetaPathFinder
from importlib.machinery import ExtensionFileLoader, ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from sysconfig import get_config_var
from types import ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
IN_WHEEL = Path(__file__).with_name("compiled_modules")
"""Where a compiled wheel holds them."""
FOLDER = IN_WHEEL if IN_WHEEL.is_dir() else ROOT / "build" / "compiled"
MANIFEST = "manifest.json"
PURE = "QSWARM_PURE"
"""The environment variable that asks for pure Python, here and in processes begun from here."""
REMEDY = "deploy/compile.sh compiles anew"
UNTOLD: dict[int, str] = {}
"""Why pure Python runs though there is compiled code, by the id of the process that has not yet
told it. What is forked from there does not tell it."""


class UnfitError(ValueError):
    """Compiled modules that must not run; the text says why."""


class UnloadableError(SystemExit):
    """Ends the process with status 2: a person has been told why. Nobody may go on from it."""

    def __init__(self) -> None:
        super().__init__(2)


class _Loader(ExtensionFileLoader):
    """Ends the process where a compiled module cannot be loaded: others run compiled by then."""

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        try:
            return super().create_module(spec)
        except ImportError as error:
            if error.path != self.path:
                raise  # something else that the module imports
            remedy = f"{REMEDY}, and {PURE}=1 runs pure Python"
            print(f"qswarm: compiled code cannot be loaded: {error}; {remedy}.", file=sys.stderr)
            raise UnloadableError from error


class Finder(MetaPathFinder):
    """Finds compiled modules. files: the extension of each module, by its name."""

    def __init__(self, files: Mapping[str, Path]) -> None:
        self._files = files

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of a compiled module, None for any other."""
        file = self._files.get(fullname)
        if file is None:
            return None
        return spec_from_file_location(fullname, file, loader=_Loader(fullname, str(file)))


def fitting(root: Path, folder: Path) -> dict[str, Path]:
    """Return the extension of each compiled module by its name; nothing where none was compiled.

    Raises :class:`UnfitError` if one of them does not fit.
    """
    if not folder.is_dir():
        return {}
    manifest = _read(folder / MANIFEST)
    if manifest.get("abi") != get_config_var("SOABI"):
        raise UnfitError(f"it was compiled for {manifest.get('abi')}")
    for source, digest in manifest["sources"].items():
        if digest_of(root / source) != digest:
            raise UnfitError(f"{source} has changed since")
    files = {name: folder / file for name, file in manifest["extensions"].items()}
    for file in files.values():
        if not file.is_file():
            raise UnfitError(f"{file.name} is missing")
    return files


def digest_of(source: Path) -> str | None:
    """Return the digest of a source file, None where there is none."""
    try:
        return sha256(source.read_bytes()).hexdigest()
    except OSError:
        return None


def _read(file: Path) -> dict[str, Any]:
    try:
        found = json.loads(file.read_text("utf-8"))
        if not {"abi", "sources", "extensions"} <= found.keys():
            raise UnfitError(f"{file.name} names no sources")
        if not found["extensions"] or not all(
            isinstance(name, str)
            for key in ("sources", "extensions")
            for name in found[key].values()
        ):
            raise UnfitError(f"{file.name} names no files")
    except (OSError, ValueError, AttributeError) as error:
        raise UnfitError(f"the build is unfinished ({error})") from error
    return found  # type: ignore[no-any-return]


def is_preferred() -> bool:
    """Return whether compiled modules run, where there are any of these."""
    return any(isinstance(each, Finder) for each in sys.meta_path)


def prefer() -> None:
    """Import compiled modules from now on, if they fit; the packages call it before all else."""
    if os.environ.get(PURE, "0") not in {"", "0"} or is_preferred():
        return
    try:
        files = fitting(ROOT, FOLDER)
    except UnfitError as error:
        os.environ[PURE] = "1"  # the processes begun from here need not say it again
        UNTOLD[os.getpid()] = f"pure Python runs, not the compiled code: {error}. {REMEDY}."
        return
    if files:
        sys.meta_path.insert(0, Finder(files))


def tell_if_unfit() -> None:
    """Say once on stderr why pure Python runs though there is compiled code.

    Whatever flies calls it before: there it costs time, which nothing else does.
    """
    text = UNTOLD.pop(os.getpid(), None)
    if text is not None:
        print(f"qswarm: {text}", file=sys.stderr, flush=True)
