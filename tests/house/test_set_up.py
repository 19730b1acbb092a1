"""Set-up and launch, with a stand-in for Python that pretends to install.

The scripts are copied into a small checkout; the stand-in logs its calls.
"""

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

STAND_IN = """#!/bin/bash
case "$*" in
    *python_version*) echo "$VERSION" ;;
    *version_info*) [ "$VERSION" != 3.9.2 ] ;;
    "-m venv --clear "*)
        echo "venv" >>"$LOG"
        rm -rf "$4" && mkdir -p "$4/bin" && cp "$0" "$4/bin/python"
        printf '#!/bin/bash\\necho "pip 1 from %s/lib/pip"\\n' "$4" >"$4/bin/pip"
        chmod +x "$4/bin/pip" ;;
    "-m pip install "*)
        echo "pip ${*: -1}" >>"$LOG"
        [ "$BREAKS" != pip ] || exit 1
        for name in qswarm ruff mypy lint-imports pytest; do
            printf '#!/bin/bash\\necho "%s $*"\\n' $name >"${0%/*}/$name"
            chmod +x "${0%/*}/$name"
        done ;;
esac
"""

Script = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    home = tmp_path / "a checkout"
    (home / "deploy").mkdir(parents=True)
    for name in ("launch.sh", "test.sh", "setup.sh"):
        shutil.copy(ROOT / "deploy" / name, home / "deploy")
    for name in ("pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, home)
    stand_in = tmp_path / "python3"
    stand_in.write_text(STAND_IN)
    stand_in.chmod(0o755)
    return home


@pytest.fixture
def script(checkout: Path) -> Script:
    def run(name: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        settings = {
            "PYTHON": str(checkout.parent / "python3"),
            "LOG": str(checkout.parent / "log"),
            "VERSION": "3.12.1",
            "BREAKS": "",
            "PATH": os.environ["PATH"],
        }
        return subprocess.run(
            ["bash", checkout / "deploy" / name, *arguments],
            capture_output=True,
            text=True,
            check=False,
            cwd=checkout.parent,
            env={**settings, **environment},
        )

    return run


def calls(checkout: Path) -> list[str]:
    log = checkout.parent / "log"
    return log.read_text().splitlines() if log.exists() else []


def test_the_first_start_sets_up_and_the_second_is_silent(checkout: Path, script: Script) -> None:
    wedge = f"qswarm run {checkout}/deploy/scenarios/wedge-9.toml"
    first, second = script("launch.sh"), script("launch.sh", "--seed", "3")
    assert (first.returncode, first.stdout) == (0, wedge + "\n")
    assert "setting up" in first.stderr
    assert (second.stdout, second.stderr) == (f"{wedge} --seed 3\n", "")
    assert calls(checkout) == ["venv", f"pip {checkout}"]


@pytest.mark.parametrize(
    "arguments", [["my.toml", "--seed", "3"], ["--seed", "3", "my.toml"], ["other"]]
)
def test_a_given_scenario_is_passed_on(script: Script, arguments: list[str]) -> None:
    assert script("launch.sh", *arguments).stdout == f"qswarm run {' '.join(arguments)}\n"


def test_a_setting_that_ends_in_toml_is_not_a_scenario(checkout: Path, script: Script) -> None:
    printed = script("launch.sh", "--set", "formation.file=lines.toml").stdout
    assert printed.startswith(f"qswarm run {checkout}/deploy/scenarios/wedge-9.toml --set ")


def test_the_checks_install_more_and_launching_after_them_nothing(
    checkout: Path, script: Script
) -> None:
    assert script("launch.sh").returncode == 0
    assert script("test.sh").returncode == 0
    assert script("launch.sh").stderr == ""
    assert calls(checkout) == ["venv", f"pip {checkout}", f"pip {checkout}[dev]"]


def test_every_check_is_reported_and_pytest_runs_last(script: Script) -> None:
    lines = script("test.sh", "-k", "wedge").stdout.splitlines()
    names = ["format", "lint", "types", "imports"]
    assert [line.split() for line in lines[:4]] == [[name, "passed"] for name in names]
    assert lines[-1] == "pytest -k wedge"


def test_a_failed_check_fails_all_and_shows_its_output(checkout: Path, script: Script) -> None:
    script("test.sh")
    (checkout / ".venv/bin/mypy").write_text("#!/bin/bash\necho 'a.py: wrong'; exit 1\n")
    done = script("test.sh")
    assert done.returncode == 1
    assert "types            FAILED\na.py: wrong\n" in done.stdout
    assert done.stdout.splitlines()[-1].startswith("pytest")


def test_an_interrupted_set_up_is_repeated(checkout: Path, script: Script) -> None:
    failed = script("launch.sh", BREAKS="pip")
    assert (failed.returncode, failed.stdout) == (2, "")
    assert "the next start repeats it" in failed.stderr
    assert script("launch.sh").returncode == 0
    assert calls(checkout) == ["venv", f"pip {checkout}"] * 2


def test_changed_requirements_are_installed_into_the_same_environment(
    checkout: Path, script: Script
) -> None:
    script("launch.sh")
    with (checkout / "constraints.txt").open("a") as file:
        file.write("another==1.0\n")
    assert script("launch.sh").returncode == 0
    assert calls(checkout) == ["venv", f"pip {checkout}", f"pip {checkout}"]


def test_a_moved_checkout_is_set_up_again(checkout: Path, script: Script) -> None:
    script("launch.sh")
    checkout.rename(before := checkout.with_name("before"))
    shutil.copytree(before, checkout)
    pip = checkout / ".venv/bin/pip"
    pip.write_text(pip.read_text().replace(str(checkout), str(before)))
    stamp = checkout / ".venv/set-up-run"
    stamp.write_text(stamp.read_text().replace(str(checkout), str(before)))
    assert script("launch.sh").returncode == 0
    assert calls(checkout) == ["venv", f"pip {checkout}"] * 2


@pytest.mark.parametrize(
    ("environment", "says"),
    [
        ({"VERSION": "3.9.2"}, "is Python 3.9.2; 3.11 or newer is needed"),
        ({"PYTHON": "no-such-python"}, "'no-such-python' not found; install Python 3.11 or newer"),
    ],
)
def test_without_a_suitable_python_the_error_names_one(
    checkout: Path, script: Script, environment: dict[str, str], says: str
) -> None:
    done = script("launch.sh", **environment)
    assert done.returncode == 2
    assert says in done.stderr
    assert not (checkout / ".venv").exists()
