"""The house itself: scripts that are sound, versions that are pinned."""

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
def test_a_script_is_sound(script: Path) -> None:
    checks = [["bash", "-n"]]
    if shutil.which("shellcheck"):
        checks.append(["shellcheck", "--external-sources"])
    for check in checks:
        done = subprocess.run(
            [*check, script], cwd=ROOT, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_what_is_started_can_be_started() -> None:
    sourced = ROOT / "deploy" / "setup.sh"
    assert all(os.access(script, os.X_OK) for script in SCRIPTS if script != sourced)


def test_constraints_are_names_and_versions_only() -> None:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[0-9][A-Za-z0-9.+!]*", pin) for pin in pins)


def test_every_requirement_is_pinned() -> None:
    pins = (ROOT / "constraints.txt").read_text().lower().replace("_", "-")
    project = (ROOT / "pyproject.toml").read_text()
    block = project.partition("dependencies = [")[2].partition("]\n\n[project.scripts")[0]
    for name in re.findall(r'"([A-Za-z0-9-]+)', block):
        assert f"\n{name.lower()}==" in pins


def test_of_netem_the_agents_core_may_import_only_the_channels() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    contracts = project["tool"]["importlinter"]["contracts"]
    (core,) = [each for each in contracts if "agent.core" in each.get("source_modules", [])]
    files = (ROOT / "netem").rglob("*.py")
    modules = {".".join(file.relative_to(ROOT).with_suffix("").parts) for file in files}
    modules -= {"netem.__init__", "netem.wire.__init__", "netem.wire.channels"}
    assert {each for each in core["forbidden_modules"] if each.startswith("netem")} == modules
