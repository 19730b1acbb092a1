"""The rows of a report's tables: words and figures of a run, as its recording shows them.

Figures come from the recording; only what no recording can hold (the outcome of a run that the host
made inconclusive, the host's pace, provenance) comes from summary.json.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

from worldsim.judge.finding import ExpectationRow
from worldsim.report.page_parts import UNKNOWN, Figure, provenance
from worldsim.results.expectation_text import (
    CONVERGE,
    Circumstances,
    PhaseTimes,
    expectation_texts,
    was_tested,
)
from worldsim.results.fault_rows import fault_texts
from worldsim.results.outcome import INVARIANT_WORDS
from worldsim.results.run import Run

AT_LEAST = (
    "min_separation_m",
    "min_obstacle_distance_m",
    "in_formation_fraction",
    "min_lambda2",
)
"""Expectations with a lower limit; the others have an upper one."""
MODES = {
    "processes": "real processes, free-running",
    "lockstep": "real processes, lockstep",
    "virtual": "virtual time",
}


class Unit(NamedTuple):
    """How a figure is written: its name, its unit, digits after the point, and a factor."""

    name: str
    unit: str
    digits: int
    factor: float = 1.0

    def text(self, value: float | None) -> str:
        """Return a figure in words; a dash where there is none."""
        if value is None:
            return UNKNOWN
        return f"{self.factor * value:.{self.digits}f} {self.unit}".rstrip()

    def limit(self, value: float) -> str:
        """Return what is required in words, as short as it is."""
        return f"{self.factor * value:g} {self.unit}".rstrip()


UNITS = {
    "min_separation_m": Unit("minimum separation", "m", 3),
    "min_obstacle_distance_m": Unit("minimum obstacle distance", "m", 3),
    "in_formation_fraction": Unit("time in formation", "%", 1, 100.0),
    "max_slot_error_m": Unit("largest slot error in formation", "m", 3),
    "min_lambda2": Unit("algebraic connectivity", "", 3),
    "attitude_within_deg": Unit("largest attitude error", "deg", 1),
    "reform_within_s": Unit("formation restored after a fault", "s", 2),
}


class Verdict(NamedTuple):
    """The outcome of a run, and why."""

    outcome: str
    reason: str


class ExpectationCells(NamedTuple):
    """One expectation: what was required, what the run got, and the margin."""

    name: str
    required: str
    got: Figure
    margin: Figure
    verdict: str
    """"met", "NOT MET", "open" (the run was too short to tell), or "-" (not tested)."""
    text: str


def verdict_of(run: Run) -> Verdict:
    """Return the outcome by summary.json; by the recording alone where there is none."""
    if run.summary is not None:
        return Verdict(str(run.summary.get("outcome")), str(run.summary.get("reason") or ""))
    doubt = run.verification.inconclusive
    if doubt is not None:
        return Verdict("inconclusive", doubt)
    return Verdict("pass" if run.verification.passes else "fail", "judged from the recording")


def expectation_cells(run: Run) -> Iterator[ExpectationCells]:
    """Yield the run's expectations."""
    rows: list[ExpectationRow] = run.figures["expectations"]
    phases = [
        PhaseTimes(phase["from_s"], phase["timed_from_s"], phase["in_place_from_s"])
        for phase in run.figures["phases"]
    ]
    circumstances = Circumstances(run.ended_s, phases, run.figures["recoveries"])
    texts = expectation_texts(rows, circumstances)
    for index, (row, text) in enumerate(zip(rows, texts, strict=True)):
        unit, key = _unit(row["name"]), f"expectations.{index}"
        relation = "at least" if row["name"] in AT_LEAST else "at most"
        wanted = row["wanted"]
        yield ExpectationCells(
            name=unit.name,
            required=UNKNOWN if wanted is None else f"{relation} {unit.limit(wanted)}",
            got=Figure(unit.text(row["got"]), f"{key}.got", row["got"]),
            margin=Figure(unit.text(row["margin"]), f"{key}.margin", row["margin"]),
            verdict=_verdict(row),
            text=text,
        )


def tiles(run: Run) -> list[tuple[str, Figure]]:
    """Return the figures that sum a run up, with their names."""
    figures, packets = run.figures, run.packets
    phases = phases_of(run)
    found = [_named(run, "min_separation_m")]
    if figures["min_obstacle_distance_m"] is not None:
        found.append(_named(run, "min_obstacle_distance_m"))
    slowest = max(
        range(len(phases)), key=lambda index: phases[index]["converge_s"] or 0.0, default=None
    )
    if slowest is not None:
        time_s = phases[slowest]["converge_s"]
        words = UNKNOWN if time_s is None else f"{time_s:.2f} s"
        name = "converged in" if len(phases) == 1 else "slowest convergence"
        found.append((name, Figure(words, f"phases.{slowest}.converge_s", time_s)))
        last = len(phases) - 1
        error_m = phases[last]["residual_m"]
        key = f"phases.{last}.residual_m"
        found.append(("slot error at the end", Figure(length_text(error_m), key, error_m)))
    share = figures["turns_over_limit_fraction"]
    words = UNKNOWN if share is None else f"{100.0 * share:.1f} %"
    found.append(("turns over the limit", Figure(words, "turns_over_limit_fraction", share)))
    if packets.rows and packets["addressed"][-1]:
        received = packets["delivered"][-1] / packets["addressed"][-1]
        found.append(("frames delivered", Figure(f"{100.0 * received:.1f} %")))
    return found


def phases_of(run: Run) -> list[dict[str, Any]]:
    """Return the formations by the recording; none where the scenario asks for none."""
    phases: list[dict[str, Any]] = run.figures["phases"]
    return phases if run.scenario.expect.converge else []


def phase_rows(run: Run) -> list[list[Figure]]:
    """Return a row for each formation: name, from, converged in, slot error at its end."""
    return [
        [
            Figure(phase["formation"]),
            Figure(f"{phase['from_s']:g} s"),
            Figure(
                "did not" if phase["converge_s"] is None else f"{phase['converge_s']:.2f} s",
                f"phases.{index}.converge_s",
                phase["converge_s"],
            ),
            Figure(
                length_text(phase["residual_m"]), f"phases.{index}.residual_m", phase["residual_m"]
            ),
        ]
        for index, phase in enumerate(phases_of(run))
    ]


def invariant_rows(run: Run) -> list[list[Figure]]:
    """Return a row for each invariant: name, what would break it, ticks, violations."""
    return [
        [
            Figure(name),
            Figure(INVARIANT_WORDS.get(name, "")),
            Figure(f"{tally['ticks']:,}", f"invariants.{name}.ticks", tally["ticks"]),
            Figure(
                f"{tally['violations']:,}", f"invariants.{name}.violations", tally["violations"]
            ),
        ]
        for name, tally in run.figures["invariants"].items()
    ]


def fault_lines(run: Run) -> list[str]:
    """Return a line for each fault and what it struck."""
    if run.summary is None:
        return []
    return fault_texts(run.summary.get("faults", []))


def name_of(run: Run) -> str:
    """Return the name of a run's folder."""
    path = run.path.resolve()
    return path.name if path.is_dir() else path.parent.name


def heading(run: Run) -> str:
    """Return what was flown, in a line."""
    figures = run.figures
    mode = MODES.get(str(run.mode), "an older recording")
    agents = figures["agents"]
    return (
        f"{agents} agent{'' if agents == 1 else 's'}, {figures['duration_s']:g} s simulated,"
        f" seed {figures['seed']}, {mode}"
    )


def provenance_rows(run: Run) -> list[tuple[str, str]]:
    """Return what produced the run: code, packages, host, seed and hash."""
    known = run.summary or {}
    pace = known.get("real_time_factor")
    late = known.get("late_tick_fraction")
    return [
        ("scenario", run.scenario.name),
        ("seed", str(run.scenario.seed)),
        ("clock", MODES.get(str(run.mode), UNKNOWN)),
        *provenance(known),
        ("pace", UNKNOWN if pace is None else f"{pace:.3g} times real time"),
        ("late ticks", UNKNOWN if late is None else f"{100.0 * late:.2f} %"),
        ("trace_sha256", str(known.get("trace_sha256") or UNKNOWN)),
    ]


def agreement(run: Run) -> str:
    """Return whether the recording and summary.json have the same figures, in a sentence."""
    if run.summary is None:
        return "Every figure on this page is computed from the recording alone."
    if not run.verification.whole:
        return "Every figure is computed from the recording, which is not whole: see the notes."
    if not run.differences:
        return "Every figure is computed from the recording, and equals the one in summary.json."
    named = ", ".join(each.key for each in run.differences[:6])
    return f"Figures of the recording and of summary.json differ: {named}."


def comparison_rows(runs: list[Run]) -> list[tuple[str, list[Figure]]]:
    """Return a row for each figure of several runs, with a cell for each run."""
    columns = [dict(_compared(run)) for run in runs]
    names = list(dict.fromkeys(name for column in columns for name in column))
    return [(name, [column.get(name, Figure(UNKNOWN)) for column in columns]) for name in names]


def length_text(metres: float | None) -> str:
    """Return a length in millimetres where it is short; a dash where there is none."""
    if metres is None:
        return UNKNOWN
    if metres >= 0.1:
        return f"{metres:.3g} m"
    return f"{1000.0 * metres:.3g} mm" if metres >= 1e-3 else "< 1 mm"


def _compared(run: Run) -> Iterator[tuple[str, Figure]]:
    yield "scenario", Figure(run.scenario.name)
    yield "seed", Figure(str(run.scenario.seed))
    yield "clock", Figure(MODES.get(str(run.mode), UNKNOWN))
    yield "agents", Figure(str(run.figures["agents"]))
    yield "simulated", Figure(f"{run.figures['duration_s']:g} s")
    yield "outcome", Figure(verdict_of(run).outcome)
    yield from tiles(run)
    yield "expectations met", Figure(_met(run))
    yield "faults", Figure(str(len((run.summary or {}).get("faults", []))))


def _met(run: Run) -> str:
    rows: list[ExpectationRow] = run.figures["expectations"]
    return f"{sum(row['held'] is True for row in rows)} of {len(rows)}"


def _named(run: Run, key: str) -> tuple[str, Figure]:
    unit, value = UNITS[key], run.figures[key]
    return unit.name, Figure(unit.text(value), key, value)


def _unit(name: str) -> Unit:
    if name.startswith(CONVERGE):
        return Unit(f"{name.removeprefix(CONVERGE)} formed", "s", 2)
    return UNITS.get(name, Unit(name, "", 3))


def _verdict(row: ExpectationRow) -> str:
    if row["held"] is None:
        return "open"
    if not was_tested(row):
        return UNKNOWN
    return "met" if row["held"] else "NOT MET"
