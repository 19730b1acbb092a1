"""Adds to a wheel what pyproject.toml cannot declare: the library, and the source's commit.

The scenarios and formations are in ``deploy`` of the checkout, once. A wheel holds a copy beside
the code, in ``worldsim/library``; an editable install uses ``deploy`` itself.

``python setup.py compile`` compiles the modules of ``[tool.qswarm]`` in pyproject.toml into
``build/compiled``; ``netem/compiled.py`` says when they run. It needs a C compiler and mypy.
"""

import json
import shutil
import sys
import tomllib
from importlib import import_module
from pathlib import Path
from sysconfig import get_config_var
from typing import ClassVar

from setuptools import Command, Distribution, setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
sys.path.insert(0, str(ROOT))  # absent in an isolated build

from netem.compiled import FOLDER, MANIFEST, digest_of  # noqa: E402
from worldsim.results.provenance import RECORDED, commit_of  # noqa: E402


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


class Compile(Command):
    """Compiles the hot modules beside the packages; the manifest comes last."""

    description = "compile the hot modules into build/compiled"
    user_options: ClassVar[list[tuple[str, str | None, str]]] = []

    def initialize_options(self) -> None:
        """There are none."""

    def finalize_options(self) -> None:
        """There are none."""

    def run(self) -> None:
        """Compile; what was compiled before stays away if this ends early."""
        mypycify = import_module("mypyc.build").mypycify  # only this command needs it
        sources = _hot_modules()
        before = {name: digest_of(ROOT / name) for name in sources}
        shutil.rmtree(FOLDER, ignore_errors=True)
        extensions = mypycify(
            sources,
            opt_level="2",
            debug_level="0",
            multi_file=True,
            group_name="qswarm",
            target_dir=str(ROOT / "build" / "mypyc"),
        )
        built = Distribution({"ext_modules": extensions}).get_command_obj("build_ext")
        built.build_lib, built.build_temp = str(FOLDER), str(ROOT / "build" / "objects")
        built.ensure_finalized()
        built.run()
        files = {each.name: str(Path(built.get_ext_filename(each.name))) for each in extensions}
        manifest = {"abi": get_config_var("SOABI"), "sources": before, "extensions": files}
        (FOLDER / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n", "utf-8")


def _hot_modules() -> list[str]:
    """Return the files of ``[tool.qswarm]``, relative to the root."""
    hot = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["qswarm"]
    found = {str(file.relative_to(ROOT)) for each in hot["compiled"] for file in ROOT.glob(each)}
    return sorted(name for name in found - {*hot["pure"]} if not name.endswith("__init__.py"))


setup(cmdclass={"build_py": BuildWhole, "compile": Compile})
