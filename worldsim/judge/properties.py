"""Properties of the user's own, watched over the ticks of a run: [[expect.property]]."""

from collections.abc import Sequence
from math import dist, inf, isnan
from typing import Final, NamedTuple, TypedDict

from worldsim.judge.finding import Expectation
from worldsim.judge.tick import Tick
from worldsim.scenario.properties import Condition, Property
from worldsim.scenario.tables import CONVERGED_S, Scenario
from worldsim.truth.vehicle import Floats

ROUNDING_S: Final = 1e-9


class Measured(NamedTuple):
    """What a property may be about at one tick."""

    tick: Tick
    before: Tick  # the tick before it, itself at the first
    separation: Floats  # (N,) [m]
    slot_error: Floats  # (N,) [m]
    obstacle_distance: Floats | None  # (N,) [m]
    parted: bool  # whether a fault parts the team
    disturbed: bool  # whether a fault's window is open, or a fault parts the team


class Worst(NamedTuple):
    """The value of a condition that is farthest on the wrong side, or nearest to it."""

    margin: float  # how far it is on the good side; below 0: the condition does not hold
    value: float
    bound: float
    lower: bool  # whether the bound is a lower one


class CoverageRow(TypedDict):
    """What of a campaign's runs a run covers."""

    name: str
    first_s: float | None  # when it held first [s]; null: it did not


class Coverage(NamedTuple):
    """Whether a run showed what some run has to show."""

    title: str
    first_s: float | None  # when it did first [s]

    @property
    def row(self) -> CoverageRow:
        """The coverage as summary.json holds it."""
        return {"name": self.title, "first_s": self.first_s}


class PropertyMonitor:
    """Watches one property. planned_end_s: time of the run's last tick, if it flies to its end.

    after_s: when the last planned fault ends [s].
    """

    def __init__(self, wanted: Property, planned_end_s: float, after_s: float) -> None:
        self._wanted = wanted
        to_s = planned_end_s if wanted.to_s is None else min(wanted.to_s, planned_end_s)
        self._from_s = max(wanted.from_s, after_s if wanted.counted == "after" else 0.0)
        self._to_s = to_s
        self._until_s = 0.0
        """Time of the last tick seen [s]."""
        self._worst: Worst | None = None
        self._first_s: float | None = None
        """When it held first [s]."""
        self._since_s: float | None = None
        """Since when it has held without a break [s]."""

    def see(self, measured: Measured) -> None:
        """Take a tick; ticks come in order."""
        time_s = self._until_s = measured.tick.time_s
        if not self._from_s - ROUNDING_S <= time_s <= self._to_s + ROUNDING_S:
            return
        if self._wanted.counted == "undisturbed" and measured.disturbed:
            return
        if not all(_holds(worst_of(each, measured)) for each in self._wanted.where):
            return
        worst = worst_of(self._wanted, measured)
        if worst is not None and (self._worst is None or worst.margin < self._worst.margin):
            self._worst = worst
        if not _holds(worst):
            self._since_s = None
        else:
            self._first_s = time_s if self._first_s is None else self._first_s
            self._since_s = time_s if self._since_s is None else self._since_s

    @property
    def coverage(self) -> Coverage | None:
        """What of a campaign's runs the run covers; None where the run itself must show it."""
        if self._wanted.must != "sometimes":
            return None
        return Coverage(self._wanted.title, self._first_s)

    def expectation(self) -> Expectation | None:
        """Return what the run showed so far; None where it need not show it."""
        match self._wanted.must:
            case "always":
                return self._always()
            case "eventually":
                return self._by(self._first_s, needs_s=0.0)
            case "settle":
                return self._by(self._since_s, needs_s=CONVERGED_S)
            case "sometimes":
                return None

    @property
    def _name(self) -> str:
        return f"{self._wanted.must} {self._wanted.title}"

    def _always(self) -> Expectation:
        worst = self._worst
        if worst is None:
            bound = self._wanted.at_most if self._wanted.at_least is None else self._wanted.at_least
            return Expectation(name=self._name, wanted=bound, got=None, held=None)
        return Expectation(
            name=self._name,
            wanted=worst.bound,
            got=worst.value,
            held=worst.margin >= 0.0,
            at_least=worst.lower,
        )

    def _by(self, at_s: float | None, needs_s: float) -> Expectation:
        """Return whether it held from a time on that comes early enough, for so long at least."""
        within_s, ended_s = self._wanted.within_s, min(self._until_s, self._to_s)
        whole = self._until_s >= self._to_s - ROUNDING_S
        lasted = at_s is not None and ended_s - at_s >= needs_s - ROUNDING_S
        got_s = at_s - self._from_s if at_s is not None and lasted else None
        held: bool | None
        if got_s is not None:
            held = within_s is None or got_s <= within_s
        elif self._worst is None or at_s is not None:
            held = None  # nobody stated it at a tick that counts, or it has still to last
        else:
            too_late = whole if within_s is None else self._is_late(ended_s)
            held = False if too_late else None
        return Expectation(name=self._name, wanted=within_s, got=got_s, held=held)

    def _is_late(self, time_s: float) -> bool:
        within_s = self._wanted.within_s
        return within_s is not None and time_s - self._from_s > within_s


def monitors_of(scenario: Scenario) -> list[PropertyMonitor]:
    """Return a monitor for each property of a scenario."""
    tick_s = 1.0 / scenario.fleet.tick_hz
    ends_s = [each.at_s + (each.for_s or 0.0) for each in scenario.event]
    after_s = max(ends_s, default=0.0)
    end_s = scenario.duration_s - tick_s
    return [PropertyMonitor(each, end_s, after_s) for each in scenario.expect.property]


def worst_of(condition: Condition, measured: Measured) -> Worst | None:
    """Return the worst value of a condition at a tick; None where there is no value."""
    values = _of_team(condition, _values(condition, measured))
    worst: Worst | None = None
    for value in values:
        for bound, lower in ((condition.at_least, True), (condition.at_most, False)):
            if bound is not None:
                margin = value - bound if lower else bound - value
                if worst is None or margin < worst.margin:
                    worst = Worst(margin, value, bound, lower)
    return worst


def _holds(worst: Worst | None) -> bool:
    return worst is not None and worst.margin >= 0.0


def _values(condition: Condition, measured: Measured) -> list[float]:
    """Return the values of the agents that have one; of a figure of the team, the only one."""
    tick = measured.tick
    series: Sequence[float]
    if condition.signal is not None:
        found = tick.signals.get(condition.signal)
        series = () if found is None else found.tolist()
    elif condition.figure == "running":
        return [float(sum(tick.alive.tolist()))]
    elif condition.figure == "parted":
        return [1.0 if measured.parted else 0.0]
    else:
        series = _figure(condition.figure or "", measured)
    return [value for value in series if not isnan(value)]


def _figure(name: str, measured: Measured) -> Sequence[float]:
    """Return a figure of each agent, NaN where there is none."""
    if name == "speed_mps":
        return _speeds(measured.before, measured.tick)
    if name == "turn_deg":
        return [abs(turn) for turn in measured.tick.turn_deg.tolist()]
    rows = {
        "separation_m": measured.separation,
        "slot_error_m": measured.slot_error,
        "obstacle_distance_m": measured.obstacle_distance,
    }[name]
    series: list[float] = [] if rows is None else rows.tolist()
    return series


def _speeds(before: Tick, tick: Tick) -> list[float]:
    """Return how fast each vehicle flew since the tick before [m/s]."""
    lasted_s = tick.time_s - before.time_s
    if lasted_s <= 0.0:
        return []
    pairs = zip(before.position.tolist(), tick.position.tolist(), strict=True)
    return [dist(here, there) / lasted_s for here, there in pairs]


def _of_team(condition: Condition, values: list[float]) -> list[float]:
    """Return the values that must keep the bound: those of each agent, or one of the team."""
    if not values or condition.over == "each":
        return values
    least, most, total = inf, -inf, 0.0
    for value in values:
        least, most, total = min(least, value), max(most, value), total + value
    match condition.over:
        case "mean":
            return [total / len(values)]
        case "least":
            return [least]
        case "most":
            return [most]
    return [most - least]
