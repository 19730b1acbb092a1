"""Expectations in words: what a run showed of each, beside what was required."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol, TypedDict

from worldsim.judge.finding import ExpectationRow
from worldsim.scenario.tables import CONVERGED_S

CONVERGE = "converge "
"""An expectation's name begins so where it is about a formation; the formation's name follows."""
STARTS = ("join at ", "restart at ")
"""An expectation's name begins so where agents were to start and found no room."""
OWN = ("always ", "eventually ", "settle ")
"""An expectation's name begins so where it is a property of the user's own."""
UNSEEN = "no tick that counts has a value"
NEARLY_S = 0.1
"""A time that lacks less of what it has to be is not told exactly."""
MAX_NAMED = 4
"""A change of more agents is described by their number; so are more encounters."""
HINDRANCE_WORDS = {
    "not running": "a vehicle whose agent is not running cannot give way",
    "outrun": "the obstacle is faster than the vehicle, which came no nearer by itself",
}
"""Why a vehicle could not give way, in words."""


class RecoveryRow(TypedDict):
    """One change of the team."""

    t_s: float
    kind: str
    agents: list[int]
    reformed_s: float | None  # from timed_from_s, or t_s if null, to a whole formation
    timed_from_s: float | None  # t_s, or the end of the last fault that forbade it
    asked_s: float  # the longest time without such a fault, until it is whole again or to the end
    overtaken_s: float | None  # that time until the next change; null if re-formed before it
    in_place_from_s: (
        float | None
    )  # since when it was whole then, or is now; null if re-formed before
    changed: str | None  # conditions of the radio, where they are what changed


class EncounterRow(TypedDict):
    """A moving obstacle came too near to a vehicle that could not give way."""

    t_s: float
    agent: int
    obstacle: int  # its index in the scenario
    distance_m: float  # the least, centre to surface
    hindrance: str  # why the vehicle could not give way


class TimedPhase(Protocol):
    """What tells the times of a formation."""

    @property
    def from_s(self) -> float:
        """When it is asked for [s; simulated time]."""

    @property
    def timed_from_s(self) -> float | None:
        """From when its time counts [s; simulated time]."""

    @property
    def in_place_from_s(self) -> float | None:
        """Since when all are in place, for less than 2 s [s; simulated time]."""


class PhaseTimes(NamedTuple):
    """The times of one formation [s; simulated time]."""

    from_s: float  # when it is asked for
    timed_from_s: float | None  # from when its time counts; null while a fault forbids it
    in_place_from_s: float | None = None  # since when all were in place at its end, if not for 2 s

    @staticmethod
    def of(phase: TimedPhase) -> "PhaseTimes":
        """Return the times of a phase."""
        return PhaseTimes(phase.from_s, phase.timed_from_s, phase.in_place_from_s)


class Circumstances(NamedTuple):
    """What the words on an expectation depend on, beside its figures."""

    ended_s: float  # end of the run [s; simulated time]
    phases: Sequence[PhaseTimes]  # of each formation
    recoveries: Sequence[RecoveryRow]


class Span(NamedTuple):
    """The time that a formation had."""

    length_s: float
    end: str  # what ended it, in words
    forbidden: bool = False  # whether a fault forbade it to the end
    timed_from_s: float | None = None  # where a fault forbade it until then
    stood_s: float | None = None  # how long all were in place at the end; None: they were not


def expectation_texts(rows: Sequence[ExpectationRow], run: Circumstances) -> list[str]:
    """Return what a run showed of each expectation, one text each, in their order."""
    spans = _spans(run)
    return [
        _convergence(row, next(spans)) if row["name"].startswith(CONVERGE) else _other(row, run)
        for row in rows
    ]


class Cells(NamedTuple):
    """An expectation as a row of a table; a cell is "" where there is nothing to say."""

    what: str
    required: str
    got: str
    margin: str


def expectation_cells(rows: Sequence[ExpectationRow], run: Circumstances) -> list[Cells]:
    """Return each expectation as the cells of a table, in their order."""
    texts = expectation_texts(rows, run)
    return [_cells(row, text) for row, text in zip(rows, texts, strict=True)]


def encounter_texts(rows: Sequence[EncounterRow]) -> list[str]:
    """Return what a run showed of vehicles that could not give way, in a few lines."""
    texts = [
        f"obstacle[{row['obstacle']}] came within {row['distance_m']:.3f} m of a{row['agent']}"
        f" at {row['t_s']:.4g} s: not counted, {HINDRANCE_WORDS[row['hindrance']]}"
        for row in rows[:MAX_NAMED]
    ]
    return texts + [f"and {len(rows) - MAX_NAMED} more times"] * (len(rows) > MAX_NAMED)


def was_tested(row: ExpectationRow) -> bool:
    """Return whether a run could show anything of an expectation; without a test it is held."""
    return row["got"] is not None or row["held"] is not True


def figure(value: float | None, unit: str, digits: int) -> str:
    """Return a figure with its unit; "-" where it was not measured."""
    return f"{value:.{digits}f} {unit}".rstrip() if value is not None else "-"


def _spans(run: Circumstances) -> Iterator[Span]:
    """Yield the time of each formation, in order."""
    ends_s = [*(phase.from_s for phase in run.phases[1:]), run.ended_s]
    for index, (phase, end_s) in enumerate(zip(run.phases, ends_s, strict=True)):
        end = "the run ended" if index == len(ends_s) - 1 else "the next mission came"
        start_s, timed_s, whole_s = phase
        stood_s = end_s - whole_s if whole_s is not None else None
        if timed_s is None or timed_s == start_s:
            yield Span(end_s - start_s, end, forbidden=timed_s is None, stood_s=stood_s)
        else:
            yield Span(end_s - timed_s, end, timed_from_s=timed_s, stood_s=stood_s)


def _convergence(row: ExpectationRow, span: Span) -> str:
    name, got = row["name"].removeprefix(CONVERGE), row["got"]
    if got is not None:
        if span.forbidden:
            return f"{name}: converged in {got:.3g} s{_untimed(row)}"
        return f"{name}: converged in {got:.3g} s{_timed(span.timed_from_s)}{_limit(row)}"
    return _unconverged(name, row, span)


def _unconverged(name: str, row: ExpectationRow, span: Span) -> str:
    """Return what a team did that has not converged, in words. name: of the formation."""
    wanted, timed = row["wanted"], _timed(span.timed_from_s)
    if row["held"] is None and span.forbidden:
        return f"{name} did not converge: a fault that forbids it was in force to the end"
    if row["held"] is None and span.stood_s is not None:
        whole_s = span.length_s - span.stood_s
        stood = f"{_stood(span.stood_s)} when {span.end}"
        return f"{name}: the team was whole after {whole_s:.3g} s{timed}, but {stood}{_limit(row)}"
    if wanted is None:
        return f"{name} did not converge in {span.length_s:.4g} s{timed}{_unlimited(row, span)}"
    if row["held"] is False:
        return f"{name} did not converge within {wanted:g} s{timed}"
    return f"{name} did not converge{_within(wanted, span)}{timed}"


def _unlimited(row: ExpectationRow, span: Span) -> str:
    """Return why a team without a limit has not converged, or why that is not judged."""
    if row["held"] is None:
        return f": {span.end} too early"
    return ": not every agent was in its place at the end" if span.stood_s is None else ""


def _untimed(row: ExpectationRow) -> str:
    """Return that the team formed though a fault forbade it."""
    if row["held"] is None:
        return f" while a fault forbade it: not timed (limit {row['wanted']:g} s)"
    return f" though a fault forbade it{_limit(row)}"


def _timed(from_s: float | None) -> str:
    """Return that the time counts from the end of a fault, where it does."""
    return "" if from_s is None else f" from {from_s:.4g} s on, the end of a fault that forbids it"


def _within(wanted_s: float, span: Span) -> str:
    if span.length_s < wanted_s:
        return f": {span.end} after {span.length_s:.4g} s, before the limit of {wanted_s:g} s"
    return f" within {wanted_s:g} s"


def _other(row: ExpectationRow, run: Circumstances) -> str:
    name, wanted = row["name"], row["wanted"]
    if name == "reform_within_s":
        return _reform(row, run)
    if wanted is None and name.startswith(STARTS):
        return f"{name}: there was no room, so no agent started"
    if name in _BOUNDS:
        bound = _BOUNDS[name]
        required = f"required {bound.relation} {bound.scale * wanted:g} {bound.unit}".rstrip()
        margin = _margin(row, bound)
        left = f"; margin {margin}" if margin else ""
        return f"{bound.what}: {_measured(row, bound)} ({required}{left})"
    return _own(row) if name.startswith(OWN) else f"{name}: {row['got']} (required {wanted})"


def _cells(row: ExpectationRow, text: str) -> Cells:
    """Return the cells of an expectation; text: the same in words, where it has no figure."""
    name, wanted, got = row["name"], row["wanted"], row["got"]
    if name in _BOUNDS:
        bound = _BOUNDS[name]
        required = f"{bound.relation} {bound.scale * wanted:g} {bound.unit}".rstrip()
        return Cells(bound.what, required, _measured(row, bound), _margin(row, bound))
    if name.startswith(CONVERGE):
        formation = name.removeprefix(CONVERGE)
        shown = text.removeprefix(formation).removeprefix(":").strip().removesuffix(_limit(row))
        shown = shown.removeprefix("converged in ")
        return Cells(f"{formation} converges", *_timed_cells(row, shown))
    if name == "reform_within_s":
        words = text.removesuffix(_limit(row)).removeprefix("formation after a fault: ")
        shown = f"{got:.3g} s" if row["held"] and got is not None else words
        return Cells("formation restored after each fault", *_timed_cells(row, shown))
    if wanted is None:
        return Cells(name, "", text.removeprefix(f"{name}: "), "")
    return _own_cells(row) if name.startswith(OWN) else Cells(name, f"{wanted}", f"{got}", "")


def _own(row: ExpectationRow) -> str:
    """Return what a run showed of a property of the user's own, whose name begins with a verb."""
    what, required, got, margin = _own_cells(row)
    verb, _, title = what.partition(" ")
    words = {"always": f"always {title}", "eventually": f"{title}, once at least", "settle": title}
    left = f"; margin {margin}" if margin else ""
    return f"{words.get(verb, what)}: {got} (required {required}{left})"


def _own_cells(row: ExpectationRow) -> Cells:
    wanted, got, margin = row["wanted"], row["got"], row["margin"]
    if not row["name"].startswith("always "):
        held_s = f"from {got:.3g} s on" if got is not None else _not_held(row)
        required = "by the end" if wanted is None else f"within {wanted:g} s"
        return Cells(row["name"], required, held_s, "" if margin is None else f"{margin:.3g} s")
    if got is None or margin is None:
        none = UNSEEN if row["held"] is None else "at worst without a finite value"
        return Cells(row["name"], f"{wanted:.6g}", none, "")
    relation = ">=" if abs(got - wanted - margin) <= abs(wanted - got - margin) else "<="
    return Cells(row["name"], f"{relation} {wanted:.6g}", f"at worst {got:.6g}", f"{margin:.3g}")


def _not_held(row: ExpectationRow) -> str:
    return f"not so far, or {UNSEEN}" if row["held"] is None else "never, or not to the end"


def _timed_cells(row: ExpectationRow, got: str) -> tuple[str, str, str]:
    """Return the cells for what is required, was got, and is left of a time."""
    wanted_s, margin_s = row["wanted"], row["margin"]
    required = f"<= {wanted_s:g} s" if wanted_s is not None else "by the end"
    margin = f"{margin_s:.3g} s" if margin_s is not None else ""
    return required, got, margin


class _Bound(NamedTuple):
    what: str
    relation: str
    unit: str
    digits: int
    scale: float = 1.0


_BOUNDS = {
    "min_separation_m": _Bound("minimum separation", ">=", "m", 3),
    "min_obstacle_distance_m": _Bound("minimum obstacle distance", ">=", "m", 3),
    "in_formation_fraction": _Bound("time in formation", ">=", "%", 1, 100.0),
    "max_slot_error_m": _Bound("largest slot error in formation", "<=", "m", 3),
    "min_lambda2": _Bound("algebraic connectivity of the network", ">=", "", 3),
    "attitude_within_deg": _Bound("largest attitude error at the slots", "<=", "degrees", 1),
}


def _margin(row: ExpectationRow, bound: _Bound) -> str:
    margin = row["margin"]
    if margin is None:
        return ""
    return figure(bound.scale * margin, bound.unit, bound.digits)


def _measured(row: ExpectationRow, bound: _Bound) -> str:
    got = row["got"]
    if got is None:
        return _unmeasured(row)
    return figure(bound.scale * got, bound.unit, bound.digits)


def _unmeasured(row: ExpectationRow) -> str:
    if row["held"] is None:
        return "no time counted"
    endless = row["name"] == "max_slot_error_m" and not row["held"]
    return "an agent had no slot" if endless else "not measured"


def _reform(row: ExpectationRow, run: Circumstances) -> str:
    limit = _limit(row)
    if not was_tested(row):
        return f"formation after a fault: not tested, none took it away{limit}"
    if row["held"]:
        return f"formation restored within {row['got']:.3g} s of each fault{limit}"
    worst = _slowest(row, run)
    if worst is None:
        return f"formation after a fault: one was in force to the end{limit}"
    return _unrestored(row, run, worst)


def _unrestored(row: ExpectationRow, run: Circumstances, worst: RecoveryRow) -> str:
    """Return how the team did after the change that is worst, in words."""
    limit = _limit(row)
    if row["held"] is None and worst["overtaken_s"] is not None:
        overtaken = _overtaken(worst, worst["overtaken_s"], _overtaker(worst, run))
        return f"{_change(worst)}: {overtaken}{limit}"
    reformed_s, from_s = worst["reformed_s"], worst["timed_from_s"]
    timed = _timed(None if from_s == worst["t_s"] else from_s)
    if reformed_s is not None and from_s is None:
        return f"{_change(worst)}: re-formed after {reformed_s:.3g} s{_untimed(row)}"
    if reformed_s is not None:
        return f"{_change(worst)}: re-formed after {reformed_s:.3g} s{timed}{limit}"
    if row["held"] is None and worst["in_place_from_s"] is not None:
        stood = _stood(run.ended_s - worst["in_place_from_s"])
        whole = f"the team was whole after {worst['asked_s']:.3g} s{timed}"
        return f"{_change(worst)}: {whole}, but {stood} when the run ended{limit}"
    left = Span(worst["asked_s"], "the run ended")
    return f"{_change(worst)}: not re-formed{_within(row['wanted'], left)}{timed}"


def _overtaken(recovery: RecoveryRow, had_s: float, by: RecoveryRow) -> str:
    """Return how far the team had come at the next change, in words. had_s: its time until then."""
    whole_s = recovery["in_place_from_s"]
    if whole_s is None:
        return f"overtaken by the {_change(by)} after {had_s:.3g} s"
    stood = _stood(by["t_s"] - whole_s)
    return f"the team was whole after {had_s:.3g} s, but {stood} when the {_change(by)} overtook it"


def _stood(stood_s: float) -> str:
    """Return how long a team stood that has to stand for longer, in words."""
    if stood_s > CONVERGED_S - NEARLY_S:  # the last tick was a little earlier
        return f"had stood for a little less than {CONVERGED_S:g} s"
    return f"had stood for only {stood_s:.3g} s of {CONVERGED_S:g} s"


def _slowest(row: ExpectationRow, run: Circumstances) -> RecoveryRow | None:
    """Return the recovery that had the most time so far; of the open ones, where none is late.

    None where only a fault in force keeps the team from it.
    """

    def had_s(recovery: RecoveryRow) -> float:
        overtaken_s = recovery["overtaken_s"]
        return recovery["asked_s"] if overtaken_s is None else overtaken_s

    if row["held"] is not None:
        return max(run.recoveries, key=had_s)
    open_ = [
        each
        for each in run.recoveries
        if (
            each["timed_from_s"] is not None
            if each["reformed_s"] is None
            else each["reformed_s"] > row["wanted"]
        )
    ]
    return max(open_, key=had_s, default=None)


def _overtaker(recovery: RecoveryRow, run: Circumstances) -> RecoveryRow:
    """Return the next change after a recovery that was overtaken."""
    later = run.recoveries[run.recoveries.index(recovery) + 1 :]
    refused = [each for each in later if not each["agents"] and each["kind"] in ("restart", "join")]
    return next(each for each in later if each not in refused)


def _change(recovery: RecoveryRow) -> str:
    agents, changed = recovery["agents"], recovery["changed"]
    kind = recovery["kind"] if changed is None else f"{recovery['kind']} ({changed})"
    names = ", ".join(f"a{agent}" for agent in agents)
    if not agents:
        return f"{kind} at {recovery['t_s']:.4g} s"
    who = names if len(agents) <= MAX_NAMED else f"{len(agents)} agents"
    return f"{recovery['kind']} of {who} at {recovery['t_s']:.4g} s"


def _limit(row: ExpectationRow) -> str:
    wanted_s, margin_s = row["wanted"], row["margin"]
    margin = f"; margin {margin_s:.3g} s" if margin_s is not None else ""
    return f" (limit {wanted_s:g} s{margin})" if wanted_s is not None else ""
