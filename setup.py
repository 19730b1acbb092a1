"""Adds to a wheel what pyproject.toml cannot declare: the library, and the source's commit.

The scenarios and formations are in ``deploy`` of the checkout, once. A wheel holds a copy beside
the code, in ``worldsim/library``; an editable install uses ``deploy`` itself.

``python setup.py compile`` compiles the modules of ``[tool.qswarm]`` in pyproject.toml into
``build/compiled``; ``netem/compiled.py`` says when they run. It needs a C compiler, mypy and what
qswarm itself needs.

    QSWARM_COMPILED=1 pip wheel . --no-deps --no-build-isolation

makes a wheel that holds them too, for this Python on this platform.
"""

import json
import shutil
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from importlib import import_module
from os import cpu_count, environ
from pathlib import Path
from re import MULTILINE, findall
from sysconfig import get_config_var
from typing import Any, ClassVar

from setuptools import Command, Distribution, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
sys.path.insert(0, str(ROOT))  # absent in an isolated build

from netem.compiled import (  # noqa: E402
    FOLDER,
    IN_WHEEL,
    MANIFEST,
    UnfitError,
    digest_of,
    fitting,
)
from worldsim.results.provenance import RECORDED, commit_of  # noqa: E402

PACKAGES = ("netem", "agent", "worldsim")
WANTED = environ.get("QSWARM_COMPILED", "0")
"""Whether a wheel is to be compiled: no ("0" or ""), or yes."""


class BuildWhole(build_py):
    """Builds the packages into an empty folder, with the library and the commit."""

    def run(self) -> None:
        """Build; an editable install needs nothing more than the packages."""
        if self.editable_mode:
            super().run()
            return
        # Modules that were removed since an earlier build must not get into the wheel.
        shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()
        built = Path(self.build_lib)
        for kind in ("scenarios", "formations"):
            shutil.copytree(ROOT / "deploy" / kind, built / "worldsim" / "library" / kind)
        (built / RECORDED).write_text(json.dumps(commit_of(ROOT)._asdict()) + "\n", "utf-8")
        if self.distribution.has_ext_modules():
            _compile(built / IN_WHEEL.relative_to(ROOT))


class BuildObjects(build_ext):
    """Compiles C files on all cores, and only those that changed since they were last compiled."""

    def build_extensions(self) -> None:
        """Build the extensions."""
        compile_serially = self.compiler.compile

        def compile_objects(sources: list[str], output_dir: str, **options: Any) -> list[str]:
            objects = self.compiler.object_filenames(sources, output_dir=output_dir)
            made = dict(zip(sources, objects, strict=True))
            changed = [each for each in sources if _is_older(Path(made[each]), Path(each))]
            with ThreadPoolExecutor(cpu_count()) as pool:
                jobs = [
                    pool.submit(compile_serially, [each], output_dir=output_dir, **options)
                    for each in changed
                ]
                for job in jobs:
                    job.result()
            return objects

        self.compiler.compile = compile_objects
        super().build_extensions()


def _is_older(made: Path, source: Path) -> bool:
    """Whether a C file, or a header beside it that it needs, changed since an object was made."""
    if not made.exists():
        return True
    made_s, seen, waiting = made.stat().st_mtime, set[Path](), [source]
    while waiting:
        file = waiting.pop()
        if file in seen or not file.exists():
            continue
        if file.stat().st_mtime > made_s:
            return True
        seen.add(file)
        included = findall(r'^#include "([^"]+)"', file.read_text("utf-8"), MULTILINE)
        waiting += [file.parent / each for each in included]
    return False


class WheelDistribution(Distribution):
    """The wheel is for one platform only if it holds compiled modules."""

    def has_ext_modules(self) -> bool:
        """Return whether it does."""
        return WANTED not in {"", "0"}


class Compile(Command):
    """Compiles the hot modules for this checkout."""

    description = "compile the hot modules into build/compiled"
    user_options: ClassVar[list[tuple[str, str | None, str]]] = []

    def initialize_options(self) -> None:
        """There are none."""

    def finalize_options(self) -> None:
        """There are none."""

    def run(self) -> None:
        """Compile."""
        _compile(FOLDER)


def _compile(folder: Path) -> None:
    """Compile the hot modules into a folder; the manifest comes last.

    What was compiled there before stays away if this ends early. A wheel takes what is compiled in
    this checkout, if the same compilers made it of the same files.
    """
    inputs = _digest_of_inputs()
    if folder != FOLDER and _inputs_of(FOLDER) == inputs:
        shutil.copytree(FOLDER, folder)
        return
    try:
        mypycify = import_module("mypyc.build").mypycify  # nothing else needs it
    except ImportError as error:
        raise SystemExit(f"compiling needs mypy ({error}); see docs/bench.md") from error
    sources = _hot_modules()
    before = {name: digest_of(ROOT / name) for name in sources}
    shutil.rmtree(folder, ignore_errors=True)
    extensions = mypycify(
        sources,
        opt_level="1",  # 1 is as fast as 2, and built in two thirds of the time
        debug_level="0",
        multi_file=True,
        group_name="qswarm",
        target_dir=str(ROOT / "build" / "mypyc"),
    )
    if sys.platform == "linux":
        for each in extensions:
            # Calls between modules go straight to their function: some 5 % faster.
            each.extra_link_args.append("-Wl,-Bsymbolic")
    library = Distribution({"ext_modules": extensions, "cmdclass": {"build_ext": BuildObjects}})
    built = library.get_command_obj("build_ext")
    built.build_lib = str(folder)
    built.build_temp = str(_folder_of_objects())
    built.ensure_finalized()
    built.run()
    files = {each.name: str(Path(built.get_ext_filename(each.name))) for each in extensions}
    manifest = {"abi": get_config_var("SOABI"), "sources": before, "extensions": files}
    manifest["inputs"] = inputs
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n", "utf-8")


def _folder_of_objects() -> Path:
    """Return the folder of objects that these compilers made in this way; remove all others."""
    kind = sha256(_compilers()).hexdigest()[:16]
    objects = ROOT / "build" / "objects"
    for other in {*objects.glob("*")} - {objects / kind}:
        shutil.rmtree(other)
    return objects / kind


def _compilers() -> bytes:
    """Return what says which compilers are used, and how."""
    mypy = import_module("mypy.version").__version__
    made_by = [get_config_var("SOABI"), mypy, environ.get("CC"), environ.get("CFLAGS")]
    return repr(made_by).encode() + Path(__file__).read_bytes()


def _digest_of_inputs() -> str | None:
    """Return the digest of all that compiled modules depend on, None without the compilers.

    The types in modules that are not compiled are a part of it.
    """
    try:
        digest = sha256(_compilers())
    except ImportError:
        return None
    code = (file for name in PACKAGES for file in (ROOT / name).rglob("*.py"))
    for file in sorted([*code, ROOT / "pyproject.toml"]):
        content = file.read_bytes()
        digest.update(f"{file.relative_to(ROOT)} {len(content)} ".encode() + content)
    return digest.hexdigest()


def _inputs_of(folder: Path) -> str:
    """Return the digest of what the modules in a folder were compiled of, "" where none are."""
    try:
        fitting(ROOT, folder)
        found = json.loads((folder / MANIFEST).read_text("utf-8"))["inputs"]
    except (OSError, UnfitError, KeyError):
        return ""
    return str(found)


def _hot_modules() -> list[str]:
    """Return the files of ``[tool.qswarm]``, relative to the root."""
    hot = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["qswarm"]
    found = {str(file.relative_to(ROOT)) for each in hot["compiled"] for file in ROOT.glob(each)}
    return sorted(name for name in found - {*hot["pure"]} if not name.endswith("__init__.py"))


setup(distclass=WheelDistribution, cmdclass={"build_py": BuildWhole, "compile": Compile})
