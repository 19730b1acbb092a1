"""The benchmark's rows in one process: what is measured, its unit and its goal."""

from collections.abc import Callable, Iterator

from netem.link_parameters import Conditions
from worldsim.bench.fleets import EIGHT_IN_RANGE_M, flight_cpu_s, wedge
from worldsim.bench.measures import Measure
from worldsim.bench.part_costs import control_step_us, frame_us
from worldsim.bench.recording_cost import recording_mb, recording_us
from worldsim.bench.team_growth import AgentCost, agent_cost

TICK_HZ = 20.0
WEDGE_S = 20.0
RADIO_SIZES = (9, 20, 50, 100, 200)
"""Teams whose traffic is measured."""
STEP_SIZES = (10, 100, 200)
"""Teams whose steps are measured."""


def _real_time_factor() -> float:
    return WEDGE_S / flight_cpu_s(wedge(9, WEDGE_S))


def _steps_per_cpu_s(agents: int, duration_s: float) -> Callable[[], float]:
    scenario = wedge(agents, duration_s, EIGHT_IN_RANGE_M)
    return lambda: agents * TICK_HZ * duration_s / flight_cpu_s(scenario)


Figure = Callable[[AgentCost], float]


def _cost(
    name: str, unit: str, agents: int, figure: Figure, goal: float | None, together: int = 0
) -> Measure:
    def cost() -> float:
        return figure(agent_cost(agents, together=together))

    return Measure(f"{name}, N = {agents}", unit, goal, False, cost)


def _growth(
    name: str, agents: int, least: int, figure: Figure, goal: float, together: int = 0
) -> Measure:
    def ratio() -> float:
        measured = agent_cost(agents, together=together)
        return figure(measured) / figure(agent_cost(least, together=together))

    return Measure(f"{name}, N = {agents} against {least}", "x", goal, False, ratio)


def _radio_rows() -> Iterator[Measure]:
    """Yield the size of a beacon and the traffic of an agent, by the team's size."""
    for agents in RADIO_SIZES:
        yield _cost("beacon, encoded", "B", agents, lambda cost: cost.beacon_b, None)
    for agents in RADIO_SIZES:
        yield _cost("local channel", "B/agent-s", agents, lambda cost: cost.local_bps, None)
    for agents in RADIO_SIZES:
        yield _cost("multihop channel", "B/agent-s", agents, lambda cost: cost.multihop_bps, None)
    yield _cost("both channels", "B/agent-s", 100, lambda cost: cost.sent_bps, 5500.0)
    for agents in RADIO_SIZES[1:]:
        yield _growth("both channels", agents, RADIO_SIZES[0], lambda cost: cost.sent_bps, 1.1)


def _step_rows() -> Iterator[Measure]:
    """Yield the CPU time of an agent's step, by the team's size."""
    least, most = STEP_SIZES[0], STEP_SIZES[-1]
    for agents in STEP_SIZES:
        yield _cost("others that hear a frame", "agents", agents, lambda cost: cost.heard_by, None)
        yield _cost("agent step, mean", "us", agents, lambda cost: cost.step_us, None, most)
        yield _cost("agent step, dearest 1 %", "us", agents, lambda c: c.dearest_us, None, most)
        yield _cost("agent step, worst", "us", agents, lambda cost: cost.worst_us, None, most)
        yield _cost("flight, for each agent step", "us", agents, lambda c: c.flight_us, None, most)
    for agents in STEP_SIZES[1:]:
        yield _growth("agent step, mean", agents, least, lambda c: c.step_us, 1.3, most)
        yield _growth("agent step, dearest 1 %", agents, least, lambda c: c.dearest_us, 1.3, most)


MEASURES: tuple[Measure, ...] = (
    Measure("control step, 8 neighbours, 4 obstacles", "us", 30.0, False, control_step_us),
    Measure("medium, a frame, N = 9, clean", "us", 15.0, False, lambda: frame_us(9)),
    Measure("medium, a frame, N = 100, clean", "us", 15.0, False, lambda: frame_us(100)),
    Measure(
        "medium, a frame, N = 100, loss and jitter",
        "us",
        15.0,
        False,
        lambda: frame_us(100, Conditions(loss_percent=20.0, delay_ms=20.0, jitter_ms=5.0)),
    ),
    Measure("virtual time, N = 9, one core", "x real time", 50.0, True, _real_time_factor),
    Measure(
        "virtual time, N = 10", "agent-steps/CPU s", 10_000.0, True, _steps_per_cpu_s(10, 10.0)
    ),
    Measure(
        "virtual time, N = 100", "agent-steps/CPU s", 20_000.0, True, _steps_per_cpu_s(100, 2.0)
    ),
    Measure("recording, a tick, N = 200", "us", 500.0, False, lambda: recording_us(200)),
    Measure("recording, N = 200", "MB a minute", 25.0, False, lambda: recording_mb(200)),
    *_radio_rows(),
    *_step_rows(),
)
