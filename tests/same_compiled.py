"""Compiled code does what pure Python does: a few short flights have equal traces.

    python -m tests.same_compiled

compiles the checkout, builds a compiled wheel of it, installs that into an empty folder, and flies
from there and, in pure Python, from the checkout. Without a C compiler there is nothing to compare.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from sysconfig import get_config_var
from tempfile import TemporaryDirectory

from netem.compiled import PURE
from tests.traces import CHAOS, LIBRARY

ROOT = Path(__file__).resolve().parents[1]
PIP = (sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check")
COMPILE = (sys.executable, "setup.py", "--quiet", "compile")
OFFLINE = ("--no-deps", "--no-index")
FLIGHTS = {
    "wedge-9-lossy": 6,
    "field-scan-6": 3,
    "no-sensor-9": 4,
    "forward-9": 4,
    "accelerating-9": 4,
    "gather-12": 4,
}
"""Scenarios of the library that between them need most of the code, and how long to fly [s]."""
FLY = """
import sys
from pathlib import Path
import agent.core
from worldsim.engine.virtual import VirtualFleet
from worldsim.scenario.file import load
print(agent.core.__file__)
for file, seconds in zip(sys.argv[1::2], sys.argv[2::2]):
    scenario = load(Path(file))
    fleet = VirtualFleet(scenario)
    for _ in range(round(float(seconds) * scenario.slots / scenario.duration_s)):
        fleet.slot()
    print(fleet.loop.trace.sha256, Path(file).stem)
"""


def main() -> int:
    """Compare; print the result, and return the exit status."""
    compiler = (os.environ.get("CC") or str(get_config_var("CC") or "cc")).split()[0]
    if shutil.which(compiler) is None:
        print(f"skipped: no C compiler '{compiler}'")
        return 0
    _run(COMPILE, ROOT, {PURE: "1"})
    with TemporaryDirectory(prefix="qswarm-same-") as name:
        folder = Path(name)
        chaos = folder / "chaos.toml"
        chaos.write_text(CHAOS.format(library=LIBRARY), encoding="utf-8")
        words = ["-P", "-c", FLY, str(chaos), "22"]
        for scenario, seconds in FLIGHTS.items():
            words += [str(LIBRARY / f"{scenario}.toml"), str(seconds)]
        compiled = _flown(words, _installed(folder))
        pure = _flown(words, ROOT)
    if not compiled[0].endswith(".so") or not pure[0].endswith(".py"):
        print(f"what ran is {compiled[0]} and {pure[0]}")
        return 1
    differing = [each for each, other in zip(pure, compiled, strict=True) if each != other][1:]
    for trace in differing:
        print(f"differs: {trace}")
    print(f"{len(pure) - 1 - len(differing)} of {len(pure) - 1} flights are the same compiled")
    return 1 if differing else 0


def _installed(folder: Path) -> Path:
    """Return a folder into which a compiled wheel is installed, without dependencies."""
    made, target = folder / "made", folder / "target"
    build = [*PIP, "wheel", str(ROOT), *OFFLINE, "--no-build-isolation", "-w", str(made)]
    _run(build, folder, {"QSWARM_COMPILED": "1"})
    (wheel,) = made.glob("qswarm-*.whl")
    install = [*PIP, "install", *OFFLINE, "--target", str(target), str(wheel)]
    _run(install, folder, {})
    return target


def _run(command: Sequence[str], folder: Path, variables: dict[str, str]) -> None:
    """Run a command in a folder; show what it prints, mostly warnings, only if it fails."""
    env = {**os.environ, **variables}
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, check=False)
    if done.returncode:
        sys.exit((done.stdout + done.stderr).decode(errors="replace"))


def _flown(words: list[str], code: Path) -> list[str]:
    """Fly with the code in a folder; return which code ran, and the traces."""
    env = {**os.environ, "PYTHONPATH": str(code)}
    env[PURE] = "1" if code == ROOT else "0"
    done = subprocess.run([sys.executable, *words], env=env, check=True, stdout=subprocess.PIPE)
    return done.stdout.decode().splitlines()


if __name__ == "__main__":
    sys.exit(main())
