"""The page of a report: one HTML file with its style and its figures inside.

It asks nothing of any host, and it has no script. A figure of summary.json stands in the page as
text for a reader, and as an attribute ``data-key`` with its full value for a program.
"""

import json
import re
from collections.abc import Iterable, Sequence
from html import escape

from worldsim.report import rows
from worldsim.report.figures import DrawnFigure
from worldsim.report.page_style import CSS
from worldsim.report.rows import ExpectationCells, Figure
from worldsim.results.run import Run

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""What a browser may load for the page: images that the page itself holds."""
MAX_DRAWN = 6
"""Of more runs, no figures are drawn."""
_ID = re.compile(r'(\bid="|url\(#|href="#)')
_EXPECTATION_HEAD = ("expectation", "required", "got", "margin", "")


def page(reports: Sequence[tuple[Run, Sequence[DrawnFigure]]]) -> str:
    """Return the page of one run, or of several side by side."""
    runs = [run for run, _ in reports]
    several = len(runs) > 1
    title = f"{len(runs)} runs" if several else runs[0].scenario.name
    parts = [_comparison(runs, title)] if several else []
    for number, (run, figures) in enumerate(reports if len(runs) <= MAX_DRAWN else ()):
        body = _run(run, figures, number, several)
        parts.append(
            f'<section class="run" id="run-{number}">{body}</section>' if several else body
        )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)} - qswarm report</title>\n<style>{CSS}</style>\n</head>\n<body>\n"
        f"<main>\n{''.join(parts)}\n</main>\n</body>\n</html>\n"
    )


def _comparison(runs: list[Run], title: str) -> str:
    """Return the figures of runs side by side; of many runs, one below the other."""
    names, compared = [rows.name_of(run) for run in runs], rows.comparison_rows(runs)
    drawn = len(runs) <= MAX_DRAWN
    if drawn:
        links = [f'<a href="#run-{number}">{escape(name)}</a>' for number, name in enumerate(names)]
        head, lines = links, [(name, cells) for name, cells in compared]
    else:
        columns = zip(*(cells for _, cells in compared), strict=True)
        head = [escape(name) for name, _ in compared]
        lines = [(name, list(cells)) for name, cells in zip(names, columns, strict=True)]
    top = "".join(f'<th class="number">{name}</th>' for name in head)
    body = "".join(
        f'<tr><td class="key">{escape(name)}</td>{"".join(map(_compared, cells))}</tr>'
        for name, cells in lines
    )
    left_out = f"Figures are drawn of up to {MAX_DRAWN} runs."
    return (
        f'<p class="kind">qswarm report</p><h1>{escape(title)}</h1>'
        f'<p class="lead">{"Side by side." if drawn else left_out}</p>'
        f'<div class="scroll"><table><tr><th></th>{top}</tr>{body}</table></div>'
    )


def _compared(figure: Figure) -> str:
    kind = {"fail": " missed", "inconclusive": " open"}.get(figure.text, "")
    return f'<td class="number{kind}">{escape(figure.text)}</td>'


def _run(run: Run, figures: Sequence[DrawnFigure], number: int, several: bool) -> str:
    verdict = rows.verdict_of(run)
    reason = escape(verdict.reason) or "every expectation met, no invariant violated"
    parts = [
        f'<p class="kind">{escape(rows.name_of(run)) if several else "qswarm report"}</p>',
        f"<h1>{escape(run.scenario.name)}</h1>",
        f'<p class="lead">{escape(rows.heading(run))}</p>',
        f'<div class="verdict {escape(verdict.outcome)}"><b>{escape(verdict.outcome)}</b>'
        f"<span>{reason}</span></div>",
        _notes(run),
        _tiles(run),
        f'<p class="checked">{escape(rows.agreement(run))}</p>',
        "<h2>What was required</h2>",
        _expectations(run),
        _formations(run),
        _faults(run),
        "<h2>Figures</h2>",
        *(_figure(figure, f"{number}-{figure.name}-") for figure in figures),
        "<h2>Invariants</h2>",
        '<p class="caption">What must hold at every tick, at how many ticks it was evaluated, and'
        " at how many it was violated.</p>",
        _table(
            ("invariant", "broken when", "ticks evaluated", "violations"),
            rows.invariant_rows(run),
            numbers=2,
        ),
        "<h2>Provenance</h2>",
        _provenance(run),
    ]
    return "\n".join(parts)


def _notes(run: Run) -> str:
    if not run.notes:
        return ""
    return f'<div class="notes">{"".join(f"<p>{escape(note)}</p>" for note in run.notes)}</div>'


def _tiles(run: Run) -> str:
    cells = "".join(
        f"<div><span>{escape(name)}</span><b{_data(figure)}>{escape(figure.text)}</b></div>"
        for name, figure in rows.tiles(run)
    )
    return f'<div class="tiles">{cells}</div>'


def _expectations(run: Run) -> str:
    kinds = {"met": "met", "NOT MET": "missed", "open": "open"}
    body = "".join(
        f"<tr><td>{escape(row.name)}{_words(row)}</td>"
        f'<td class="number">{escape(row.required)}</td>'
        f'<td class="number"{_data(row.got)}>{escape(row.got.text)}</td>'
        f'<td class="number"{_data(row.margin)}>{escape(row.margin.text)}</td>'
        f'<td class="{kinds.get(row.verdict, "")}">{escape(row.verdict)}</td></tr>'
        for row in rows.expectation_cells(run)
    )
    return f"<table>{_head(_EXPECTATION_HEAD, (1, 2, 3))}{body}</table>"


def _words(row: ExpectationCells) -> str:
    """Return what the run showed of an expectation, where its figures do not say it all."""
    return "" if row.verdict == "met" else f"<small>{escape(row.text)}</small>"


def _formations(run: Run) -> str:
    if not rows.phases_of(run):
        return ""
    head = ("formation", "asked for at", "converged in", "slot error at its end")
    return f"<h3>Formations</h3>{_table(head, rows.phase_rows(run), numbers=1)}"


def _faults(run: Run) -> str:
    lines = rows.fault_lines(run)
    if not lines:
        return ""
    return f"<h3>Faults</h3><ul>{''.join(f'<li>{escape(line)}</li>' for line in lines)}</ul>"


def _figure(figure: DrawnFigure, prefix: str) -> str:
    return (
        f"<h3>{escape(figure.title)}</h3>"
        f'<p class="caption">{escape(figure.caption)}</p>'
        f'<figure role="img" aria-label="{escape(figure.title)}">'
        f"{_inline(figure.svg, prefix)}</figure>"
    )


def _inline(svg: str, prefix: str) -> str:
    """Return an SVG file as a part of a page, its ids apart from those of other figures."""
    return _ID.sub(lambda match: match[1] + prefix, svg[svg.index("<svg") :])


def _provenance(run: Run) -> str:
    body = "".join(
        f'<tr><td class="key">{escape(name)}</td><td class="code">{escape(text)}</td></tr>'
        for name, text in rows.provenance_rows(run)
    )
    return f"<table>{body}</table>"


def _table(head: Sequence[str], body: Iterable[Sequence[Figure]], numbers: int) -> str:
    """Return a table; from column ``numbers`` on it holds numbers."""
    lines = "".join(
        f"<tr>{''.join(_cell(cell, index >= numbers) for index, cell in enumerate(row))}</tr>"
        for row in body
    )
    return f"<table>{_head(head, range(numbers, len(head)))}{lines}</table>"


def _cell(figure: Figure, number: bool) -> str:
    kind = ' class="number"' if number else ""
    return f"<td{kind}{_data(figure)}>{escape(figure.text)}</td>"


def _head(names: Sequence[str], numbers: Iterable[int]) -> str:
    chosen = set(numbers)
    cells = "".join(
        f"<th{' class=number' if index in chosen else ''}>{escape(name)}</th>"
        for index, name in enumerate(names)
    )
    return f"<tr>{cells}</tr>"


def _data(figure: Figure) -> str:
    """Return the attributes that hold a figure of summary.json in full."""
    if not figure.key:
        return ""
    return f' data-key="{escape(figure.key)}" data-value="{escape(json.dumps(figure.value))}"'
