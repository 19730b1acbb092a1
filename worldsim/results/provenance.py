"""Provenance: which code, packages and kind of machine produced a result.

It is read from files in a few milliseconds, once a process. It never holds a host name, a user
name or a path.
"""

import json
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import NamedTuple, TypedDict

ROOT = Path(__file__).resolve().parents[2]
"""The folder of the packages: a checkout, or the folder that a wheel is installed into."""
RECORDED = Path("worldsim", "commit.json")
"""Below ROOT, in a wheel: the commit that the wheel was built from."""
DISTRIBUTION = "qswarm"
GIT_WITHIN_S = 2.0

_GIT_ELSEWHERE = frozenset({"GIT_INDEX_FILE", "GIT_OBJECT_DIRECTORY", "GIT_COMMON_DIR"})
"""Variables that would point git at the caller's repository; a git hook sets them."""
_COMMIT = re.compile(r"[0-9a-f]{40}([0-9a-f]{24})?")
_REQUIREMENT = re.compile(r"^Requires-Dist: *([A-Za-z0-9._-]+)(?!.*extra *==)", re.MULTILINE)


class Host(TypedDict):
    """The kind of machine."""

    os: str  # as in `uname -s`
    kernel: str  # release
    machine: str  # instruction set, as in `uname -m`
    cpus: int  # usable by this process


class Provenance(TypedDict):
    """The provenance keys of summary.json; None where a value is unknown."""

    version: str | None  # of qswarm
    commit: str | None  # of qswarm's source
    commit_dirty: bool | None  # whether tracked files differed from the commit
    python: str
    packages: dict[str, str | None]  # installed version of each runtime dependency
    host: Host


class Commit(NamedTuple):
    """A commit, and whether tracked files differ from it; None where git cannot tell."""

    sha: str | None
    dirty: bool | None


@cache
def provenance() -> Provenance:
    """Return the provenance of this process's results."""
    commit = commit_of(ROOT)
    own = _dist_infos([DISTRIBUTION]).get(DISTRIBUTION)
    needed = _dist_infos(_requirements(own)) if own is not None else {}
    return {
        "version": _version(own),
        "commit": commit.sha,
        "commit_dirty": commit.dirty,
        "python": platform.python_version(),
        "packages": {name: _version(folder) for name, folder in sorted(needed.items())},
        "host": _host(),
    }


def version_text(known: Provenance) -> str:
    """Return the version, and the commit where it is known, for `qswarm --version`."""
    commit, dirty = known["commit"], ", modified" if known["commit_dirty"] else ""
    source = f" (commit {commit[:12]}{dirty})" if commit is not None else ""
    return f"qswarm {known['version'] or 'of unknown version'}{source}"


def commit_of(root: Path) -> Commit:
    """Return the commit of the code in a folder: a wheel's recorded one, or the checkout's."""
    recorded = root / RECORDED
    if recorded.is_file():
        return Commit(**json.loads(recorded.read_text(encoding="utf-8")))
    sha = _head(root / ".git")
    return Commit(sha, _dirty(root) if sha is not None else None)


def _head(git: Path) -> str | None:
    """Return the commit that HEAD names, read from the files of a git folder."""
    if git.is_file():  # a worktree: the file names its git folder
        git = git.parent / git.read_text(encoding="utf-8").removeprefix("gitdir:").strip()
    head = _text(git / "HEAD")
    if not head.startswith("ref:"):
        return _sha(head)
    reference = head.removeprefix("ref:").strip()
    common = git / (_text(git / "commondir") or ".")
    loose = _text(git / reference) or _text(common / reference)
    return _sha(loose or _packed(_text(common / "packed-refs"), reference))


def _packed(packed_refs: str, reference: str) -> str:
    rows = (line.split(" ", 1) for line in packed_refs.splitlines() if not line.startswith("#"))
    return next((row[0] for row in rows if row[1:] == [reference]), "")


def _sha(text: str) -> str | None:
    return text if _COMMIT.fullmatch(text) else None


def _text(file: Path) -> str:
    """Return a small text file without the space around it; "" where there is none."""
    try:
        return file.read_text(encoding="utf-8").strip()
    except OSError:
        return ""


def _dirty(root: Path) -> bool | None:
    """Ask git whether tracked files differ from HEAD; None without an answer."""
    this = ["git", f"--git-dir={root / '.git'}", f"--work-tree={root}"]
    environment = {name: value for name, value in os.environ.items() if name not in _GIT_ELSEWHERE}
    try:
        done = subprocess.run(
            [*this, "diff-index", "--quiet", "HEAD", "--"],
            cwd=root,
            env=environment,
            capture_output=True,
            check=False,
            timeout=GIT_WITHIN_S,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return {0: False, 1: True}.get(done.returncode)


def _dist_infos(names: Iterable[str]) -> dict[str, Path | None]:
    """Return each distribution's .dist-info folder, the first on sys.path; None: not installed.

    The folder's name holds the version, so no metadata is parsed.
    """
    found: dict[str, Path | None] = dict.fromkeys(names)
    missing = {_normalised(name): name for name in found}
    for entry in filter(None, sys.path):
        if not missing:
            break
        for folder in Path(entry).glob("*.dist-info"):
            name = missing.pop(_normalised(folder.stem.rpartition("-")[0]), None)
            if name is not None:
                found[name] = folder
    return found


def _normalised(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _version(dist_info: Path | None) -> str | None:
    return dist_info.stem.rpartition("-")[2] if dist_info is not None else None


def _requirements(dist_info: Path) -> list[str]:
    """Return the runtime dependencies that a distribution declares, without its extras'."""
    headers = _text(dist_info / "METADATA").partition("\n\n")[0]
    return _REQUIREMENT.findall(headers)


def _host() -> Host:
    system = os.uname()
    return {
        "os": system.sysname,
        "kernel": system.release,
        "machine": system.machine,
        "cpus": len(os.sched_getaffinity(0)),
    }
