"""A wheel is whole: built from a copy of the checkout, installed, and used in an empty folder."""

import configparser
import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("netem", "agent", "worldsim")
TOO_SHORT = "the run ended after 3 s, before the limit of 12 s"
NOT_JUDGED = f"not judged: pyramidal-wedge did not converge: {TOO_SHORT}"
SHA = "0123456789abcdef0123456789abcdef01234567"
SOURCES = (*PACKAGES, "deploy", "pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE")
PIP = (sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of the present files, from a copy whose HEAD is SHA and that has an old build."""
    copy = tmp_path_factory.mktemp("checkout")
    unwanted = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, copy / name, ignore=unwanted)
        else:
            shutil.copy(ROOT / name, copy / name)
    (copy / ".git").mkdir()
    (copy / ".git/HEAD").write_text(f"{SHA}\n")
    (copy / "build/lib/worldsim").mkdir(parents=True)
    (copy / "build/lib/worldsim/removed.py").touch()
    build = [*PIP, "wheel", ".", "--no-deps", "--no-build-isolation", "--no-index", "-w", "made"]
    subprocess.run(build, cwd=copy, check=True, capture_output=True)
    (made,) = (copy / "made").glob("qswarm-*.whl")
    return made


@pytest.fixture(scope="module")
def target(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel installed into it, and no dependency."""
    folder = tmp_path_factory.mktemp("target")
    install = [*PIP, "install", "--no-deps", "--no-index", "--target", folder, wheel]
    subprocess.run(install, check=True, capture_output=True)
    return folder


def test_it_holds_the_code_the_library_and_nothing_else(wheel: Path) -> None:
    code = {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
    }
    library = {
        f"worldsim/library/{path.relative_to(ROOT / 'deploy').as_posix()}"
        for kind in ("scenarios", "formations")
        for path in (ROOT / "deploy" / kind).rglob("*.toml")
    }
    typed = {f"{package}/py.typed" for package in PACKAGES}
    held = {name for name in ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert len(library) > 30
    assert held == code | library | typed | {"worldsim/commit.json"}


def test_its_metadata_is_that_of_the_project(wheel: Path) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    with ZipFile(wheel) as files:
        (info,) = {name.split("/")[0] for name in files.namelist() if ".dist-info/" in name}
        metadata = files.read(f"{info}/METADATA").decode()
        scripts = configparser.ConfigParser()
        scripts.read_string(files.read(f"{info}/entry_points.txt").decode())
        assert json.loads(files.read("worldsim/commit.json"))["sha"] == SHA
        assert f"{info}/licenses/LICENSE" in files.namelist()
    assert f"\nVersion: {project['version']}\n" in metadata
    assert "\nRequires-Python: >=3.11\n" in metadata
    assert dict(scripts["console_scripts"]) == {"qswarm": "worldsim.commands.app:main"}


def test_installed_it_runs_the_library_in_an_empty_folder(target: Path, tmp_path: Path) -> None:
    def qswarm(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [target / "bin/qswarm", *words],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(target)},
            capture_output=True,
            text=True,
            check=False,
        )

    made = qswarm("sim", "wedge-9", "--no-recording", "--quiet", "--duration", "3", "--out", "run")
    assert (made.returncode, made.stderr.count("\n")) == (3, 1), made.stderr
    assert made.stderr.startswith("wedge-9: expect.converge_within_s: warning: ")
    assert made.stdout.startswith("inconclusive (not judged: pyramidal-wedge did not converge")
    summary = json.loads((tmp_path / "run/summary.json").read_text())
    assert (summary["reason"], summary["commit"]) == (NOT_JUDGED, SHA)
    assert all(summary["packages"].values())

    error = qswarm("check", "wedge-9", "--agents", "0").stderr
    assert error.startswith(f"{target}/worldsim/library/scenarios/wedge-9.toml: fleet.agents: ")
    assert f"(commit {SHA[:12]}" in qswarm("--version").stdout
