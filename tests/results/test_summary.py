"""summary.json: the keys of the contract, strict JSON, and an outcome with its reason."""

import dataclasses
import json
from typing import Any

import msgspec
import pytest

from netem.link import Cause
from netem.messages import MediumCounters
from netem.sender_counts import SenderRow
from tests.small_scenario import SMALL
from worldsim.campaign.pool import finished
from worldsim.engine.step import SlotLoop, world_of
from worldsim.engine.virtual import fly
from worldsim.judge.finding import InvariantTally
from worldsim.judge.hovering_vehicles import HoveringVehicles
from worldsim.judge.invariants import Invariants
from worldsim.results.exit_status import EXIT_STATUS
from worldsim.results.finished_run import FinishedRun
from worldsim.results.outcome import INVARIANT_WORDS
from worldsim.results.provenance import provenance
from worldsim.results.summary import FATES, Summary, summarise
from worldsim.scenario.file import load, parse
from worldsim.scenario.library import SCENARIOS

KEYS = {
    *("schema", "scenario", "seed", "mode", "agents", "duration_s", "outcome", "expectations"),
    *(
        "min_separation_m",
        "min_obstacle_distance_m",
        "phases",
        "sub_formations",
        "turns_over_limit_fraction",
    ),
    *("packets", "invariants", "late_tick_fraction", "real_time_factor", "trace_sha256"),
    *("overload", "resources"),
    *("direct_links", "needed_links", "bytes_per_s"),
    *("version", "commit", "commit_dirty", "python", "packages", "host"),
}
SCENARIO = parse(SMALL, overrides={"netem.loss_percent": "30"})


@pytest.fixture
def run() -> FinishedRun:
    return finished(fly(SCENARIO), SCENARIO)


def summary(run: FinishedRun, **changes: Any) -> Summary:
    return summarise(SCENARIO, dataclasses.replace(run, **changes))


def counters(run: FinishedRun) -> MediumCounters:
    assert run.medium_counters is not None
    return run.medium_counters


def test_it_has_every_key_of_the_contract(run: FinishedRun) -> None:
    made = summary(run)
    assert made.keys() >= KEYS
    assert (made["outcome"], made["reason"]) == ("pass", None)
    assert made["phases"][0].keys() == {
        "formation",
        "from_s",
        "converged",
        "converge_s",
        "timed_from_s",
        "in_place_from_s",
        "residual_m",
        "queues_converge_s",
    }
    assert made["sub_formations"][0].keys() == {"formation", "from_s", "stands_s", "lead_s"}
    assert json.loads(json.dumps(made, allow_nan=False)) == made
    assert {key: made[key] for key in provenance()} == provenance()  # type: ignore[literal-required]


def test_every_fate_of_the_radio_is_counted() -> None:
    assert {cause.name.lower() for cause in Cause} <= set(FATES)


def test_packets_balance(run: FinishedRun) -> None:
    packets = {name: count or 0 for name, count in summary(run)["packets"].items()}
    assert packets["dropped_loss"] > 0
    assert packets["sent"] == counters(run).sent > 0
    assert packets["addressed"] == packets["sent"] * 1
    assert packets["addressed"] == packets["in_flight"] + sum(packets[fate] for fate in FATES)


def test_i8_is_evaluated_at_every_tick(run: FinishedRun) -> None:
    assert summary(run)["invariants"]["I8"] == {"ticks": 5 * 20 + 1, "violations": 0}


def test_a_packet_without_a_fate_violates_i8(run: FinishedRun) -> None:
    lost = {"addressed": 5, "delivered": 3, "in_flight": 1}
    loop = SlotLoop(SCENARIO, world_of(SCENARIO, 1), packets=lambda: lost)
    loop.open()
    made = summary(run, loop=loop)
    assert made["invariants"]["I8"] == {"ticks": 1, "violations": 1}
    assert (made["outcome"], made["reason"]) == (
        "fail",
        "violated: I8 (the radio's counters of packets do not add up)",
    )


def test_late_batches_of_the_radio_are_in_ms(run: FinishedRun) -> None:
    assert summary(run)["delivery_late_ms"] is None
    assert summary(run)["delivery"] is None
    late = msgspec.structs.replace(counters(run), late_s=(0.0005, 0.25))
    assert summary(run, medium_counters=late)["delivery_late_ms"] == {"median": 0.5, "worst": 250.0}


def test_what_was_not_measured_is_null_and_no_pass(run: FinishedRun) -> None:
    run.loop.judge.invariants()["I8"].ticks = 0
    made = summary(run, medium_counters=None, real_time_factor=float("nan"), mode="processes")
    assert set(made["packets"].values()) == {None}
    assert made["real_time_factor"] is None
    assert made["trace_sha256"] is None
    assert (made["outcome"], made["reason"]) == ("fail", "never evaluated: I8")


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"cut_off_by": "interrupted"}, "interrupted after 5.0 s"),
        ({"late_tick_fraction": 0.017}, "the host was too slow: 1.7 % of ticks were late"),
        ({"cut_off_by": "interrupted", "medium_counters": None}, "interrupted after 5.0 s"),
    ],
)
def test_a_doubtful_run_is_never_a_pass(
    run: FinishedRun, changes: dict[str, Any], reason: str
) -> None:
    made = summary(run, **changes)
    assert (made["outcome"], made["reason"]) == ("inconclusive", reason)
    assert EXIT_STATUS[made["outcome"]] == 3


@pytest.mark.parametrize("late", [None, 0.0, 0.0099])
def test_few_late_ticks_leave_a_pass(run: FinishedRun, late: float | None) -> None:
    assert summary(run, late_tick_fraction=late)["outcome"] == "pass"


def test_on_a_slow_host_agents_that_were_late_are_not_blamed_for_a_collision(
    run: FinishedRun,
) -> None:
    run.loop.judge.invariants()["I1"].violations = 1
    detail = "most often those of agent-3 (21 %)"
    late = {"late_tick_fraction": 0.5, "unsafe_on_time": False, "late_detail": detail}
    made = summary(run, **late)
    assert made["outcome"] == "inconclusive"
    assert made["reason"] == (
        f"the host was too slow: 50.0 % of ticks were late, {detail};"
        " violated meanwhile: I1 (two vehicles, or a vehicle and an obstacle, were too near)"
    )
    in_time = summary(run, **{**late, "late_tick_fraction": 0.001})
    assert in_time["outcome"] == "fail"


@pytest.mark.parametrize(("in_time", "outcome"), [((), "inconclusive"), (("I4",), "fail")])
def test_a_spell_of_late_ticks_excuses_what_it_may_have_caused(
    run: FinishedRun, in_time: tuple[str, ...], outcome: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    tallies = {"I1": InvariantTally(20), "I4": InvariantTally(20, 3), "I8": InvariantTally(20)}
    monkeypatch.setattr(run.loop.judge, "invariants", lambda: tallies)
    spell = {"late_spell": "the host was too slow for a while", "violated_in_time": in_time}
    made = summary(run, late_tick_fraction=0.003, **spell)
    assert made["outcome"] == outcome
    reason = str(made["reason"])
    assert reason.startswith("the host was too slow for a while; violated meanwhile") == (
        outcome == "inconclusive"
    )


def test_an_expectation_missed_with_a_spell_of_late_ticks_is_no_failure(run: FinishedRun) -> None:
    run.loop.judge.min_separation_m = 0.1
    assert summary(run)["outcome"] == "fail"
    made = summary(run, late_spell="the host was too slow for a while")
    assert made["outcome"] == "inconclusive"
    assert str(made["reason"]).startswith("the host was too slow for a while; missed: ")


def test_a_slow_host_does_not_excuse_a_collision(run: FinishedRun) -> None:
    run.loop.judge.invariants()["I1"].violations = 1
    made = summary(run, late_tick_fraction=0.5, cut_off_by="interrupted")
    assert made["outcome"] == "fail"
    assert made["reason"] == (
        "violated: I1 (two vehicles, or a vehicle and an obstacle, were too near)"
    )


@pytest.mark.parametrize("name", ["I2", "I3", "I4", "I6", "I7"])
def test_news_that_comes_late_on_a_slow_host_is_no_failure_of_the_team(
    run: FinishedRun, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    tallies = {"I1": InvariantTally(20), name: InvariantTally(20, 3), "I8": InvariantTally(20)}
    monkeypatch.setattr(run.loop.judge, "invariants", lambda: tallies)
    words = f"{name} ({INVARIANT_WORDS[name]})"
    assert summary(run)["reason"] == f"violated: {words}"
    made = summary(run, late_tick_fraction=0.02)
    assert made["outcome"] == "inconclusive"
    assert made["reason"] == (
        f"the host was too slow: 2.0 % of ticks were late; violated meanwhile: {words}"
    )
    blamed = summary(run, late_tick_fraction=0.02, late_because="netem was stopped")
    assert blamed["reason"] is not None
    assert blamed["reason"].startswith("netem was stopped: 2.0 % of ticks were late; ")


def test_every_invariant_has_words() -> None:
    nine = load(SCENARIOS / "wedge-9.toml")
    tallies = Invariants(nine, HoveringVehicles(nine.control.spacing_m)).tallies
    assert {"I1", "I5", *tallies, "I8"} == set(INVARIANT_WORDS)


def test_an_error_during_the_run_is_a_failure(run: FinishedRun) -> None:
    made = summary(run, failure="agent-3 was killed by signal 9")
    assert (made["outcome"], made["reason"]) == ("fail", "agent-3 was killed by signal 9")


def test_an_expectation_that_is_not_met_fails() -> None:
    strict = parse(SMALL, overrides={"expect.converge_within_s": "0.01"})
    made = summarise(strict, finished(fly(strict), strict))
    assert made["outcome"] == "fail"
    assert made["reason"] is not None
    assert made["reason"].startswith("line: converged in ")
    assert " s (limit 0.01 s; margin -" in made["reason"]


def test_what_a_run_is_too_short_for_is_not_judged() -> None:
    short = parse(SMALL, overrides={"duration_s": "0.5", "expect.converge_within_s": "3"})
    made = summarise(short, finished(fly(short), short))
    reason = "line did not converge: the run ended after 0.5 s, before the limit of 3 s"
    assert (made["outcome"], made["reason"]) == ("inconclusive", f"not judged: {reason}")
    assert made["expectations"][1]["held"] is None


def test_what_is_expected_of_a_formation_that_no_time_shows_is_not_judged() -> None:
    """The run ends within the window of its fault, so nothing of it counts."""
    override = {"expect.in_formation_fraction": "0.9", "expect.idle_faults": "true"}
    override["event"] = "[{ at_s = 0.1, for_s = 4.8, netem = { loss_percent = 1 } }]"
    scenario = parse(SMALL, overrides=override)
    made = summarise(scenario, finished(fly(scenario), scenario))
    reason = "not judged: time in formation: no time counted (required >= 90 %)"
    assert (made["outcome"], made["reason"]) == ("inconclusive", reason)


def test_rejected_messages_are_counted_by_component_and_cause(run: FinishedRun) -> None:
    by_medium = msgspec.structs.replace(counters(run), rejected={"stale": 2})
    made = summary(run, medium_counters=by_medium, rejected_by_world={"stale": 3})
    assert made["rejected_by_cause"] == {"agents": {}, "netem": {"stale": 2}, "world": {"stale": 3}}
    assert made["packets"]["rejected"] == 5


def test_a_run_in_which_an_agent_is_never_understood_fails_and_names_it(run: FinishedRun) -> None:
    frames = (SenderRow(1, 0, {"invalid": 50}),)
    made = summary(run, medium_counters=msgspec.structs.replace(counters(run), frames=frames))
    assert made["refused"] == [
        {"agent": 1, "messages": "frames", "accepted": 0, "rejected": {"invalid": 50}}
    ]
    reason = "agent 1 takes no part: whoever hears it rejects all of its frames"
    assert made["outcome"] == "fail"
    assert made["reason"] == f"{reason} (50 invalid: not the fields of the wire)"
    assert summary(run)["refused"] == []


def flown_to(duration_s: float, **keys: str) -> Summary:
    scenario = parse(SMALL, overrides={"duration_s": str(duration_s), **keys})
    return summarise(scenario, finished(fly(scenario), scenario))


def test_a_fault_that_never_ends_leaves_open_whether_the_team_re_forms() -> None:
    pose = "[{ at_s = 3, pose = { agents = ['all'], bias_m = [0, 0, 0.5] } }]"
    made = flown_to(16.0, event=pose, **{"expect.reform_within_s": "3"})
    reason = "formation after a fault: one was in force to the end (limit 3 s)"
    assert (made["outcome"], made["reason"]) == ("inconclusive", f"not judged: {reason}")


def test_a_loss_is_not_blamed_for_what_another_fault_prevents() -> None:
    pose = "{ at_s = 3, pose = { agents = [1], bias_m = [0, 0, 0.5] } }"
    event = f"[{pose}, {{ at_s = 4, for_s = 1, kill = [0] }}]"
    made = flown_to(16.0, event=event, **{"expect.reform_within_s": "3"})
    assert made["outcome"] == "inconclusive"


def test_without_a_limit_the_planned_duration_is_the_limit() -> None:
    scenario = parse(
        SMALL, overrides={"fleet.start": "{ kind = 'list', positions_m = [[9, 0, 0], [12, 0, 0]] }"}
    )
    made = summarise(scenario, finished(fly(scenario), scenario))
    assert (made["outcome"], made["reason"]) == (
        "fail",
        "line did not converge in 5 s: not every agent was in its place at the end",
    )
    flight = fly(scenario, should_stop=StopAfter(40))
    assert flight.loop.judge.expectations()[1].held is None


class StopAfter:
    """Asks a flight to stop after so many slots."""

    def __init__(self, slots: int) -> None:
        self._left = slots

    def __call__(self) -> bool:
        self._left -= 1
        return self._left < 0
