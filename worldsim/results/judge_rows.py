"""What the judge saw, as rows of summary.json: phases, recoveries, encounters, invariants."""

from typing import TypedDict

from worldsim.judge.verdict import Judge
from worldsim.results.expectation_text import EncounterRow, RecoveryRow


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


class InvariantRow(TypedDict):
    """How often an invariant was evaluated and violated [ticks]."""

    ticks: int
    violations: int


def invariant_rows(judge: Judge) -> dict[str, InvariantRow]:
    """Return how often each invariant was evaluated and violated, by its name."""
    return {
        name: {"ticks": tally.ticks, "violations": tally.violations}
        for name, tally in judge.invariants().items()
    }


def phase_rows(judge: Judge) -> list[PhaseRow]:
    """Return how the team formed each formation, in order."""
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


def recovery_rows(judge: Judge) -> list[RecoveryRow]:
    """Return each disturbance of the team, and its time to re-form."""
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


def encounter_rows(judge: Judge) -> list[EncounterRow]:
    """Return each time that an obstacle came too near to a vehicle that could not give way."""
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
