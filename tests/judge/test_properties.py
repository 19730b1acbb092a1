"""Properties of the user's own: what counts, what is found at which tick, and what stays open."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import msgspec
import numpy as np
import pytest

from tests.recording.flights import straight_flight, wedge
from worldsim.judge.finding import Expectation
from worldsim.judge.radio_events import Healed, Partitioned
from worldsim.judge.run_events import RunEvent
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Judge
from worldsim.results.expectation_text import Circumstances, expectation_texts
from worldsim.scenario.file import parse
from worldsim.scenario.properties import Property
from worldsim.scenario.tables import Expectations, Scenario
from worldsim.scenario.toml import ScenarioError

TICK_S, END_S = 0.05, 6.0
SMALL = wedge(3, END_S)
Signals = Callable[[float], list[float]]


def scenario(*properties: Property, **changes: Any) -> Scenario:
    expect = Expectations(converge=False, property=properties)
    made: Scenario = msgspec.structs.replace(SMALL, expect=expect, **changes)
    return made


def ticks_of(x: Signals, until_s: float = END_S) -> list[Tick]:
    """Return a flight in which three agents state the signal x; NaN: one does not."""
    ticks = []
    for tick in straight_flight(SMALL):
        if tick.time_s <= until_s:
            ticks.append(replace(tick, signals={"x": np.array(x(tick.time_s))}))
    return ticks


def judged(
    ticks: list[Tick], *properties: Property, events: tuple[RunEvent, ...] = (), **changes: Any
) -> Judge:
    judge, waiting = Judge(scenario(*properties, **changes)), list(events)
    for tick in ticks:
        while waiting and waiting[0].t_s <= tick.time_s + 1e-9:
            judge.handle_event(waiting.pop(0))
        judge.see(tick)
    return judge


def found(ticks: list[Tick], wanted: Property, **given: Any) -> Expectation:
    *_, own = judged(ticks, wanted, **given).expectations()
    return own


def steady(*values: float) -> Signals:
    return lambda _: list(values)


def step_at(t_s: float, before: float, after: float) -> Signals:
    return lambda now_s: [before if now_s < t_s - 1e-9 else after] * 3


@pytest.mark.parametrize(
    ("over", "value"), [("mean", 2.0), ("least", 1.0), ("most", 3.0), ("spread", 2.0)]
)
def test_one_number_of_the_team_keeps_the_bound(over: Any, value: float) -> None:
    for slack, held in ((0.1, True), (-0.1, False)):
        wanted = Property(signal="x", over=over, at_most=value + slack)
        row = found(ticks_of(steady(1.0, 2.0, 3.0)), wanted)
        assert (row.got, row.held) == (value, held)
        assert row.margin == pytest.approx(slack)


def test_always_names_the_worst_value_of_any_agent_at_any_tick() -> None:
    rising = ticks_of(lambda now_s: [0.0, now_s, np.nan])
    row = found(rising, Property(signal="x", at_least=-1.0, at_most=5.0))
    assert (row.wanted, row.held, row.at_least) == (5.0, False, False)
    assert row.got == pytest.approx(END_S, abs=TICK_S)
    low = found(rising, Property(signal="x", at_least=0.5))
    assert (low.got, low.margin, low.at_least) == (0.0, -0.5, True)


def test_a_signal_that_nobody_states_is_not_judged() -> None:
    for must in ("always", "eventually", "settle"):
        wanted = Property(signal="y", at_most=1.0, must=must)  # type: ignore[arg-type]
        judge = judged(ticks_of(steady(1.0, 1.0, 1.0)), wanted)
        assert judge.expectations()[-1].held is None
        assert judge.shortcomings().unjudged == [f"{must} y <= 1"]


def test_a_limit_beyond_the_end_of_the_run_is_not_missed() -> None:
    wanted = Property(signal="x", at_least=1.0, must="eventually", within_s=50.0)
    assert found(ticks_of(steady(0.0, 0.0, 0.0)), wanted).held is None


@pytest.mark.parametrize(
    ("within_s", "until_s", "got", "held"),
    [
        (None, END_S, 3.0, True),
        (3.0, END_S, 3.0, True),
        (2.9, END_S, 3.0, False),
        (None, 2.5, None, None),
        (2.0, 2.5, None, False),
        (4.0, 2.5, None, None),
        (50.0, 2.9, None, None),
    ],
)
def test_eventually_is_timed(
    within_s: float | None, until_s: float, got: float | None, held: bool | None
) -> None:
    wanted = Property(signal="x", at_least=1.0, must="eventually", within_s=within_s)
    row = found(ticks_of(step_at(3.0, 0.0, 1.0), until_s), wanted)
    assert (row.got, row.held) == (pytest.approx(got) if got else None, held)


def test_what_never_happens_to_the_end_has_failed() -> None:
    row = found(
        ticks_of(steady(0.0, 0.0, 0.0)), Property(signal="x", at_least=1, must="eventually")
    )
    assert (row.got, row.held) == (None, False)


def test_to_settle_is_to_hold_to_the_end_for_two_seconds() -> None:
    wanted = Property(signal="x", at_least=1.0, must="settle", within_s=3.5)
    assert found(ticks_of(step_at(3.0, 0.0, 1.0)), wanted).held is True
    assert found(ticks_of(step_at(3.0, 0.0, 1.0), until_s=4.5), wanted).held is None
    assert found(ticks_of(step_at(5.0, 0.0, 1.0), until_s=4.5), wanted).held is False

    def breaks(now_s: float) -> list[float]:
        return [0.0 if now_s < 1.0 or 3.7 < now_s < 3.8 else 1.0] * 3

    row = found(ticks_of(breaks), wanted)
    assert (row.got, row.held) == (pytest.approx(3.8), False)
    assert found(ticks_of(breaks), msgspec.structs.replace(wanted, within_s=None)).held is True


def test_only_the_asked_times_count() -> None:
    spike = ticks_of(lambda now_s: [9.0 if 1.99 < now_s < 2.01 else 0.0] * 3)
    for from_s, to_s, held in ((0.0, None, False), (2.1, None, True), (0.0, 1.9, True)):
        wanted = Property(signal="x", at_most=1.0, from_s=from_s, to_s=to_s)
        assert found(spike, wanted).held is held


def test_ticks_that_a_fault_takes_do_not_count_where_they_shall_not() -> None:
    parted = Partitioned(
        t_s=1.0,
        agent=None,
        planned=True,
        number=1,
        groups=((0,), (1, 2)),
        parted="clean",
        bridge=(),
    )
    events = (parted, Healed(t_s=2.0, agent=None, planned=True, number=1))
    for low_s, counted, held in (
        (1.5, "all", False),
        (1.5, "undisturbed", True),
        (2.5, "undisturbed", True),  # in the window of the fault's end
        (5.0, "undisturbed", False),
    ):
        dip = ticks_of(lambda now_s, low_s=low_s: [float(abs(now_s - low_s) > 0.01)] * 3)
        wanted = Property(signal="x", at_least=1.0, counted=counted)  # type: ignore[arg-type]
        reform = msgspec.structs.replace(
            scenario(wanted).expect, reform_within_s=1.0, property=(wanted,)
        )
        judge = Judge(msgspec.structs.replace(scenario(), expect=reform))
        waiting = list(events)
        for tick in dip:
            while waiting and waiting[0].t_s <= tick.time_s + 1e-9:
                judge.handle_event(waiting.pop(0))
            judge.see(tick)
        assert judge.expectations()[-1].held is held, (low_s, counted)


def test_sometimes_is_covered_or_not_and_fails_nothing() -> None:
    where = Property(signal="x", at_least=2.0, must="sometimes", name="all far")
    judge = judged(ticks_of(step_at(3.0, 0.0, 2.0)), where)
    assert [(each.title, each.first_s) for each in judge.coverage] == [
        ("all far", pytest.approx(3.0))
    ]
    assert [row.name for row in judge.expectations()] == ["min_separation_m"]
    never = judged(ticks_of(steady(0.0, 0.0, 0.0)), where)
    assert [each.first_s for each in never.coverage] == [None]
    assert not never.shortcomings().missed


def test_conditions_besides_choose_the_ticks() -> None:
    ticks = [
        replace(tick, signals={"x": np.full(3, tick.time_s), "on": np.full(3, tick.time_s < 2.0)})
        for tick in straight_flight(SMALL)
    ]
    wanted = msgspec.convert(
        {"signal": "x", "at_most": 2.0, "where": [{"signal": "on", "at_least": 1}]}, Property
    )
    assert found(ticks, wanted).held is True
    assert found(ticks, msgspec.structs.replace(wanted, where=())).held is False


def test_the_judges_own_figures_are_those_of_the_truth() -> None:
    ticks = ticks_of(steady(0.0, 0.0, 0.0))
    speeds = [
        np.linalg.norm(now.position - before.position, axis=1).max() / TICK_S
        for before, now in pairwise(ticks)
    ]
    fastest = found(ticks, Property(figure="speed_mps", at_most=0.0))
    assert fastest.got == pytest.approx(max(speeds), rel=1e-9)
    running = found(ticks, Property(figure="running", at_least=3.0))
    assert (running.got, running.held) == (3.0, True)
    nearest = found(ticks, Property(figure="separation_m", at_least=0.0))
    assert nearest.got == judged(ticks).min_separation_m


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ("at_most = 1", "needs either a signal"),
        ('signal = "x"\nfigure = "running"\nat_most = 1', "needs either a signal"),
        ('signal = "x"', "needs a bound"),
        ('signal = "x"\nat_least = 2\nat_most = 1', r"property\[0\].at_least: 2 is more than"),
        ('signal = "X y"\nat_most = 1', r"property\[0\].signal"),
        ('figure = "parted"\nover = "mean"\nat_most = 0', r"property\[0\].over"),
        ('figure = "obstacle_distance_m"\nat_least = 1', "no obstacles"),
        ('signal = "x"\nat_most = 1\nwithin_s = 2', "only for must"),
        ('signal = "x"\nat_most = 1\nfrom_s = 99', "not before the end"),
        ('signal = "x"\nat_most = 1\nfrom_s = 2\nto_s = 1', "not after from_s"),
        ('signal = "x"\nat_most = 1\ncounted = "after"', "has no event"),
        ('signal = "x"\nat_most = 1\nwhere = [{ signal = "y" }]', r"where\[0\]: needs a bound"),
        ('signal = "x"\nat_most = nan', r"property\[0\].at_most"),
        ('signal = "x"\nat_most = 1\n[[expect.property]]\nsignal = "x"\nat_most = 1', "called"),
    ],
)
def test_a_property_that_makes_no_sense_is_refused_by_its_key(given: str, why: str) -> None:
    text = (
        "[fleet]\nagents = 3\n[formation]\nfile = 'pyramidal-wedge'\n[[expect.property]]\n" + given
    )
    with pytest.raises(ScenarioError, match=why):
        parse(text)


def test_each_is_told_in_words() -> None:
    wanted = (
        Property(signal="x", at_most=0.5),
        Property(
            signal="x", over="spread", at_most=1.0, must="settle", within_s=4.0, name="agreed"
        ),
        Property(signal="x", at_least=9.0, must="eventually"),
    )
    rows = [row.row for row in judged(ticks_of(steady(1.0, 1.0, 1.0)), *wanted).expectations()][1:]
    assert expectation_texts(rows, Circumstances(END_S, (), ())) == [
        "always x <= 0.5: at worst 1 (required <= 0.5; margin -0.5)",
        "agreed: from 0 s on (required within 4 s; margin 4 s)",
        "x >= 9, once at least: never, or not to the end (required by the end)",
    ]
