"""summary.json: what a run showed, from the judge, the radio's counters and the clock."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

import msgspec

from netem.messages import MediumCounters
from worldsim.engine.step import SlotLoop
from worldsim.judge.invariants import InvariantTally
from worldsim.judge.verdict import Expectation, Judge
from worldsim.scenario.tables import Scenario

SCHEMA = 1
FATES = (
    "delivered",
    "dropped_range",
    "dropped_loss",
    "dropped_partition",
    "dropped_queue",
    "dropped_medium",
    "duplicated",
    "corrupted",
)
INTERRUPTED = 130
EXIT_STATUS = {"pass": 0, "fail": 1, "inconclusive": 3}


def summarise(  # noqa: PLR0913 - a figure each, by name
    scenario: Scenario,
    loop: SlotLoop,
    *,
    mode: str,
    medium_counters: MediumCounters | None,
    late_tick_fraction: float | None,
    real_time_factor: float | None,
    duration_s: float,
    interrupted: bool,
    host_too_slow: bool,
    failure: str | None = None,
    ended_by: str = "interrupted",
    refused: Mapping[str, int] | None = None,
    delivery: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Return summary.json's content: plain values, None for what could not be measured.

    mode: "processes", "lockstep" or "virtual". duration_s: how much was flown, in simulated time.
    failure: what ended the run that should not have happened in it. ended_by: why it was cut off,
    if it was. refused: messages that the world refused, by cause. delivery: how late frames came.
    """
    judge = loop.judge
    rejected = _rejected(loop, medium_counters, refused)
    expectations = judge.expectations()
    invariants = judge.invariants()
    cut_off = f"{ended_by} after {duration_s:.1f} s" if interrupted else None
    doubt = cut_off or _too_slow(host_too_slow, late_tick_fraction)
    outcome, reason = ("fail", failure) if failure else _outcome(expectations, invariants, doubt)
    summary = {
        "schema": SCHEMA,
        "scenario": scenario.name,
        "seed": scenario.seed,
        "mode": mode,
        "agents": scenario.fleet.agents,
        "duration_s": duration_s,
        "outcome": outcome,
        "reason": reason,
        "expectations": expectations,
        "min_separation_m": judge.min_separation_m,
        "min_obstacle_distance_m": judge.min_obstacle_distance_m,
        "phases": _phases(judge),
        "recoveries": judge.recoveries,
        "attitude_error_deg": judge.attitude_error_deg,
        "turns_over_limit_fraction": judge.turns_over_limit_fraction,
        "packets": _packets(medium_counters, rejected),
        "rejected_by_cause": rejected,
        "direct_links": loop.radio_use.links(),
        "bytes_per_s": loop.radio_use.bytes_per_s(medium_counters),
        "invariants": invariants,
        "delivery": delivery,
        "delivery_late_ms": _delivery_late_ms(medium_counters),
        "late_tick_fraction": late_tick_fraction,
        "real_time_factor": real_time_factor,
        "trace_sha256": None if mode == "processes" else loop.trace.sha256,
    }
    return {key: _strict(value) for key, value in summary.items()}


def _outcome(
    expectations: list[Expectation], invariants: dict[str, InvariantTally], doubt: str | None
) -> tuple[str, str | None]:
    """Return the outcome and its reason.

    A broken invariant is a failure whatever else happened: no slow host excuses a collision.
    """
    broken = [name for name, tally in invariants.items() if tally.violations]
    if broken:
        return "fail", f"violated: {', '.join(broken)}"
    if doubt is not None:
        return "inconclusive", doubt
    unseen = [name for name, tally in invariants.items() if not tally.ticks]
    if unseen:
        return "fail", f"never evaluated: {', '.join(unseen)}"
    missed = [expectation.name for expectation in expectations if not expectation.held]
    if missed:
        return "fail", f"not held: {', '.join(missed)}"
    return "pass", None


def _too_slow(host_too_slow: bool, late: float | None) -> str | None:
    if not host_too_slow:
        return None
    share = f": {100 * late:.1f} % of ticks were late" if late is not None else ""
    return f"the host was too slow{share}"


def _rejected(
    loop: SlotLoop, medium_counters: MediumCounters | None, refused: Mapping[str, int] | None
) -> dict[str, dict[str, int]]:
    """Return who refused how many messages for which cause."""
    by_medium = medium_counters.rejected if medium_counters is not None else {}
    told = {"agents": loop.rejections.by_cause(), "netem": by_medium, "world": refused or {}}
    return {who: dict(causes) for who, causes in told.items()}


def _packets(
    medium_counters: MediumCounters | None, rejected: Mapping[str, Mapping[str, int]]
) -> dict[str, int | None]:
    """Count packets: sent as frames, addressed and each fate once for each agent that may hear."""
    names = ("sent", "addressed", *FATES, "in_flight")
    if medium_counters is None:
        return dict.fromkeys((*names, "rejected"))
    counted = medium_counters.packets()
    refused = sum(count for causes in rejected.values() for count in causes.values())
    return {**{name: counted.get(name, 0) for name in names}, "rejected": refused}


def _delivery_late_ms(medium_counters: MediumCounters | None) -> dict[str, float] | None:
    """How much later than due the radio's batches left; None in virtual time, where none can be."""
    if medium_counters is None or medium_counters.late_s is None:
        return None
    median_s, worst_s = medium_counters.late_s
    return {"median": 1000.0 * median_s, "worst": 1000.0 * worst_s}


def _phases(judge: Judge) -> list[dict[str, Any]]:
    return [
        {
            "formation": phase.formation.name,
            "from_s": phase.from_s,
            "converged": phase.converge_s is not None,
            "converge_s": phase.converge_s,
            "residual_m": phase.residual_m,
            "queues_converge_s": dict(zip(queues.names, queues.converge_s, strict=True)),
        }
        for phase, queues in zip(judge.phases, judge.queues, strict=True)
    ]


def _strict(value: Any) -> Any:
    """JSON knows no NaN and no infinity: what is not finite was not measured."""
    if isinstance(value, float):
        return float(value) if isfinite(value) else None
    if isinstance(value, msgspec.Struct):
        return _strict(msgspec.structs.asdict(value))
    if isinstance(value, dict):
        return {key: _strict(inner) for key, inner in value.items()}
    return [_strict(inner) for inner in value] if isinstance(value, list | tuple) else value
