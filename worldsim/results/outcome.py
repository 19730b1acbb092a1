"""The outcome of a run and its reason: what speaks against it, and what may excuse it."""

from typing import Literal

from worldsim.judge.finding import ExpectationRow
from worldsim.results.expectation_text import Circumstances, PhaseTimes, expectation_texts
from worldsim.results.finished_run import FinishedRun
from worldsim.results.judge_rows import recovery_rows

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

Outcome = Literal["pass", "fail", "inconclusive"]


def outcome_of(
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
    return Circumstances(run.duration_s, phases, recovery_rows(judge))


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
