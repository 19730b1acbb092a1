"""The verdict in words: of one run, of many runs, and of a recording that was judged again."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from worldsim.judge.finding import ExpectationRow
from worldsim.judge.properties import CoverageRow
from worldsim.judge.sub_formations import SubFormationsRow
from worldsim.recording.layout import SUMMARY_FILE
from worldsim.results.controller_rows import filter_texts
from worldsim.results.exit_status import INTERRUPTION
from worldsim.results.expectation_text import (
    Circumstances,
    EncounterRow,
    PhaseTimes,
    RecoveryRow,
    encounter_texts,
    expectation_texts,
    figure,
    was_tested,
)
from worldsim.results.fault_rows import fault_texts
from worldsim.results.finished_run import DeliveryRow
from worldsim.results.judge_rows import InvariantRow
from worldsim.results.outcome import INVARIANT_WORDS
from worldsim.results.overall import Overall, Row, ScenarioRow
from worldsim.results.refused_agents import refused_texts
from worldsim.results.summary import Summary

if TYPE_CHECKING:
    from worldsim.recording.comparison import Difference
    from worldsim.recording.verify import Verification

MODE_WORDS = {"processes": "processes", "lockstep": "lockstep", "virtual": "virtual time"}
CAUSE_WORDS = {
    "ahead": "ahead (too early)",
    "stale": "stale (too late)",
    "replay": "replay (older than one already used)",
    "incarnation": "with the mark of a process that does not run any more, or never did",
    "arrivals": "reports of delays that cannot be read",
    "verdicts": "reports of netem that cannot be read",
    "truth": "of positions that do not fit the run",
    "orders": "orders of faults that cannot be read",
}
"""Causes of rejection in words; the others are words already."""
COMPONENT_WORDS = {"world": "the world"}
LEAD_TOLD_S = 5.0
"""From this lead on, the verdict tells that queues stood before the whole formation [s]."""
METRES_FROM_M = 0.1
"""From this slot error on, it is shown in metres."""


def verdict(summary: Summary, folder: Path, recorded: bool) -> str:
    """Return the verdict of one run: its expectations, what it showed, and where its files are."""
    lines = [
        head(summary),
        *_expectations(summary["expectations"], circumstances(summary)),
        *remarks(summary),
        closing_line(summary, folder, recorded),
        *hints(folder, recorded),
    ]
    return "\n".join(lines)


def remarks(summary: Summary) -> list[str]:
    """Return lines on what a run showed beside its expectations."""
    return [
        *_coverage(summary["coverage"]),
        *_encounters(summary["encounters"]),
        *(f"  {text}" for text in fault_texts(summary["faults"])),
        f"  {_accuracy(summary)}",
        *(f"  {text}" for text in filter_texts(summary["safety_filter"])),
        *_sub_formations(summary["sub_formations"]),
        *_delivery(summary["delivery"]),
        *_rejected(summary["rejected_by_cause"]),
        *_taking_no_part(summary),
    ]


def hints(folder: Path, recorded: bool) -> list[str]:
    """Return lines on what to do next."""
    return [f"view it: qswarm view {folder}"] if recorded else []


def closing_line(summary: Summary, folder: Path, recorded: bool) -> str:
    """Return the outcome of one run with its reason, and where its files are, in one line."""
    return _outcome(summary, folder / ("run.rrd" if recorded else "summary.json"))


def closing_lines(overall: Overall, folder: Path) -> str:
    """Return a line for each of many runs that did not pass, and the outcome over all."""
    rows = [row for row in overall["rows"] if row["outcome"] != "pass"]
    lines = [_outcome(row, folder / row["run"]) for row in rows]
    return "\n".join([*lines, _over_all(overall, folder)])


def violation_text(name: str, tally: InvariantRow) -> str:
    """Return the violation of an invariant, such as I4, in words."""
    return f"{INVARIANT_WORDS[name]} ({name}), in {tally['violations']} of {tally['ticks']} ticks"


def table(overall: Overall, folder: Path) -> str:
    """Return a row for each of many runs, and for each scenario minimum, median and maximum."""
    width = max((len(row["run"]) for row in overall["rows"]), default=3)
    head = f"{'run':{width}}  separation  converged in  slot error  over turn limit  outcome"
    lines = [head, *(_run(row, width) for row in overall["rows"]), ""]
    for scenario in overall["scenarios"]:
        lines += _scenario(scenario)
    return "\n".join([*lines, _over_all(overall, folder)])


def verified(verification: "Verification") -> str:
    """Return what a recording shows by itself, and whether summary.json says the same."""
    rows: list[ExpectationRow] = [row.row for row in verification.expectations]
    expectations = _expectations(rows, _recorded_circumstances(verification))
    cut = "" if verification.whole else f" of {verification.duration_s:g} s"
    agreement = _agreement(verification)
    if not verification.exact:
        agreement.insert(0, "  positions in single precision: recorded by an older version")
    expectations += _encounters(verification.figures["encounters"])
    head = (
        f"{verification.scenario}, judged from the recording alone:"
        f" {verification.ticks} ticks, {verification.until_s:g} s{cut}"
    )
    outcome = f"{_verified_outcome(verification)}  {verification.run}"
    return "\n".join([head, *expectations, *agreement, outcome])


def _agreement(verification: "Verification") -> list[str]:
    """Return where summary.json differs, or contradicts itself, or else how far it agrees."""
    others = [_differing(each) for each in verification.file_differences]
    if not verification.summary:
        return [f"  no {SUMMARY_FILE} to compare with", *others]
    wrong = [_differing(each) for each in verification.differences] + others
    wrong += [f"  CONTRADICTS  {SUMMARY_FILE}: {each}" for each in verification.contradictions]
    if verification.uncompared is None:
        return wrong or [f"  {SUMMARY_FILE} agrees"]
    rest = "" if wrong else "; what does not depend on its length agrees"
    return [*wrong, f"  {SUMMARY_FILE} not compared: {verification.uncompared}{rest}"]


def _differing(each: "Difference") -> str:
    return (
        f"  DIFFERS  {each.key}: {each.summary} in {each.file}, {each.recording} in the recording"
    )


def _verified_outcome(verification: "Verification") -> str:
    doubt = verification.inconclusive
    if doubt is not None:
        return f"inconclusive ({doubt})"
    return "met" if verification.held else "NOT MET"


def head(summary: Summary) -> str:
    """Return what was run, and how, in one line."""
    factor = summary["real_time_factor"]
    pace = f" at {factor:.3g} x real time" if factor is not None else ""
    return (
        f"{summary['scenario']}, seed {summary['seed']}, {MODE_WORDS[summary['mode']]}:"
        f" {_counted(summary['agents'], 'agent')}, {summary['duration_s']:g} s simulated{pace}"
    )


def _outcome(summary: Any, file: Path) -> str:
    reason = f" ({summary['reason']})" if summary["reason"] else ""
    return f"{summary['outcome']}{reason}  {file}"


def _over_all(overall: Overall, folder: Path) -> str:
    """Return the outcome of many runs; those that were interrupted have none, but are counted."""
    file, reason = folder / "summary.json", overall["reason"] or ""
    if not reason.startswith(INTERRUPTION):
        return _outcome(overall, file)
    passed = sum(each["pass"] for each in overall["scenarios"])
    failed = sum(each["fail"] for each in overall["scenarios"])
    return f"{reason}; {passed} passed, {failed} failed  {file}"


def circumstances(summary: Summary) -> Circumstances:
    """Return what the words on a run's expectations depend on."""
    phases = [
        PhaseTimes(phase["from_s"], phase["timed_from_s"], phase["in_place_from_s"])
        for phase in summary["phases"]
    ]
    return Circumstances(summary["duration_s"], phases, summary["recoveries"])


def _recorded_circumstances(verification: "Verification") -> Circumstances:
    recoveries: list[RecoveryRow] = verification.figures["recoveries"]
    phases = [PhaseTimes.of(phase) for phase in verification.phases]
    return Circumstances(verification.until_s, phases, recoveries)


def _expectations(rows: list[ExpectationRow], run: Circumstances) -> list[str]:
    """Return a line for each expectation; "-" marks one that the run could not test."""
    return [
        f"  {_mark(row):9}{text}"
        for row, text in zip(rows, expectation_texts(rows, run), strict=True)
    ]


def _encounters(rows: list[EncounterRow]) -> list[str]:
    """Return lines on moving obstacles that came too near without anybody's fault."""
    return [f"  {'-':9}{text}" for text in encounter_texts(rows)]


def _mark(row: ExpectationRow) -> str:
    if row["held"] is None:
        return "open"
    if not was_tested(row):
        return "-"
    return "met" if row["held"] else "NOT MET"


def _accuracy(summary: Summary) -> str:
    residual_m, turns = summary["phases"][-1]["residual_m"], summary["turns_over_limit_fraction"]
    told = f"steps over the turn limit: {_percent(turns)}"
    forms = any(row["name"].startswith("converge") for row in summary["expectations"])
    if residual_m is None and not forms:
        return told  # who forms nothing has no slots
    error = _slot_error(residual_m, "not every agent has a place")
    return f"largest slot error at the end: {error}; {told}"


def _coverage(rows: list[CoverageRow]) -> list[str]:
    """Return a line for each property that must hold in some run."""
    return [
        f"  {'not seen' if row['first_s'] is None else 'seen    '} {row['name']}"
        + ("" if row["first_s"] is None else f": first at {row['first_s']:.4g} s")
        for row in rows
    ]


def _sub_formations(rows: list[SubFormationsRow]) -> list[str]:
    """Return a line for each formation of which the queues stood long before the whole."""
    return [
        f"  {row['formation']}: each queue stood in its line {lead_s:.1f} s before the whole"
        for row in rows
        if (lead_s := row["lead_s"]) is not None and lead_s >= LEAD_TOLD_S
    ]


def _delivery(delivery: DeliveryRow | None) -> list[str]:
    """Return a line on how much later than due frames were used; none if not measured."""
    if delivery is None:
        return []
    extra, within = delivery["excess_ms"], delivery["within_fraction"]
    return [
        f"  extra delivery delay: median {extra['p50']:.1f} ms, 99th percentile"
        f" {extra['p99']:.1f} ms; {_percent(within, 2)} of frames within"
        f" {delivery['bound_ms']:g} ms (one slot and one tick)"
    ]


def _rejected(rejected: dict[str, dict[str, int]]) -> list[str]:
    """Return a line on rejected messages: how many by which component; none if there are none."""
    parts = [
        f"by {COMPONENT_WORDS.get(component, component)}: {_causes(causes)}"
        for component, causes in rejected.items()
        if causes
    ]
    return [f"  messages rejected {'; '.join(parts)}"] if parts else []


def _taking_no_part(summary: Summary) -> list[str]:
    """Return a line for each agent of which all is rejected."""
    rows, faults, agents = summary["refused"], summary["faults"], summary["agents"]
    return [f"  {text}" for text in refused_texts(rows, faults, agents)]


def _causes(causes: dict[str, int]) -> str:
    counts = ((count, CAUSE_WORDS.get(cause, cause)) for cause, count in causes.items())
    return ", ".join(f"{count} {words}" for count, words in counts)


def _run(row: Row, width: int) -> str:
    reason = f" ({row['reason']})" if row["reason"] else ""
    return (
        f"{row['run']:{width}}  {figure(row['min_separation_m'], 'm', 3):>10}"
        f"  {figure(row['converge_s'], 's', 2):>12}"
        f"  {_slot_error(row['residual_m']):>10}"
        f"  {_percent(row['turns_over_limit_fraction']):>15}  {row['outcome']}{reason}"
    )


def _scenario(scenario: ScenarioRow) -> list[str]:
    spreads = [
        ("separation", scenario["min_separation_m"], "m", 3),
        ("converged in", scenario["converge_s"], "s", 2),
    ]
    lead = scenario["sub_formations_lead_s"]
    if lead is not None and lead["median"] >= LEAD_TOLD_S:
        spreads.append(("queues' lead", lead, "s", 2))
    doubtful = f", {scenario['inconclusive']} inconclusive" if scenario["inconclusive"] else ""
    made = _counted(scenario["runs"], "run")
    return [
        f"{scenario['scenario']}: {scenario['pass']} of {made} passed{doubtful}",
        *(
            f"  {name:12}  min {figure(spread['min'], unit, digits)},"
            f" median {figure(spread['median'], unit, digits)},"
            f" max {figure(spread['max'], unit, digits)} ({_counted(spread['measured'], 'run')})"
            for name, spread, unit, digits in spreads
            if spread is not None
        ),
        *(f"  seen in {runs} of {made}: {name}" for name, runs in scenario["coverage"].items()),
    ]


def _counted(count: int, what: str) -> str:
    """Return a number of things, such as "1 run" or "2 runs"."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def _slot_error(metres: float | None, unmeasured: str = "-") -> str:
    if metres is None:
        return unmeasured
    if metres >= METRES_FROM_M:
        return f"{metres:.3g} m"
    return f"{1000.0 * metres:.3g} mm" if metres >= 1e-3 else "< 1 mm"


def _percent(fraction: float | None, digits: int = 1) -> str:
    return f"{100 * fraction:.{digits}f} %" if fraction is not None else "-"
