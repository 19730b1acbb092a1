"""Figures beside saved ones: ratios, what is worse, and what makes them incomparable."""

from math import inf

import msgspec
import pytest

from worldsim.bench.comparison import Change, change, differences
from worldsim.bench.lines import line, summary_line
from worldsim.bench.measures import Row
from worldsim.bench.saved_figures import Saved, SavedHost, SavedRow

HOST = SavedHost("Linux", "x86_64", 2, "Some CPU")
FIGURES = Saved(
    format="qswarm-bench",
    schema=1,
    code="pure Python",
    commit="a" * 40,
    commit_dirty=False,
    python="3.11.7",
    packages={"numpy": "2.0", "msgspec": "0.20"},
    host=HOST,
    repeats=3,
    seconds=None,
    rows=(),
)


def row(measured: float | None, more: bool = False, goal: float | None = None) -> Row:
    invalid = None if measured is not None else "not converged"
    return Row("a row", "us", goal, measured, more, invalid)


def before(measured: float | None, more: bool = False, unit: str = "us") -> SavedRow:
    return SavedRow("a row", unit, measured, more)


@pytest.mark.parametrize(
    ("now", "then", "more", "ratio", "worse_percent"),
    [
        (120.0, 100.0, False, 1.2, 20.0),
        (50.0, 100.0, False, 0.5, 0.0),
        (50.0, 100.0, True, 0.5, 100.0),
        (120.0, 100.0, True, 1.2, 0.0),
        (0.0, 0.0, False, 1.0, 0.0),
        (1.0, 0.0, False, inf, inf),
        (0.0, 1.0, True, 0.0, inf),
    ],
)
def test_the_ratio_is_to_the_saved_figure_and_worse_depends_on_the_row(
    now: float, then: float, more: bool, ratio: float, worse_percent: float
) -> None:
    found = change(row(now, more), before(then, more))
    assert found.ratio == pytest.approx(ratio)
    assert found.worse_percent == pytest.approx(worse_percent)


def test_a_difference_below_the_grain_is_not_worse() -> None:
    assert change(row(0.4), before(0.1), grain=0.5).worse_percent == 0.0
    assert change(row(0.7), before(0.1), grain=0.5).worse_by(10.0)


def test_the_limit_itself_is_not_exceeded() -> None:
    assert not change(row(110.0), before(100.0)).worse_by(10.0)
    assert change(row(110.1), before(100.0)).worse_by(10.0)


@pytest.mark.parametrize(
    ("saved", "note"),
    [
        (None, "not in the file"),
        (before(1.0, unit="ms"), "saved in ms: not comparable"),
        (before(1.0, more=True), "saved in us: not comparable"),
        (before(None), "saved as invalid"),
    ],
)
def test_what_is_not_comparable_has_no_ratio_and_is_not_worse(
    saved: SavedRow | None, note: str
) -> None:
    assert change(row(5.0), saved) == Change(None, 0.0, note)


def test_a_figure_that_became_invalid_is_worse() -> None:
    found = change(row(None), before(7.0))
    assert (found.ratio, found.worse_by(1e9)) == (None, True)
    printed = squeezed(line(row(None, goal=3.0), found))
    assert printed == "a row - invalid: not converged; saved 7 WORSE"


def test_equal_circumstances_need_no_warning() -> None:
    assert list(differences(FIGURES, FIGURES)) == []


@pytest.mark.parametrize(
    ("changes", "warning"),
    [
        (
            {"host": SavedHost("Linux", "aarch64", 8, None)},
            "another machine: Linux aarch64, 8 x an unknown processor;"
            " now Linux x86_64, 2 x Some CPU",
        ),
        ({"python": "3.12.1"}, "another Python: 3.12.1; now 3.11.7"),
        ({"packages": {"numpy": "1.0", "msgspec": "0.20"}}, "other versions of numpy"),
        (
            {"code": "compiled (9 of 20 modules)"},
            "another form of the code: compiled (9 of 20 modules); now pure Python",
        ),
        ({"commit_dirty": True}, "the saved figures are of a modified commit, aaaaaaaaaaaa"),
        ({"repeats": 5}, "the best of 5; now of 3"),
        ({"seconds": 8.0}, "fleets of processes flew 8 s; now their own time"),
    ],
)
def test_each_difference_is_named(changes: dict[str, object], warning: str) -> None:
    then = msgspec.structs.replace(FIGURES, **changes)
    assert list(differences(FIGURES, then)) == [warning]


def test_a_modified_commit_of_this_code_is_named() -> None:
    now = msgspec.structs.replace(FIGURES, commit=None, commit_dirty=True)
    assert list(differences(now, FIGURES)) == ["this code is a modified commit, unknown"]


def test_a_line_has_figure_ratio_and_goal() -> None:
    wanting = row(12.0, goal=10.0)
    assert squeezed(line(wanting)) == "a row 12.0 us goal <= 10 not reached"
    compared = line(wanting, Change(1.2, 20.0, "10"))
    assert squeezed(compared) == "a row 12.0 us 1.20 x 10 WORSE goal <= 10 not reached"
    new = line(row(12.0), Change(None, 0.0, "not in the file"))
    assert squeezed(new) == "a row 12.0 us not in the file"


def squeezed(text: str) -> str:
    return " ".join(text.split())


def test_the_last_line_names_what_got_worse() -> None:
    changes = {
        "a": Change(1.2, 20.0, "10"),
        "b": Change(1.05, 5.0, "10"),
        "c": Change(None, inf, "10"),
        "d": Change(None, 0.0, "not in the file"),
    }
    assert summary_line(changes, "f.json") == (
        "against f.json: 2 compared, 2 worse by more than 10 %: a; c"
    )
