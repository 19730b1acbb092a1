"""The documents: generated parts are up to date, links and named files exist, sizes hold."""

import re
from pathlib import Path

import pytest

from tests.house import generated_docs
from worldsim.engine.preflight import PROCESS_COMMAND_TICKS, admit
from worldsim.engine.virtual import fly
from worldsim.scenario.file import load

ROOT = generated_docs.ROOT
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
LINK = re.compile(r"\]\((?!https?://|#)([^)#]+)(?:#[^)]*)?\)")
COMMENTED_KEY = re.compile(r"^# (\w+) =", re.MULTILINE)
NAMED = re.compile(r"`((?:netem|agent|worldsim|tests|deploy|docs)/[\w./-]+\.\w+)`")


def _toml_blocks(name: str) -> list[str]:
    found: list[str] = re.findall(r"```toml\n(.*?)```", (ROOT / name).read_text(), re.DOTALL)
    return found


def _shown_scenario(name: str) -> str:
    (shown,) = [block for block in _toml_blocks(name) if "[fleet]" in block]
    return shown


def _saved(text: str, folder: Path) -> Path:
    file = folder / "scenario.toml"
    file.write_text(text)
    return file


def test_the_parts_that_are_generated_are_in_the_documents() -> None:
    texts = [file.read_text() for file in generated_docs.documents()]
    found = {name for text in texts for _, name, _, _ in generated_docs.PART.findall(text)}
    assert found == set(generated_docs.PARTS)


@pytest.mark.parametrize("file", generated_docs.documents(), ids=lambda file: file.name)
def test_generated_parts_are_up_to_date(file: Path) -> None:
    text = file.read_text()
    assert text == generated_docs.renewed(text), "run: python -m tests.house.generated_docs"


@pytest.mark.parametrize("file", DOCUMENTS, ids=lambda file: file.name)
def test_a_document_names_only_files_that_exist(file: Path) -> None:
    text = file.read_text()
    linked = [file.parent / target for target in LINK.findall(text)]
    named = [ROOT / target for target in NAMED.findall(text)]
    missing = [str(path) for path in (*linked, *named) if not path.exists()]
    assert missing == []


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 180


@pytest.mark.parametrize("name", ["README.md", "docs/scenario.md"])
def test_the_scenario_that_a_document_shows_passes(name: str, tmp_path: Path) -> None:
    file = _saved(_shown_scenario(name), tmp_path)
    scenario = load(file)
    assert scenario.event
    admit(scenario, file, PROCESS_COMMAND_TICKS)
    judge = fly(scenario).loop.judge
    assert [row.name for row in judge.expectations() if not row.held] == []
    assert [name for name, tally in judge.invariants().items() if tally.violations] == []


@pytest.mark.parametrize("key", COMMENTED_KEY.findall(_shown_scenario("docs/scenario.md")))
def test_each_key_that_the_example_comments_out_can_be_switched_on(
    key: str, tmp_path: Path
) -> None:
    text = _shown_scenario("docs/scenario.md").replace(f"\n# {key} =", f"\n{key} =")
    load(_saved(text, tmp_path))


def test_the_formation_that_a_document_shows_is_a_whole_file(tmp_path: Path) -> None:
    (shown,) = [block for block in _toml_blocks("docs/scenario.md") if "[vertices]" in block]
    (tmp_path / "shown.toml").write_text(shown)
    text = '[fleet]\nagents = 5\n[formation]\nfile = "shown.toml"\n'
    assert load(_saved(text, tmp_path)).formation.name == "arrow"
