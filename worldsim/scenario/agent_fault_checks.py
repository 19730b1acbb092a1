"""Checks of the faults of single agents whose processes go on."""

from math import ceil
from typing import assert_never

from worldsim.scenario.faults import (
    MAX_PASSWORDS,
    AgentFault,
    ClockFault,
    Intruder,
    PoseFault,
    SlowFault,
    StarveFault,
)
from worldsim.scenario.problem import Problem


def agent_fault_problem(fault: AgentFault, at_s: float, tick_hz: float) -> Problem | None:
    """Return what makes a fault that begins at a time [s] invalid, besides its selectors.

    tick_hz: of the fleet.
    """
    match fault:
        case ClockFault():
            return _clock_problem(fault, at_s)
        case PoseFault():
            return _pose_problem(fault)
        case Intruder():
            return _intruder_problem(fault)
        case StarveFault():
            return _starve_problem(fault, tick_hz)
        case SlowFault():
            return None  # its number is within its bounds
    assert_never(fault)


def _clock_problem(fault: ClockFault, at_s: float) -> Problem | None:
    if fault.offset_s == fault.drift_ppm == 0.0:
        return Problem("offset_s", "0, as is drift_ppm: the clock would be right")
    if at_s + fault.offset_s < 0.0:
        detail = f"{fault.offset_s:g}; at {at_s:g} s the clock would show less than 0 s"
        return Problem("offset_s", detail)
    return None


def _starve_problem(fault: StarveFault, tick_hz: float) -> Problem | None:
    """Refuse what leaves less than a tick: an agent whose step never falls into it is paused."""
    runs_s = 0.01 * fault.cpu_percent * fault.period_s
    if runs_s * tick_hz >= 1.0 - 1e-9:
        return None
    least_s = ceil(1e4 / (fault.cpu_percent * tick_hz)) / 100.0
    detail = (
        f"{fault.period_s:g}; {fault.cpu_percent:g} % of it is {1e3 * runs_s:g} ms, less than a"
        f" tick of {1e3 / tick_hz:g} ms: steps may never take place; {least_s:g} is enough"
    )
    return Problem("period_s", detail)


def _intruder_problem(fault: Intruder) -> Problem | None:
    named = sum(isinstance(selector, int) for selector in fault.agents)
    if named <= MAX_PASSWORDS:
        return None
    return Problem("agents", f"{named} agents; an intruder has at most {MAX_PASSWORDS} passwords")


def _pose_problem(fault: PoseFault) -> Problem | None:
    if any(fault.bias_m) or fault.noise_m or fault.bias_yaw_deg:
        return None
    return Problem("bias_m", "0, as are noise_m and bias_yaw_deg: the pose would be right")
