"""The benchmark's rows: what is measured, its unit and its goal."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from netem.link_parameters import Conditions
from worldsim.bench.fleets import EIGHT_IN_RANGE_M, flight_cpu_s, wedge
from worldsim.bench.part_costs import control_step_us, frame_us
from worldsim.bench.recording_cost import recording_mb, recording_us

TICK_HZ = 20.0
WEDGE_S = 20.0


@dataclass(frozen=True, slots=True)
class Row:
    """One figure, the best of some repeats: a busy host can only make it worse."""

    name: str
    unit: str
    """Of goal and measured."""
    goal: float
    measured: float
    more: bool
    """Whether a greater value is better; then the goal is the least value."""

    @property
    def reached(self) -> bool:
        """Whether the goal is reached."""
        return self.measured >= self.goal if self.more else self.measured <= self.goal


def _real_time_factor() -> float:
    return WEDGE_S / flight_cpu_s(wedge(9, WEDGE_S))


def _steps_per_cpu_s(agents: int, duration_s: float) -> Callable[[], float]:
    scenario = wedge(agents, duration_s, EIGHT_IN_RANGE_M)
    return lambda: agents * TICK_HZ * duration_s / flight_cpu_s(scenario)


MEASURES: tuple[tuple[str, str, float, bool, Callable[[], float]], ...] = (
    ("control step, 8 neighbours, 4 obstacles", "us", 30.0, False, control_step_us),
    ("medium, a frame, N = 9, clean", "us", 15.0, False, lambda: frame_us(9)),
    ("medium, a frame, N = 100, clean", "us", 15.0, False, lambda: frame_us(100)),
    (
        "medium, a frame, N = 100, loss and jitter",
        "us",
        15.0,
        False,
        lambda: frame_us(100, Conditions(loss_percent=20.0, delay_ms=20.0, jitter_ms=5.0)),
    ),
    ("virtual time, N = 9, one core", "x real time", 50.0, True, _real_time_factor),
    ("virtual time, N = 10", "agent-steps/CPU s", 10_000.0, True, _steps_per_cpu_s(10, 10.0)),
    ("virtual time, N = 100", "agent-steps/CPU s", 20_000.0, True, _steps_per_cpu_s(100, 2.0)),
    ("recording, a tick, N = 200", "us", 500.0, False, lambda: recording_us(200)),
    ("recording, N = 200", "MB a minute", 25.0, False, lambda: recording_mb(200)),
)


def measured(repeats: int) -> Iterator[Row]:
    """Measure each row ``repeats`` times; yield it with its best figure."""
    for name, unit, goal, more, measure in MEASURES:
        found = [measure() for _ in range(repeats)]
        yield Row(name, unit, goal, max(found) if more else min(found), more)
