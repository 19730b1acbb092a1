"""The parts of a report's page: the document, tables, figures, and boxes of words.

A page is one HTML file with its style and its figures inside. It asks nothing of any host, and it
has no script.
"""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

from worldsim.report.page_style import CSS

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""What a browser may load for the page: images that the page itself holds."""
UNKNOWN = "-"
_ID = re.compile(r'(\bid="|url\(#|href="#)')


class Figure(NamedTuple):
    """A figure of the page: its words, and the key and value that it stands for."""

    text: str
    key: str = ""
    """The path in summary.json, joined by dots; empty for what is no figure of it."""
    value: Any = None


class DrawnFigure(NamedTuple):
    """A figure as files and as a part of the page."""

    name: str
    title: str
    caption: str
    svg: str
    png: bytes


def document(title: str, parts: Iterable[str]) -> str:
    """Return a page of some parts."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)} - qswarm report</title>\n<style>{CSS}</style>\n</head>\n<body>\n"
        f"<main>\n{''.join(parts)}\n</main>\n</body>\n</html>\n"
    )


def verdict_box(outcome: str, words: str, kind: str = "") -> str:
    """Return an outcome, and why. kind: pass, fail or inconclusive; left out, the outcome."""
    return (
        f'<div class="verdict {escape(kind or outcome)}"><b>{escape(outcome)}</b>'
        f"<span>{escape(words)}</span></div>"
    )


def notes_box(notes: Sequence[str]) -> str:
    """Return notes on what is missing; nothing without any."""
    if not notes:
        return ""
    return f'<div class="notes">{"".join(f"<p>{escape(note)}</p>" for note in notes)}</div>'


def tiles(cells: Iterable[tuple[str, Figure]]) -> str:
    """Return a row of figures with their names."""
    shown = "".join(
        f"<div><span>{escape(name)}</span><b{data(figure)}>{escape(figure.text)}</b></div>"
        for name, figure in cells
    )
    return f'<div class="tiles">{shown}</div>'


def drawn(figure: DrawnFigure, prefix: str) -> str:
    """Return a figure with its title and caption. prefix: of its ids, apart from all others'."""
    return (
        f"<h3>{escape(figure.title)}</h3>"
        f'<p class="caption">{escape(figure.caption)}</p>'
        f'<figure role="img" aria-label="{escape(figure.title)}">'
        f"{_inline(figure.svg, prefix)}</figure>"
    )


def _inline(svg: str, prefix: str) -> str:
    """Return an SVG file as a part of a page, its ids apart from those of other figures."""
    return _ID.sub(lambda match: match[1] + prefix, svg[svg.index("<svg") :])


def table(head: Sequence[str], body: Iterable[Sequence[Figure]], numbers: int) -> str:
    """Return a table; from column ``numbers`` on it holds numbers."""
    lines = "".join(
        f"<tr>{''.join(_cell(cell, index >= numbers) for index, cell in enumerate(row))}</tr>"
        for row in body
    )
    return f"<table>{table_head(head, range(numbers, len(head)))}{lines}</table>"


def pairs(rows: Iterable[tuple[str, str]]) -> str:
    """Return a table of names and what they stand for."""
    body = "".join(
        f'<tr><td class="key">{escape(name)}</td><td class="code">{escape(text)}</td></tr>'
        for name, text in rows
    )
    return f"<table>{body}</table>"


def listed(lines: Iterable[str]) -> str:
    """Return a list of lines."""
    return f"<ul>{''.join(f'<li>{escape(line)}</li>' for line in lines)}</ul>"


def code(text: str) -> str:
    """Return commands, or a file, as they are."""
    return f"<pre>{escape(text.rstrip())}</pre>"


def table_head(names: Sequence[str], numbers: Iterable[int]) -> str:
    """Return the head of a table; numbers: the columns that hold any."""
    chosen = set(numbers)
    cells = "".join(
        f"<th{' class=number' if index in chosen else ''}>{escape(name)}</th>"
        for index, name in enumerate(names)
    )
    return f"<tr>{cells}</tr>"


def data(figure: Figure) -> str:
    """Return the attributes that hold a figure of summary.json in full."""
    if not figure.key:
        return ""
    return f' data-key="{escape(figure.key)}" data-value="{escape(json.dumps(figure.value))}"'


def provenance(known: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the code, packages and host that produced something, by its summary."""
    commit = known.get("commit")
    source = f"{commit}{' (modified)' if known.get('commit_dirty') else ''}" if commit else UNKNOWN
    host = known.get("host") or {}
    machine = ", ".join(str(host[key]) for key in ("os", "kernel", "machine") if key in host)
    cpus = f", {host['cpus']} CPUs" if "cpus" in host else ""
    packages = (known.get("packages") or {}).items()
    return [
        ("qswarm", str(known.get("version") or UNKNOWN)),
        ("commit", source),
        ("Python", str(known.get("python") or UNKNOWN)),
        ("packages", ", ".join(f"{name} {version}" for name, version in packages) or UNKNOWN),
        ("host", f"{machine}{cpus}" or UNKNOWN),
    ]


def _cell(figure: Figure, number: bool) -> str:
    kind = ' class="number"' if number else ""
    return f"<td{kind}{data(figure)}>{escape(figure.text)}</td>"
