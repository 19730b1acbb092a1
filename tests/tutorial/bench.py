"""A checkout as the tutorial's reader has it: ``~/qswarm``, whose .venv is the one of this run.

Nothing is installed: pip is stood in for by what it would leave, the package's name and its entry
points, where Python looks for packages.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
QSWARM = "from worldsim.commands.app import main\n\nmain()\n"
PIP = """
import sys, tomllib
from pathlib import Path

assert sys.argv[1:] == ["install", "--quiet", "--editable", "."], sys.argv
project = tomllib.loads(Path("pyproject.toml").read_text())
name, version = project["project"]["name"], project["project"]["version"]
site = Path({site!r})
info = site / f"{{name}}-{{version}}.dist-info"
info.mkdir(parents=True)
(info / "METADATA").write_text(f"Metadata-Version: 2.1\\nName: {{name}}\\nVersion: {{version}}\\n")
lines = []
for group, entries in project["project"]["entry-points"].items():
    lines += [f"[{{group}}]", *(f"{{key}} = {{value}}" for key, value in entries.items())]
(info / "entry_points.txt").write_text("\\n".join(lines))
for package in project["tool"]["setuptools"]["packages"]:
    (site / package).symlink_to(Path(package).resolve())
"""


def set_up(home: Path) -> dict[str, str]:
    """Make ``~/qswarm`` in a home; return what the environment must hold besides."""
    site, commands = home / "site", home / "qswarm" / ".venv" / "bin"
    commands.mkdir(parents=True)
    (home / "qswarm" / "deploy").symlink_to(ROOT / "deploy")
    _command(commands / "python", f'exec "{sys.executable}" "$@"')
    for name, program in (("qswarm", QSWARM), ("pip", PIP.format(site=str(site)))):
        (commands / f"{name}.py").write_text(program)
        _command(commands / name, f'exec "{sys.executable}" "{commands}/{name}.py" "$@"')
    return {"PYTHONPATH": f"{ROOT}:{site}"}


def _command(path: Path, line: str) -> None:
    path.write_text(f"#!/bin/sh\n{line}\n")
    path.chmod(0o755)
