"""Selectors: each form decodes into its type, and any other text is rejected."""

import pytest

from worldsim.scenario.selectors import (
    AllAgents,
    OneAgent,
    ParsedSelector,
    QueueAgents,
    RandomAgents,
    SelectorError,
    VertexAgent,
    parsed,
)


@pytest.mark.parametrize(
    ("selector", "kind"),
    [
        (0, OneAgent(0)),
        (12, OneAgent(12)),
        ("all", AllAgents()),
        ("random:3", RandomAgents(3)),
        ("random:9999", RandomAgents(9999)),
        ("vertex:V1", VertexAgent("V1")),
        ("queue:a:b", QueueAgents("a:b")),
        ("queue:two\nlines", QueueAgents("two\nlines")),
    ],
)
def test_each_form_has_its_type(selector: int | str, kind: ParsedSelector) -> None:
    found = parsed(selector)
    assert (type(found), found) == (type(kind), kind)


@pytest.mark.parametrize(
    "text", ["", "3", "alle", "all ", "random:", "random:0", "random:10000", "vertex:", "tier:1"]
)
def test_any_other_text_is_rejected(text: str) -> None:
    with pytest.raises(SelectorError):
        parsed(text)
