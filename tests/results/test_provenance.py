"""Provenance: the commit of any checkout or wheel, the installed versions, and nothing personal."""

import json
import os
import platform
import subprocess
import tomllib
from pathlib import Path

import pytest

from worldsim.results.provenance import (
    RECORDED,
    ROOT,
    Commit,
    commit_of,
    provenance,
    version_text,
)

SHA = "0123456789abcdef0123456789abcdef01234567"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def git(folder: Path, *words: str) -> str:
    identity = ("-c", "user.name=x", "-c", "user.email=x@y", "-c", "init.defaultBranch=main")
    done = subprocess.run(
        ["git", *identity, "-C", folder, *words], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    folder = tmp_path / "checkout"
    folder.mkdir()
    git(folder, "init", "-q")
    (folder / "a.py").write_text("a = 1\n")
    git(folder, "add", ".")
    git(folder, "commit", "-q", "-m", "A")
    return folder


def test_the_commit_is_that_of_head_on_a_branch_or_without_one(checkout: Path) -> None:
    head = git(checkout, "rev-parse", "HEAD")
    assert commit_of(checkout) == Commit(head, False)
    git(checkout, "pack-refs", "--all")
    assert commit_of(checkout) == Commit(head, False)
    git(checkout, "checkout", "-q", "--detach")
    assert commit_of(checkout) == Commit(head, False)


def test_the_commit_of_a_worktree_is_its_own(checkout: Path) -> None:
    git(checkout, "worktree", "add", "-q", "-b", "other", "../other")
    other = checkout.with_name("other")
    (other / "a.py").write_text("a = 2\n")
    git(other, "commit", "-q", "-a", "-m", "B")
    assert commit_of(other) == Commit(git(other, "rev-parse", "HEAD"), False)
    assert commit_of(checkout) == Commit(git(checkout, "rev-parse", "HEAD"), False)


@pytest.mark.parametrize("staged", [False, True])
def test_a_changed_file_makes_it_dirty_and_a_new_one_does_not(checkout: Path, staged: bool) -> None:
    (checkout / "runs").mkdir()
    (checkout / "runs/new.txt").write_text("new")
    assert commit_of(checkout).dirty is False
    (checkout / "a.py").write_text("a = 12\n")
    if staged:
        git(checkout, "add", "a.py")
    assert commit_of(checkout).dirty is True


def test_variables_of_a_git_hook_do_not_mislead_it(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE"):
        monkeypatch.setenv(name, str(tmp_path / "elsewhere"))
    assert commit_of(checkout).dirty is False


def test_without_git_the_commit_is_known_and_its_cleanness_is_not(
    checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    head = git(checkout, "rev-parse", "HEAD")
    monkeypatch.setenv("PATH", "")
    assert commit_of(checkout) == Commit(head, None)


def test_outside_a_checkout_the_commit_is_unknown(tmp_path: Path) -> None:
    assert commit_of(tmp_path) == Commit(None, None)


def test_a_wheel_has_its_commit_recorded(tmp_path: Path) -> None:
    (tmp_path / RECORDED).parent.mkdir()
    (tmp_path / RECORDED).write_text(json.dumps(Commit(SHA, True)._asdict()))
    assert commit_of(tmp_path) == Commit(SHA, True)


def test_it_has_the_version_of_every_runtime_dependency() -> None:
    needed = {requirement.partition(">")[0] for requirement in PROJECT["dependencies"]}
    packages = provenance()["packages"]
    assert packages.keys() == needed
    pins = dict(
        line.lower().replace("_", "-").split("==")
        for line in (ROOT / "constraints.txt").read_text().splitlines()
        if not line.startswith("#")
    )
    assert packages == {name: pins[name] for name in needed}
    assert provenance()["version"] == PROJECT["version"]
    assert provenance()["python"] == platform.python_version()


def test_it_holds_nothing_personal() -> None:
    text = json.dumps(provenance())
    personal = (platform.node(), str(Path.home()), str(ROOT), str(Path.cwd()), os.sep)
    assert [each for each in personal if each in text] == []


def test_the_version_text_has_the_commit_where_it_is_known() -> None:
    known = {**provenance(), "version": "1.2", "commit": SHA, "commit_dirty": True}
    assert version_text(known) == "qswarm 1.2 (commit 0123456789ab, modified)"  # type: ignore[arg-type]
    assert version_text({**known, "commit_dirty": None}) == "qswarm 1.2 (commit 0123456789ab)"  # type: ignore[typeddict-item]
    assert version_text({**known, "commit": None}).startswith("qswarm 1.2")  # type: ignore[typeddict-item]
