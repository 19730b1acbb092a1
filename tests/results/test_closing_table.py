"""The verdict on a terminal: its table, the invariants in words, and colours by result."""

import io
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from tests.small_scenario import SMALL
from worldsim.campaign.pool import finished
from worldsim.engine.virtual import fly
from worldsim.results.closing_table import draw_verdict
from worldsim.results.summary import Summary, summarise
from worldsim.scenario.file import parse

RED, GREEN = "\x1b[1;31m", "\x1b[32m"


@pytest.fixture(scope="module")
def summary() -> Summary:
    scenario = parse(SMALL)
    return summarise(scenario, finished(fly(scenario), scenario))


def drawn(summary: Summary, *, coloured: bool = False, **changes: Any) -> str:
    output = io.StringIO()
    changed: Any = {**summary, **changes}
    colours: Any = "standard" if coloured else None
    console = Console(file=output, width=110, force_terminal=coloured, color_system=colours)
    draw_verdict(console, changed, Path("runs/small"), recorded=False)
    return output.getvalue()


def row(name: str, wanted: Any, got: Any, held: bool | None, margin: Any = None) -> dict[str, Any]:
    return {"name": name, "wanted": wanted, "got": got, "margin": margin, "held": held}


@pytest.mark.parametrize(
    ("expectation", "cells"),
    [
        (
            row("min_separation_m", 0.25, 0.1, False, -0.15),
            ["minimum separation", ">= 0.25 m", "0.100 m", "-0.150 m", "NOT MET"],
        ),
        (
            row("in_formation_fraction", 0.95, None, None),
            ["time in formation", ">= 95 %", "no time counted", "not judged"],
        ),
        (
            row("converge vee", 15.0, 11.8, True, 3.2),
            ["vee converges", "<= 15 s", "11.8 s", "3.2 s", "met"],
        ),
        (
            row("converge vee", 4.0, None, False),
            ["vee converges", "<= 4 s", "did not converge within 4 s", "NOT MET"],
        ),
        (
            row("converge vee", None, None, None),
            [
                "vee converges",
                "by the end",
                "did not converge in 5 s: the run ended too early",
                "not judged",
            ],
        ),
        (
            row("reform_within_s", 10.0, 3.25, True, 6.75),
            ["formation restored after each fault", "<= 10 s", "3.25 s", "6.75 s", "met"],
        ),
        (
            row("reform_within_s", 10.0, None, True),
            [
                "formation restored after each fault",
                "<= 10 s",
                "not tested, none took it away",
                "not tested",
            ],
        ),
        (row("added_later", 1, 2, True), ["added_later", "1", "2", "met"]),
    ],
)
def test_an_expectation_is_a_row(
    summary: Summary, expectation: dict[str, Any], cells: list[str]
) -> None:
    line = drawn(summary, expectations=[expectation]).splitlines()[4]
    assert [cell.strip() for cell in line.split("  ") if cell.strip()] == cells


def test_invariants_are_told_in_words(summary: Summary) -> None:
    tallies = {
        "I1": {"ticks": 400, "violations": 0},
        "I4": {"ticks": 400, "violations": 12},
        "I8": {"ticks": 0, "violations": 0},
    }
    told = [
        "two agents kept claiming one slot (I4), in 12 of 400 ticks",
        "  invariants held: I1",
        "  invariants never evaluated: I8",
    ]
    for outcome, word in (("fail", "FAIL"), ("inconclusive", "violated, not judged")):
        lines = drawn(summary, outcome=outcome, invariants=tallies).splitlines()
        start = lines.index(f"  {word}: {told[0]}")
        assert lines[start + 1 : start + 3] == told[1:]


def test_colours_and_escapes(summary: Summary) -> None:
    failed = row("min_separation_m", 0.25, 0.1, False)
    text = drawn(summary, coloured=True, expectations=[failed], outcome="fail", reason="\x1b[2J")
    assert f"{RED}NOT MET" in text
    assert f"{RED}fail (\\x1b[2J)" in text
    assert "\x1b[2J" not in text
    assert f"{GREEN}met" in drawn(summary, coloured=True)
