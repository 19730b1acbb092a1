"""summary.json: what a run showed, from the judge, the radio's counters and the clock.

To add a key: declare it in Summary, fill it in summarise.
"""

from collections.abc import Mapping
from math import isfinite
from typing import Any, TypedDict

import msgspec

from netem.messages import MediumCounters
from worldsim.engine.counters import Links
from worldsim.judge.finding import ExpectationRow
from worldsim.judge.properties import CoverageRow
from worldsim.judge.sub_formations import SubFormationsRow
from worldsim.results.controller_rows import DatagramRow, FilterRow, datagram_row, filter_row
from worldsim.results.expectation_text import EncounterRow, RecoveryRow
from worldsim.results.fault_rows import FaultRow, fault_rows, idle_text
from worldsim.results.finished_run import (
    DeliveryRow,
    FinishedRun,
    Mode,
    OverloadRow,
    ResourcesRow,
)
from worldsim.results.judge_rows import (
    InvariantRow,
    PhaseRow,
    encounter_rows,
    invariant_rows,
    phase_rows,
    recovery_rows,
)
from worldsim.results.outcome import Outcome, outcome_of
from worldsim.results.provenance import Provenance, provenance
from worldsim.results.refused_agents import RefusedRow, refused_rows, refused_text
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


class LinksRow(TypedDict):
    """Number of links of each agent; row i = agent i."""

    mean: list[float | None]
    most: list[int | None]


class Summary(Provenance):
    """The content of summary.json; None for what was not measured."""

    schema: int
    scenario: str
    seed: int
    mode: Mode
    agents: int  # at the start
    duration_s: float  # simulated
    outcome: Outcome
    reason: str | None  # of an outcome that is not a pass
    expectations: list[ExpectationRow]
    coverage: list[CoverageRow]  # properties that must hold sometimes, in some run
    min_separation_m: float | None  # centre to centre, swept between ticks
    min_obstacle_distance_m: float | None  # vehicle centre to surface
    phases: list[PhaseRow]  # one for each formation, in order
    sub_formations: list[SubFormationsRow]  # one for each formation, in order
    recoveries: list[RecoveryRow]
    encounters: list[EncounterRow]
    in_formation_fraction: float | None  # of the time after convergence, without faults' windows
    max_slot_error_m: float | None  # in the same time
    min_lambda2: float | None  # in the same time; measured where [expect] has it
    attitude_error_deg: float | None  # largest at the last tick
    turns_over_limit_fraction: float | None  # of moving steps
    faults: list[FaultRow]  # in the order in which they began
    packets: dict[str, int | None]  # by fate
    rejected_by_cause: dict[str, dict[str, int]]  # messages, by component and cause
    refused: list[RefusedRow]  # agents of which messages were rejected where they arrive
    direct_links: LinksRow  # agents heard
    needed_links: LinksRow  # those of them that are of the own queue: N_c,i
    bytes_per_s: dict[str, list[float | None]] | None  # by channel, of each agent
    datagrams: DatagramRow | None  # None where no controller says anything
    safety_filter: FilterRow | None  # None where it is off
    invariants: dict[str, InvariantRow]
    delivery: DeliveryRow | None
    delivery_late_ms: dict[str, float] | None  # how late the radio's batches left
    late_tick_fraction: float | None
    real_time_factor: float | None
    overload: OverloadRow | None
    resources: ResourcesRow | None
    trace_sha256: str | None


def summarise(scenario: Scenario, run: FinishedRun) -> Summary:
    """Return the content of summary.json as plain JSON values."""
    judge, counters = run.loop.judge, run.medium_counters
    rejected = _rejected(run)
    expectations = [expectation.row for expectation in judge.expectations()]
    use = run.loop.radio_use
    faults = _fault_rows(run)
    idle = None if scenario.expect.idle_faults else idle_text(faults)
    refused = _refused_rows(run)
    outcome, reason = outcome_of(
        run, expectations, idle, refused_text(refused, faults, scenario.fleet.agents)
    )
    summary: Summary = {
        "schema": SCHEMA,
        "scenario": scenario.name,
        "seed": scenario.seed,
        "mode": run.mode,
        "agents": scenario.fleet.agents,
        "duration_s": run.duration_s,
        "outcome": outcome,
        "reason": reason,
        "expectations": expectations,
        "coverage": [each.row for each in judge.coverage],
        "min_separation_m": judge.min_separation_m,
        "min_obstacle_distance_m": judge.min_obstacle_distance_m,
        "phases": phase_rows(judge),
        "sub_formations": [queues.row for queues in judge.sub_formations],
        "recoveries": recovery_rows(judge),
        "encounters": encounter_rows(judge),
        "in_formation_fraction": judge.in_formation_fraction,
        "max_slot_error_m": judge.max_slot_error_m,
        "min_lambda2": judge.min_lambda2,
        "attitude_error_deg": judge.attitude_error_deg,
        "turns_over_limit_fraction": judge.turns_over_limit_fraction,
        "faults": faults,
        "packets": _packets(counters, rejected),
        "rejected_by_cause": rejected,
        "refused": refused,
        "direct_links": _links_row(use.heard()),
        "needed_links": _links_row(use.needed()),
        "bytes_per_s": use.bytes_per_s(counters),
        "datagrams": datagram_row(run.loop.controllers),
        "safety_filter": filter_row(scenario.control.safety_filter, run.loop.controllers),
        "invariants": invariant_rows(judge),
        "delivery": run.delivery,
        "delivery_late_ms": _delivery_late_ms(counters),
        "late_tick_fraction": run.late_tick_fraction,
        "real_time_factor": run.real_time_factor,
        "overload": run.overload,
        "resources": run.resources,
        "trace_sha256": _trace_sha256(run),
        **provenance(),
    }
    plain: Summary = _finite(summary)
    return plain


def _trace_sha256(run: FinishedRun) -> str | None:
    """Return the hash of a trace; None where no slot was flown: it would be that of nothing."""
    repeatable = run.mode != "processes"
    return run.loop.trace.sha256 if repeatable and run.loop.world.slot > 0 else None


def _fault_rows(run: FinishedRun) -> list[FaultRow]:
    counters = run.medium_counters
    return fault_rows(
        run.loop.effects.faults.all,
        dict(counters.struck) if counters is not None else None,
        run.loop.world.readings_struck,
        run.loop.effects.slow.struck | run.loop.effects.starvation.struck,
        run.messages,
    )


def _refused_rows(run: FinishedRun) -> list[RefusedRow]:
    counters = run.medium_counters
    if counters is None:
        return refused_rows((), (), run.commands)
    return refused_rows(counters.frames, counters.transmissions, run.commands)


def _rejected(run: FinishedRun) -> dict[str, dict[str, int]]:
    """Count rejected messages by the component that rejected them, and by cause."""
    counters = run.medium_counters
    return {
        "agents": dict(run.loop.rejections.by_cause()),
        "netem": dict(counters.rejected) if counters is not None else {},
        "world": dict(run.rejected_by_world),
    }


def _packets(
    counters: MediumCounters | None, rejected: Mapping[str, Mapping[str, int]]
) -> dict[str, int | None]:
    """Count packets: ``sent`` frames; ``addressed`` and each fate once for each receiver."""
    names = ("sent", "addressed", *FATES, "in_flight")
    if counters is None:
        return dict.fromkeys((*names, "rejected"))
    counted = counters.packets()
    total = sum(count for causes in rejected.values() for count in causes.values())
    return {**{name: counted.get(name, 0) for name in names}, "rejected": total}


def _links_row(links: Links) -> LinksRow:
    return {"mean": links.mean, "most": links.most}


def _delivery_late_ms(counters: MediumCounters | None) -> dict[str, float] | None:
    """Return how much later than due batches left [ms]; None in virtual time: never late."""
    if counters is None or counters.late_s is None:
        return None
    median_s, worst_s = counters.late_s
    return {"median": 1000.0 * median_s, "worst": 1000.0 * worst_s}


def _finite(value: Any) -> Any:
    """Replace NaN and infinity by None: JSON has neither, and neither was measured."""
    if isinstance(value, float):
        return float(value) if isfinite(value) else None
    if isinstance(value, msgspec.Struct):
        return _finite(msgspec.structs.asdict(value))
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    return [_finite(inner) for inner in value] if isinstance(value, list | tuple) else value
