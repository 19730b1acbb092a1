"""summary.json: the keys of the contract, strict values, and an outcome with its reason."""

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from netem.link import Cause
from worldsim.engine.virtual import Flight, VirtualFleet, fly
from worldsim.results.summary import EXIT_STATUS, FATES, summarise
from worldsim.scenario.file import load

KEYS = {
    *("schema", "scenario", "seed", "mode", "agents", "duration_s", "outcome", "expectations"),
    *("min_separation_m", "min_obstacle_distance_m", "phases", "turns_over_limit_fraction"),
    *("packets", "invariants", "late_tick_fraction", "real_time_factor", "trace_sha256"),
}


@pytest.fixture
def flight(small: Path) -> Flight:
    return fly(load(small, {"netem.loss_percent": "30"}))


def summary(small: Path, flight: Flight, **others: Any) -> dict[str, Any]:
    figures = {
        "mode": "virtual",
        "medium_counters": flight.medium_counters,
        "late_tick_fraction": 0.0,
        "real_time_factor": 1.0,
        "duration_s": 5.0,
        "interrupted": False,
        "host_too_slow": False,
    }
    return summarise(load(small), flight.loop, **{**figures, **others})


def test_it_has_every_key_of_the_contract(small: Path, flight: Flight) -> None:
    told = summary(small, flight)
    assert told.keys() >= KEYS
    assert (told["outcome"], told["reason"]) == ("pass", None)
    assert told["phases"][0].keys() == {
        "formation",
        "from_s",
        "converged",
        "converge_s",
        "residual_m",
        "queues_converge_s",
    }
    assert json.loads(json.dumps(told, allow_nan=False)) == told


def test_every_fate_that_the_radio_knows_is_counted() -> None:
    assert {cause.name.lower() for cause in Cause} <= set(FATES)


def test_packets_balance(small: Path, flight: Flight) -> None:
    packets = summary(small, flight)["packets"]
    assert packets["dropped_loss"] > 0
    assert packets["sent"] == flight.medium_counters.sent > 0
    assert packets["addressed"] == packets["sent"] * 1
    assert packets["addressed"] == packets["in_flight"] + sum(packets[fate] for fate in FATES)


def test_i8_is_evaluated_at_every_tick(small: Path, flight: Flight) -> None:
    ticks = summary(small, flight)["invariants"]["I8"]
    assert ticks == {"ticks": 5 * 20 + 1, "violations": 0}


def test_a_packet_that_is_nowhere_violates_i8(small: Path) -> None:
    fleet = VirtualFleet(load(small, {"netem.delay_ms": "20"}))
    while not fleet.medium_counters.in_flight:
        fleet.slot()
    fleet._medium.in_flight -= 1
    ticks = fleet.loop.judge.ticks
    for _ in range(12):
        fleet.slot()
    assert fleet.loop.judge.invariants()["I8"].violations == fleet.loop.judge.ticks - ticks
    told = summary(small, Flight(fleet.loop, fleet.medium_counters, 0, 1.0, 1.0))
    assert (told["outcome"], told["reason"]) == ("fail", "violated: I8")


def test_how_late_the_radio_was_is_told_in_ms(small: Path, flight: Flight) -> None:
    assert summary(small, flight)["delivery_late_ms"] is None
    assert summary(small, flight)["delivery"] is None
    late = msgspec.structs.replace(flight.medium_counters, late_s=(0.0005, 0.25))
    told = summary(small, flight, medium_counters=late)
    assert told["delivery_late_ms"] == {"median": 0.5, "worst": 250.0}


def test_what_was_not_measured_is_null_and_no_pass(small: Path, flight: Flight) -> None:
    flight.loop.judge.invariants()["I8"].ticks = 0
    told = summary(
        small, flight, medium_counters=None, real_time_factor=float("nan"), mode="processes"
    )
    assert set(told["packets"].values()) == {None}
    assert told["real_time_factor"] is None
    assert told["trace_sha256"] is None
    assert (told["outcome"], told["reason"]) == ("fail", "never evaluated: I8")


@pytest.mark.parametrize(
    ("others", "reason"),
    [
        ({"interrupted": True}, "interrupted after 5.0 s"),
        (
            {"host_too_slow": True, "late_tick_fraction": 0.017},
            "the host was too slow: 1.7 % of ticks were late",
        ),
        ({"interrupted": True, "medium_counters": None}, "interrupted after 5.0 s"),
    ],
)
def test_a_doubtful_run_is_never_a_pass(
    small: Path, flight: Flight, others: dict[str, Any], reason: str
) -> None:
    told = summary(small, flight, **others)
    assert (told["outcome"], told["reason"]) == ("inconclusive", reason)
    assert EXIT_STATUS[told["outcome"]] == 3


def test_no_slow_host_excuses_a_collision(small: Path, flight: Flight) -> None:
    flight.loop.judge.invariants()["I1"].violations = 1
    told = summary(small, flight, host_too_slow=True, interrupted=True)
    assert (told["outcome"], told["reason"]) == ("fail", "violated: I1")


def test_a_missed_expectation_fails(small: Path, flight: Flight) -> None:
    late = msgspec.structs.replace(flight.loop.judge.expectations()[-1], held=False)
    flight.loop.judge.expectations = lambda: [late]  # type: ignore[method-assign]
    assert summary(small, flight)["reason"] == f"not held: {late.name}"
