"""Adds to a wheel what pyproject.toml cannot declare: the library, and the source's commit.

The scenarios and formations are in ``deploy`` of the checkout, once. A wheel holds a copy beside
the code, in ``worldsim/library``; an editable install uses ``deploy`` itself.
"""

import json
import shutil
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
sys.path.insert(0, str(ROOT))  # absent in an isolated build

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


setup(cmdclass={"build_py": BuildWhole})
