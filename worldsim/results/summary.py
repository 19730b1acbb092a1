"""summary.json: what a run showed, from the judge, the radio's counters and the clock.

To add a key: declare it in Summary, fill it in summarise.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any, Literal, TypedDict

import msgspec

from netem.messages import MediumCounters
from netem.sender_counts import SenderRow
from worldsim.engine.counters import Links
from worldsim.engine.step import SlotLoop
from worldsim.judge.finding import ExpectationRow
from worldsim.judge.properties import CoverageRow
from worldsim.judge.sub_formations import SubFormationsRow
from worldsim.judge.verdict import Judge
from worldsim.results.controller_rows import DatagramRow, FilterRow, datagram_row, filter_row
from worldsim.results.expectation_text import (
    Circumstances,
    EncounterRow,
    PhaseTimes,
    RecoveryRow,
    expectation_texts,
)
from worldsim.results.fault_rows import FaultRow, fault_rows, idle_text
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
TOO_LATE_FRACTION = 0.01
"""From this share of late ticks on, the host is too slow for a verdict."""

TIMELESS = ("I1", "I5", "I8")
"""Invariants that hold however late messages come."""
TIMELESS_IF_LATE = ("I5", "I8")
"""Those of them where only agents that the host made late have broken safety."""

INVARIANT_WORDS = {
    "I1": "two vehicles, or a vehicle and an obstacle, were too near",
    "I2": "a vertex of the formation did not have exactly one agent",
    "I3": "a queue's number of agents was not its share",
    "I4": "two agents kept claiming one slot",
    "I5": "an agent went back to an older mission",
    "I6": "an agent changed its role too often",
    "I7": "an agent of a settled team changed its place",
    "I8": "the radio's counters of packets do not add up",
}
"""The violation of each invariant, in words."""

Mode = Literal["processes", "lockstep", "virtual"]
Outcome = Literal["pass", "fail", "inconclusive"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FinishedRun:
    """A run as its clock leaves it; None for what that clock cannot measure."""

    mode: Mode
    loop: SlotLoop
    medium_counters: MediumCounters | None
    late_tick_fraction: float | None
    real_time_factor: float | None  # simulated seconds in a second of wall time
    cut_off_by: str | None = None  # what ended the run before its time; None: it is complete
    failure: str | None = None  # an error during the run
    late_because: str | None = None  # the process that made ticks late, if not the host
    late_detail: str | None = None  # whose ticks were late on a slow host, and what to do
    unsafe_on_time: bool = True  # whether agents that were on time broke I1, if it is broken
    late_spell: str | None = None  # when the host was too slow for a while; None: it never was
    violated_in_time: Collection[str] | None = None  # while no tick was late; None: all that are
    overload: "OverloadRow | None" = None  # None under a clock where no tick can be late
    resources: "ResourcesRow | None" = None  # of the processes of a launched fleet
    rejected_by_world: Mapping[str, int] = field(default_factory=dict)  # messages by cause
    commands: Sequence[SenderRow] = ()  # of each agent, accepted and rejected; free-running
    delivery: "DeliveryRow | None" = None  # of frames that agents used
    messages: Mapping[int, int] = field(default_factory=dict)  # of intruders, by a fault's number

    @property
    def duration_s(self) -> float:
        """How much was simulated [s]."""
        return self.loop.world.time_s

    @property
    def host_too_slow(self) -> bool:
        """Whether so many ticks were late that the run proves nothing."""
        late = self.late_tick_fraction
        return late is not None and late >= TOO_LATE_FRACTION


class PhaseRow(TypedDict):
    """How the team formed one formation."""

    formation: str
    from_s: float
    converged: bool
    converge_s: float | None  # from the phase's start
    timed_from_s: float | None  # for its expectation; later than from_s where a fault forbade it
    in_place_from_s: float | None  # since when all were in place at its end, for less than 2 s
    residual_m: float | None  # largest slot error at the last tick of the phase
    queues_converge_s: dict[str, float | None]  # by queue name


class LinksRow(TypedDict):
    """Number of links of each agent; row i = agent i."""

    mean: list[float | None]
    most: list[int | None]


class InvariantRow(TypedDict):
    """How often an invariant was evaluated and violated [ticks]."""

    ticks: int
    violations: int


class ChannelDeliveryRow(TypedDict):
    """The extra delay of one channel's frames."""

    frames: int
    within_fraction: float
    excess_ms: dict[str, float]


class DeliveryRow(ChannelDeliveryRow):
    """The extra delay of all frames."""

    bound_ms: float  # one slot and one tick
    channels: dict[str, ChannelDeliveryRow | None]


class OverloadRow(TypedDict):
    """What was to be done when ticks are late, and what was done."""

    policy: Literal["go", "slow", "abort"]  # as in --on-overload
    least_speed: float  # simulated seconds in a second of wall time; as requested: never slowed


class ResourcesRow(TypedDict):
    """What the processes of a launched fleet used."""

    start_up_s: float | None  # wall time from the launcher's start until all were present
    agent_steps: int  # how often an agent was to step
    cpu_us_per_agent_step: dict[str, float]  # by part, without the start: agents, netem, world
    agent_private_mb: float | None  # memory shared with no other process, the median agent


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
    invariants = judge.invariants()
    use = run.loop.radio_use
    faults = _fault_rows(run)
    idle = None if scenario.expect.idle_faults else idle_text(faults)
    refused = _refused_rows(run)
    outcome, reason = _outcome(
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
        "phases": _phase_rows(judge),
        "sub_formations": [queues.row for queues in judge.sub_formations],
        "recoveries": _recovery_rows(judge),
        "encounters": _encounter_rows(judge),
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
        "invariants": {
            name: {"ticks": tally.ticks, "violations": tally.violations}
            for name, tally in invariants.items()
        },
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


def _outcome(
    run: FinishedRun, expectations: list[ExpectationRow], idle: str | None, refused: str | None
) -> tuple[Outcome, str | None]:
    """Return the outcome and its reason.

    A violated invariant is a failure also in a run that was cut off. On a host that was too slow,
    only those are that do not rest on news arriving in time: the others are named. Safety rests on
    it where an agent was late that broke it. idle: which faults struck nothing; what would pass is
    inconclusive then. refused: which agents take no part, since all that they say is rejected.
    """
    if run.failure is not None:
        return "fail", run.failure
    found = run.loop.judge.shortcomings()
    late = _slowness(run)
    excused = [name for name in found.violated if _is_excused(run, name)]
    violated = [name for name in found.violated if name not in excused]
    if violated:
        return "fail", f"violated: {_with_words(violated)}"
    if refused is not None:
        return "fail", refused
    doubt = _cut(run) or late or (run.late_spell if excused else None)
    if doubt is not None:
        meanwhile = f"; violated meanwhile: {_with_words(excused)}" if excused else ""
        return "inconclusive", f"{doubt}{meanwhile}"
    if found.unseen:
        return "fail", f"never evaluated: {', '.join(found.unseen)}"
    return _of_expectations(run, expectations) or _of_faults(idle)


def _of_expectations(
    run: FinishedRun, expectations: list[ExpectationRow]
) -> tuple[Outcome, str] | None:
    """Return the outcome where an expectation was not met, or the run was too short for it."""
    texts = expectation_texts(expectations, _circumstances(run))
    rows = list(zip(texts, expectations, strict=True))
    missed = [text for text, row in rows if row["held"] is False]
    if missed and run.late_spell is not None:
        return "inconclusive", f"{run.late_spell}; missed: {'; '.join(missed)}"
    if missed:
        return "fail", "; ".join(missed)
    unjudged = [text for text, row in rows if row["held"] is None]
    if unjudged:
        return "inconclusive", f"not judged: {'; '.join(unjudged)}"
    return None


def _of_faults(idle: str | None) -> tuple[Outcome, str | None]:
    """Return the outcome of a run that meets everything. idle: which faults struck nothing."""
    return ("inconclusive", idle) if idle is not None else ("pass", None)


def _is_excused(run: FinishedRun, name: str) -> bool:
    """Return whether a violated invariant may be the host's fault."""
    if name not in (TIMELESS if run.unsafe_on_time else TIMELESS_IF_LATE):
        in_time = run.violated_in_time is None or name in run.violated_in_time
        return run.host_too_slow or (run.late_spell is not None and not in_time)
    return False


def _with_words(invariants: list[str]) -> str:
    return ", ".join(f"{name} ({INVARIANT_WORDS[name]})" for name in invariants)


def _circumstances(run: FinishedRun) -> Circumstances:
    judge = run.loop.judge
    phases = [PhaseTimes.of(phase) for phase in judge.phases]
    return Circumstances(run.duration_s, phases, _recovery_rows(judge))


def _cut(run: FinishedRun) -> str | None:
    """Return what ended a run before its time; None where nothing did."""
    if run.cut_off_by is None:
        return None
    return f"{run.cut_off_by} after {run.duration_s:.1f} s"


def _slowness(run: FinishedRun) -> str | None:
    """Return who or what made too many ticks late; None where few were."""
    late = run.late_tick_fraction
    if late is None or not run.host_too_slow:
        return None
    share = f"{100 * late:.1f} % of ticks were late"
    if run.late_because is not None:
        return f"{run.late_because}: {share}"
    return f"the host was too slow: {share}{f', {run.late_detail}' if run.late_detail else ''}"


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


def _phase_rows(judge: Judge) -> list[PhaseRow]:
    return [
        {
            "formation": phase.formation.name,
            "from_s": phase.from_s,
            "converged": phase.converge_s is not None,
            "converge_s": phase.converge_s,
            "timed_from_s": phase.timed_from_s,
            "in_place_from_s": phase.in_place_from_s,
            "residual_m": phase.residual_m,
            "queues_converge_s": dict(zip(queues.names, queues.converge_s, strict=True)),
        }
        for phase, queues in zip(judge.phases, judge.queues, strict=True)
    ]


def _recovery_rows(judge: Judge) -> list[RecoveryRow]:
    return [
        {
            "t_s": recovery.t_s,
            "kind": recovery.kind,
            "agents": recovery.agents,
            "reformed_s": recovery.reformed_s,
            "timed_from_s": recovery.timed_from_s,
            "asked_s": recovery.asked_s,
            "overtaken_s": recovery.overtaken_s,
            "in_place_from_s": recovery.in_place_from_s,
            "changed": recovery.changed,
        }
        for recovery in judge.recoveries
    ]


def _encounter_rows(judge: Judge) -> list[EncounterRow]:
    return [
        {
            "t_s": encounter.t_s,
            "agent": encounter.agent,
            "obstacle": encounter.obstacle,
            "distance_m": encounter.distance_m,
            "hindrance": encounter.hindrance.value,
        }
        for encounter in judge.clearance.encounters
    ]


def _finite(value: Any) -> Any:
    """Replace NaN and infinity by None: JSON has neither, and neither was measured."""
    if isinstance(value, float):
        return float(value) if isfinite(value) else None
    if isinstance(value, msgspec.Struct):
        return _finite(msgspec.structs.asdict(value))
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    return [_finite(inner) for inner in value] if isinstance(value, list | tuple) else value
