"""docs/controllers.md works as it stands there, and leaves no field of the interface out."""

import inspect
import re
from pathlib import Path
from typing import Any

import pytest

from agent.controller import Flown, Heard, Intent, Outgoing, Peer, Received, Senses
from tests.tutorial.bench import ROOT, set_up
from tests.tutorial.page import Newcomer, blocks

PAGE = (ROOT / "docs" / "controllers.md").read_text()


@pytest.mark.processes
@pytest.mark.real_time
def test_followed_word_for_word_it_works(tmp_path: Path) -> None:
    newcomer = Newcomer(tmp_path, set_up(tmp_path))
    steps = blocks(PAGE)
    assert {"python", "toml", "sh", "text"} == {step.language for step in steps}
    for step in steps:
        newcomer.follow(step)
    assert (tmp_path / "carousel" / "runs" / "named" / "summary.json").exists()


@pytest.mark.parametrize(
    "table",
    [Senses, Heard, Peer, Flown, Received, Intent, Outgoing],
    ids=lambda table: table.__name__,
)
def test_every_field_is_told(table: Any) -> None:
    names = inspect.signature(table).parameters
    assert [name for name in names if not re.search(rf"`{name}\W", PAGE)] == []


def test_the_files_it_links_are_there() -> None:
    linked = [re.split("[)#]", part)[0] for part in PAGE.split("](")[1:]]
    assert linked
    assert [link for link in linked if not (ROOT / "docs" / link).exists()] == []
