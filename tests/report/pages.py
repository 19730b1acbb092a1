"""What a page of a report holds, and that it asks for nothing."""

import json
import re
from html.parser import HTMLParser
from typing import Any

VOID = {"meta", "br"}


class Page(HTMLParser):
    """What a page holds: its tags with their attributes, figures by key, and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.figures: dict[str, tuple[Any, str]] = {}
        self.text = ""
        self._key: tuple[str, Any] | None = None
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.tags.append((tag, found))
        if tag not in VOID:
            self.open.append(tag)
        key, value = found.get("data-key"), found.get("data-value")
        if key is not None and value is not None:
            self._key = (key, json.loads(value))

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data
        if self._key is not None:
            key, value = self._key
            self.figures[key] = (value, data)
            self._key = None


def assert_loads_nothing(page: Page) -> None:
    """Assert that a page is whole, and that a browser asks no host for a part of it."""
    assert page.open == []
    assert not {tag for tag, _ in page.tags} & {"script", "link", "iframe", "object", "embed"}
    for tag, attributes in page.tags:
        for name, value in attributes.items():
            if name.split(":")[-1] in {"src", "href", "srcset", "action"}:
                assert (value or "").startswith(("#", "data:")), (tag, name, value)
            for target in re.findall(r"url\(([^)]*)\)", value or ""):
                assert target.startswith("#")
    policy = [a["content"] for tag, a in page.tags if tag == "meta" and "http-equiv" in a]
    assert policy == ["default-src 'none'; style-src 'unsafe-inline'; img-src data:"]
