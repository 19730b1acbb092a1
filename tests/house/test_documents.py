"""The documents: generated parts are up to date, links and named files exist, sizes hold."""

import re
import shutil
from pathlib import Path

import pytest

from tests.house import generated_docs
from worldsim.engine.preflight import PROCESS_COMMAND_TICKS, admit
from worldsim.scenario.file import load

ROOT = generated_docs.ROOT
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
LINK = re.compile(r"\]\((?!https?://|#)([^)#]+)(?:#[^)]*)?\)")
NAMED = re.compile(r"`((?:netem|agent|worldsim|tests|deploy|docs)/[\w./-]+\.\w+)`")


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
def test_the_scenario_that_a_document_shows_can_be_flown(name: str, tmp_path: Path) -> None:
    blocks = re.findall(r"```toml\n(.*?)```", (ROOT / name).read_text(), re.DOTALL)
    (shown,) = [block for block in blocks if "[fleet]" in block]
    shutil.copytree(ROOT / "deploy" / "formations", tmp_path / "formations")
    folder = tmp_path / "scenarios" if '"../formations' in shown else tmp_path
    folder.mkdir(exist_ok=True)
    file = folder / "shown.toml"
    file.write_text(shown)
    scenario = load(file)
    admit(scenario, file, PROCESS_COMMAND_TICKS)
    assert scenario.event
