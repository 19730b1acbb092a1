"""Scripts pass their checks, and every dependency is pinned."""

import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = [*sorted((ROOT / "deploy").glob("*.sh")), ROOT / ".ci" / "run"]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.name)
def test_a_script_passes_bash_and_shellcheck(script: Path) -> None:
    checks = [["bash", "-n"]]
    if shutil.which("shellcheck"):
        checks.append(["shellcheck", "--external-sources"])
    for check in checks:
        done = subprocess.run(
            [*check, script], cwd=ROOT, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_by_hand_prints_its_usage_and_refuses_options() -> None:
    script = ROOT / "deploy" / "by-hand.sh"
    usage = subprocess.run([script, "--help"], capture_output=True, text=True, check=False)
    assert (usage.returncode, usage.stderr) == (0, "")
    assert "  deploy/by-hand.sh [SCENARIO [DIR]]" in usage.stdout.splitlines()
    wrong = subprocess.run([script, "--bogus"], capture_output=True, text=True, check=False)
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert wrong.stderr == "--bogus: no such option; deploy/by-hand.sh [SCENARIO [DIR]]\n"


def test_scripts_are_executable() -> None:
    sourced = ROOT / "deploy" / "setup.sh"
    assert all(os.access(script, os.X_OK) for script in SCRIPTS if script != sourced)


def test_tests_of_processes_are_in_the_folders_that_the_checks_name() -> None:
    checks = (ROOT / "deploy" / "test.sh").read_text()
    (named,) = re.findall(r"^ *processes=\((.*)\)$", checks, re.MULTILINE)
    marked = [
        str(file.relative_to(ROOT))
        for file in (ROOT / "tests").rglob("test_*.py")
        if re.search(r"mark\.(processes|real_time)\b", file.read_text())
    ]
    assert marked
    assert [file for file in marked if not file.startswith(tuple(named.split()))] == []


def test_constraints_are_names_and_versions_only() -> None:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[0-9][A-Za-z0-9.+!]*", pin) for pin in pins)


def test_every_requirement_is_pinned() -> None:
    pins = (ROOT / "constraints.txt").read_text().lower().replace("_", "-")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"].values()
    needed = [*project["dependencies"], *(name for extra in extras for name in extra)]
    for name in (re.match(r"[A-Za-z0-9-]+", each) for each in needed):
        assert name is not None
        assert f"\n{name[0].lower()}==" in pins


def test_of_netem_the_agents_core_may_import_only_the_channels() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    contracts = project["tool"]["importlinter"]["contracts"]
    (core,) = [each for each in contracts if "agent.core" in each.get("source_modules", [])]
    files = (ROOT / "netem").rglob("*.py")
    modules = {".".join(file.relative_to(ROOT).with_suffix("").parts) for file in files}
    modules -= {"netem.__init__", "netem.compiled", "netem.wire.__init__", "netem.wire.channels"}
    assert {each for each in core["forbidden_modules"] if each.startswith("netem")} == modules


def test_what_is_to_be_compiled_exists() -> None:
    hot = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["qswarm"]
    assert all([*ROOT.glob(each)] for each in hot["compiled"])
    found = {str(file.relative_to(ROOT)) for each in hot["compiled"] for file in ROOT.glob(each)}
    assert found.issuperset(hot["pure"])
