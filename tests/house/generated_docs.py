"""The parts of the documents made from the code: layout, topics, messages, tables of a run.

    python -m tests.house.generated_docs        # writes them anew

A part stands between ``<!-- NAME: generated -->`` and ``<!-- end -->``. A test compares each with
what the code says now.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from netem.wire.keys import TOPICS
from tests.house.wire_tables import wire_messages, wire_topics
from worldsim.engine.process_life import diagram
from worldsim.results.run_tables import LAYOUTS

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("netem", "agent", "worldsim")
PART = re.compile(r"(<!-- (\w+): generated -->\n)(.*?)(<!-- end -->)", re.DOTALL)


def layout() -> str:
    """Return every package with what it is for, as a tree."""
    lines = [
        f"{'  ' * (len(folder.parts) - 1)}{folder.name + '/':{24 - 2 * len(folder.parts)}}"
        f"{_purpose(ROOT / folder / '__init__.py')}"
        for folder in _packages()
    ]
    return "\n".join(["```", *lines, "```", ""])


def modules() -> str:
    """Return a table of the modules of each package, with what each is for."""
    blocks = []
    for folder in _packages():
        files = sorted((ROOT / folder).glob("*.py"))
        rows = [f"| `{file.name}` | {_purpose(file)} |" for file in files if file.stem[0] != "_"]
        head = [f"**`{folder}/`** {_purpose(ROOT / folder / '__init__.py')}", ""]
        table = ["| module | what it is for |", "|---|---|", *rows, ""] if rows else []
        blocks += [*head, *table]
    return "\n".join(blocks)


def topics() -> str:
    """Return the table of topics: key, who puts, who gets, rate, quality of service."""
    rows = [
        f"| `{topic.template}` | {topic.publisher} | {topic.subscriber} | {topic.rate}"
        f" | {'reliable' if topic.blocking else 'newest wins'} | {topic.content} |"
        for topic in TOPICS.values()
    ]
    head = [
        "| key under `qswarm/<run>/` | from | to | rate | service | carries |",
        "|" + "---|" * 6,
    ]
    return "\n".join([*head, *rows, ""])


def process_life() -> str:
    """Return the diagram of a process's life."""
    return f"```mermaid\n{diagram()}\n```\n"


def run_tables() -> str:
    """Return the tables of a run with their columns: unit, frame, meaning."""
    blocks = []
    for name, layout in LAYOUTS.items():
        rows = [
            f"| `{column.name}` | {column.kind} | {column.unit or '-'} | {column.frame or '-'}"
            f" | {column.says} |"
            for column in layout.columns
        ]
        head = ["| column | kind | unit | frame | holds |", "|" + "---|" * 5]
        blocks += [f"### {name}", "", f"{layout.says[0].upper()}{layout.says[1:]}.", ""]
        blocks += [*head, *rows, ""]
    return "\n".join(blocks)


PARTS = {
    "layout": layout,
    "modules": modules,
    "topics": topics,
    "process_life": process_life,
    "run_tables": run_tables,
    "wire_topics": wire_topics,
    "wire_messages": wire_messages,
}


def documents() -> list[Path]:
    """Return the documents that have generated parts."""
    files = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    return [file for file in files if PART.search(file.read_text(encoding="utf-8"))]


def renewed(text: str) -> str:
    """Return a document with its generated parts as the code has them now."""
    return PART.sub(lambda part: part[1] + PARTS[part[2]]() + part[4], text)


def main() -> int:
    """Write the generated parts of all documents anew."""
    for file in documents():
        file.write_text(renewed(file.read_text(encoding="utf-8")), encoding="utf-8")
    return 0


def _packages() -> Iterator[Path]:
    for package in PACKAGES:
        inits = sorted((ROOT / package).rglob("__init__.py"))
        yield from (init.parent.relative_to(ROOT) for init in inits)


def _purpose(file: Path) -> str:
    """Return the first sentence of a module's docstring."""
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())


if __name__ == "__main__":
    sys.exit(main())
