"""What a sweep shows: shares by cell, a break for each number, tables and figures."""

from pathlib import Path

import pytest

from worldsim.sweep.figures import sweep_figures
from worldsim.sweep.flight_row import FIGURES, FlightRow
from worldsim.sweep.logistic import Point, break_of
from worldsim.sweep.plan import Axis, FlightKey, Plan
from worldsim.sweep.result import Rows, break_text, breaks_of, cells_of, summary_of
from worldsim.sweep.sweep_tables import cells_table, flights_table
from worldsim.sweep.sweep_text import closing_line, repeat_text

PLAN = Plan(
    (
        Axis("netem.loss_percent", ("0", "50", "90")),
        Axis("control.controller", ("a", "b")),
        Axis("netem.delay_ms", ("0", "200.5")),
    ),
    range(10),
)
PASSING = {"a": (10, 8, 1), "b": (10, 10, 10)}
"""By controller: the seeds that pass at each loss."""


def flown(plan: Plan = PLAN) -> Rows:
    rows: dict[FlightKey, FlightRow] = {}
    for key in plan.flights():
        own = plan.settings(key.cell)
        loss = PLAN.axes[0].values.index(own["netem.loss_percent"])
        passes = key.seed < PASSING[own["control.controller"]][loss]
        rows[key] = {
            "cell": key.cell,
            "seed": key.seed,
            "outcome": "pass" if passes else "fail",
            "reason": None if passes else "too late",
            "figures": {"converge_s": 5.0 + key.seed if passes else None},
            "trace_sha256": None,
        }
    return rows


def test_a_break_is_found_with_the_other_keys_held() -> None:
    breaks = breaks_of(PLAN, cells_of(PLAN, flown()))
    found = {(row["key"], *row["where"].values()): row for row in breaks}
    assert len(found) == len(breaks) == 4 + 6
    row = found["netem.loss_percent", "a", "0"]
    assert row["kind"] == "break"
    assert row["text"].startswith("breaks at 65.6")
    assert found["netem.loss_percent", "b", "0"]["kind"] == "all pass"
    assert found["netem.delay_ms", "90", "a"]["kind"] == "no trend"


@pytest.mark.parametrize(
    ("passed", "says"),
    [
        ((20, 20, 14), "holds from 0 to 20: more than half pass; the curve reaches one half at 2"),
        ((8, 2, 0), "fails from 0 to 20: less than half pass; the curve reaches one half at -"),
        ((0, 2, 8), "fails from 0 to 20: less than half pass; the curve reaches one half at 2"),
        ((14, 20, 20), "holds from 0 to 20: more than half pass; the curve reaches one half at -"),
        ((16, 13, 9), "on, no upper bound in what was flown)"),
        ((20, 20, 0), "breaks at a value between 10 (all pass) and 20 (all fail); no curve fits"),
        ((0, 20, 20), "holds from a value between 0 (all fail) and 10 (all pass); no curve fits"),
    ],
)
def test_a_break_in_words(passed: tuple[int, ...], says: str) -> None:
    found = break_of([Point(10.0 * index, each, 20) for index, each in enumerate(passed)])
    assert says in break_text(found, 0.0, 20.0)


def test_a_flight_that_is_not_there_counts_nowhere() -> None:
    rows = {key: row for key, row in flown().items() if key != FlightKey(0, 3)}
    cell = cells_of(PLAN, rows)[0]
    assert (cell["flights"], cell["pass"], cell["pass_share"]) == (9, 9, 1.0)
    summary = summary_of(PLAN, "small", rows, "interrupted")
    assert summary["reason"] == "interrupted: 119 of 120 flights done"
    assert summary["outcome"] == "fail"
    so_far = "interrupted: 119 of 120 flights done, 97 pass, 22 fail"
    goes_on = "the same command with --out 'my runs' goes on"
    assert closing_line(summary, Path("my runs")) == f"{so_far}; {goes_on}  my runs/summary.json"
    lost = summary_of(PLAN, "small", rows, "tcp://h:1: the scheduler is gone")
    assert closing_line(lost, Path("r")).startswith("fail: tcp://h:1: the scheduler is gone: 119")


@pytest.mark.parametrize(("cut", "outcome"), [(None, "pass"), ("interrupted", "inconclusive")])
def test_the_outcome_is_that_of_many_runs(cut: str | None, outcome: str) -> None:
    passing = {key: row for key, row in flown().items() if row["outcome"] == "pass"}
    assert summary_of(PLAN, "small", passing, cut)["outcome"] == outcome


def test_inconclusive_flights_are_not_in_the_share() -> None:
    rows = dict(flown())
    rows[FlightKey(0, 0)] = {**rows[FlightKey(0, 0)], "outcome": "inconclusive"}
    cell = cells_of(PLAN, rows)[0]
    assert (cell["pass"], cell["inconclusive"], cell["pass_share"]) == (9, 1, 1.0)


def test_every_row_holds_the_varied_keys() -> None:
    table = flights_table(PLAN, flown())
    assert table.rows == 120
    assert [(each.name, each.kind) for each in table.layout.columns[:4]] == [
        ("netem.loss_percent", "integer"),
        ("control.controller", "text"),
        ("netem.delay_ms", "number"),
        ("seed", "integer"),
    ]
    assert {column.name for column in FIGURES} <= table.keys()
    assert cells_table(PLAN, cells_of(PLAN, flown())).rows == 12


def test_a_failure_can_be_repeated() -> None:
    assert repeat_text(PLAN, flown(), "small.toml") == (
        "repeat a failure: qswarm sim small.toml --seed 8 --set netem.loss_percent=50"
        " --set control.controller=a --set netem.delay_ms=0"
    )


def test_two_numbers_have_a_map_and_every_key_its_curves() -> None:
    plan = Plan(
        (Axis("netem.loss_percent", ("0", "50")), Axis("netem.delay_ms", ("0", "9"))), PLAN.seeds
    )
    rows = {FlightKey(cell, seed): flown()[FlightKey(cell, seed)] for cell, seed in plan.flights()}
    names = [figure.name for figure in sweep_figures(plan, cells_of(plan, rows))]
    assert names == [
        "along-netem.loss_percent",
        "along-netem.delay_ms",
        "map-netem.loss_percent-by-netem.delay_ms",
    ]
