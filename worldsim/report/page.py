"""The page of a report on runs.

A figure of summary.json stands in the page as text for a reader, and as an attribute ``data-key``
with its full value for a program.
"""

from collections.abc import Sequence
from html import escape

from worldsim.report import page_parts as parts
from worldsim.report import rows
from worldsim.report.page_parts import DrawnFigure, Figure
from worldsim.report.rows import ExpectationCells
from worldsim.results.run import Run

MAX_DRAWN = 6
"""Of more runs, no figures are drawn."""
_EXPECTATION_HEAD = ("expectation", "required", "got", "margin", "")


def page(reports: Sequence[tuple[Run, Sequence[DrawnFigure]]]) -> str:
    """Return the page of one run, or of several side by side."""
    runs = [run for run, _ in reports]
    several = len(runs) > 1
    title = f"{len(runs)} runs" if several else runs[0].scenario.name
    sections = [_comparison(runs, title)] if several else []
    for number, (run, figures) in enumerate(reports if len(runs) <= MAX_DRAWN else ()):
        sections.append(
            run_section(run, figures, number) if several else run_part(run, figures, number)
        )
    return parts.document(title, sections)


def run_section(run: Run, figures: Sequence[DrawnFigure], number: int) -> str:
    """Return what is to say of one run, below something else."""
    body = run_part(run, figures, number, rows.name_of(run))
    return f'<section class="run" id="run-{number}">{body}</section>'


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


def run_part(
    run: Run, figures: Sequence[DrawnFigure], number: int, name: str = "qswarm report"
) -> str:
    """Return what is to say of one run. number: apart from those of other runs on the page."""
    verdict = rows.verdict_of(run)
    reason = verdict.reason or "every expectation met, no invariant violated"
    return "\n".join(
        [
            f'<p class="kind">{escape(name)}</p>',
            f"<h1>{escape(run.scenario.name)}</h1>",
            f'<p class="lead">{escape(rows.heading(run))}</p>',
            parts.verdict_box(verdict.outcome, reason),
            parts.notes_box(run.notes),
            parts.tiles(rows.tiles(run)),
            f'<p class="checked">{escape(rows.agreement(run))}</p>',
            "<h2>What was required</h2>",
            _expectations(run),
            _formations(run),
            _faults(run),
            "<h2>Figures</h2>",
            *(parts.drawn(figure, f"{number}-{figure.name}-") for figure in figures),
            "<h2>Invariants</h2>",
            '<p class="caption">What must hold at every tick, at how many ticks it was evaluated,'
            " and at how many it was violated.</p>",
            parts.table(
                ("invariant", "broken when", "ticks evaluated", "violations"),
                rows.invariant_rows(run),
                numbers=2,
            ),
            "<h2>Provenance</h2>",
            parts.pairs(rows.provenance_rows(run)),
        ]
    )


def _expectations(run: Run) -> str:
    kinds = {"met": "met", "NOT MET": "missed", "open": "open"}
    body = "".join(
        f"<tr><td>{escape(row.name)}{_words(row)}</td>"
        f'<td class="number">{escape(row.required)}</td>'
        f'<td class="number"{parts.data(row.got)}>{escape(row.got.text)}</td>'
        f'<td class="number"{parts.data(row.margin)}>{escape(row.margin.text)}</td>'
        f'<td class="{kinds.get(row.verdict, "")}">{escape(row.verdict)}</td></tr>'
        for row in rows.expectation_cells(run)
    )
    return f"<table>{parts.table_head(_EXPECTATION_HEAD, (1, 2, 3))}{body}</table>"


def _words(row: ExpectationCells) -> str:
    """Return what the run showed of an expectation, where its figures do not say it all."""
    return "" if row.verdict == "met" else f"<small>{escape(row.text)}</small>"


def _formations(run: Run) -> str:
    if not rows.phases_of(run):
        return ""
    head = ("formation", "asked for at", "converged in", "slot error at its end")
    return f"<h3>Formations</h3>{parts.table(head, rows.phase_rows(run), numbers=1)}"


def _faults(run: Run) -> str:
    lines = rows.fault_lines(run)
    if not lines:
        return ""
    return f"<h3>Faults</h3>{parts.listed(lines)}"
