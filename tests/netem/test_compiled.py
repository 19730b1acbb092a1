"""Compiled modules run only while they fit: this Python, whole, and made of the present sources."""

import json
import os
import subprocess
import sys
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec
from sysconfig import get_config_var

import pytest

from netem.compiled import MANIFEST, PURE, REMEDY, Finder, UnfitError, digest_of, fitting

SOURCE, EXTENSION = "hot/core.py", "hot/core.so"


@pytest.fixture
def root(tmp_path):
    """A checkout with one module that was compiled."""
    folder = tmp_path / "build" / "compiled"
    for made in (tmp_path / SOURCE, folder / EXTENSION):
        made.parent.mkdir(parents=True)
        made.write_text("x = 1\n")
    manifest = {
        "abi": get_config_var("SOABI"),
        "sources": {SOURCE: digest_of(tmp_path / SOURCE)},
        "extensions": {"hot.core": EXTENSION},
    }
    (folder / MANIFEST).write_text(json.dumps(manifest))
    return tmp_path


def found(root):
    return fitting(root, root / "build" / "compiled")


def changed(root, **fields):
    file = root / "build" / "compiled" / MANIFEST
    file.write_text(json.dumps({**json.loads(file.read_text()), **fields}))


def test_a_whole_build_of_the_present_sources_fits(root):
    assert found(root) == {"hot.core": root / "build" / "compiled" / EXTENSION}


def test_where_nothing_was_compiled_pure_python_runs_and_nobody_is_told(tmp_path):
    assert found(tmp_path) == {}


@pytest.mark.parametrize("edit", ["x = 2\n", "", None])
def test_an_edit_ends_the_use_of_all_compiled_modules(root, edit):
    file = root / SOURCE
    file.unlink() if edit is None else file.write_text(edit)
    with pytest.raises(UnfitError, match=f"{SOURCE} has changed"):
        found(root)


def test_what_another_python_compiled_does_not_run(root):
    changed(root, abi="cpython-39-x86_64-linux-gnu")
    with pytest.raises(UnfitError, match="compiled for cpython-39"):
        found(root)


@pytest.mark.parametrize("text", [None, "", "{", "[]", "{}", '{"abi": 1}'])
def test_half_a_build_does_not_run(root, text):
    file = root / "build" / "compiled" / MANIFEST
    file.unlink() if text is None else file.write_text(text)
    with pytest.raises(UnfitError):
        found(root)


@pytest.mark.parametrize("key", ["sources", "extensions"])
@pytest.mark.parametrize("value", [None, [], ["hot/core.py"], {"hot.core": 5}, {"hot.core": None}])
def test_a_manifest_of_another_shape_is_half_a_build(root, key, value):
    changed(root, **{key: value})
    with pytest.raises(UnfitError, match="unfinished"):
        found(root)


def test_a_build_without_extensions_does_not_run(root):
    changed(root, extensions={})
    with pytest.raises(UnfitError, match="names no files"):
        found(root)


def test_an_extension_that_cannot_be_loaded_ends_the_process_in_one_line(root, capsys):
    """Part of what runs is compiled by then, so nobody who catches ImportErrors may go on."""
    spec = Finder(found(root)).find_spec("hot.core", None)
    with pytest.raises(SystemExit) as ended:
        module_from_spec(spec)
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert EXTENSION in line
    assert PURE in line


def test_a_build_without_one_of_its_extensions_does_not_run(root):
    (root / "build" / "compiled" / EXTENSION).unlink()
    with pytest.raises(UnfitError, match=r"core\.so is missing"):
        found(root)


def test_only_compiled_modules_are_found(tmp_path):
    finder = Finder({"hot.core": tmp_path / "core.so"})
    spec = finder.find_spec("hot.core", None)
    assert isinstance(spec, ModuleSpec)
    assert spec.origin == str(tmp_path / "core.so")
    assert finder.find_spec("hot.other", None) is None


def test_a_person_is_told_once_why_pure_python_runs(root):
    """Before a flight, not before; nor do processes that are begun from there, in whatever way."""
    (root / SOURCE).write_text("x = 2\n")
    code = f"""
import os, sys
from pathlib import Path
from netem import compiled
del os.environ[{PURE!r}]
compiled.ROOT = Path({str(root)!r})
compiled.FOLDER = compiled.ROOT / "build" / "compiled"
compiled.prefer()
compiled.prefer()
print(any(isinstance(each, compiled.Finder) for each in sys.meta_path), os.environ[{PURE!r}])
print("before", file=sys.stderr, flush=True)
if os.fork() == 0:
    compiled.tell_if_unfit()
    os._exit(0)
os.wait()
compiled.tell_if_unfit()
compiled.tell_if_unfit()
"""
    imported_pure = {**os.environ, PURE: "1"}  # whatever this checkout has compiled
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        timeout=30,
        env=imported_pure,
    )
    assert done.stdout.split() == ["False", "1"]
    before, line = done.stderr.splitlines()
    assert before == "before"
    assert line.startswith("qswarm: pure Python runs")
    assert SOURCE in line
    assert REMEDY in line
