"""Checks of the faults of single agents whose processes go on."""

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


def agent_fault_problem(fault: AgentFault, at_s: float) -> Problem | None:
    """Return what makes a fault that begins at a time [s] invalid, besides its selectors."""
    match fault:
        case ClockFault():
            return _clock_problem(fault, at_s)
        case PoseFault():
            return _pose_problem(fault)
        case Intruder():
            return _intruder_problem(fault)
        case SlowFault() | StarveFault():
            return None  # their numbers are within their bounds
    assert_never(fault)


def _clock_problem(fault: ClockFault, at_s: float) -> Problem | None:
    if fault.offset_s == fault.drift_ppm == 0.0:
        return Problem("offset_s", "0, as is drift_ppm: the clock would be right")
    if at_s + fault.offset_s < 0.0:
        detail = f"{fault.offset_s:g}; at {at_s:g} s the clock would show less than 0 s"
        return Problem("offset_s", detail)
    return None


def _intruder_problem(fault: Intruder) -> Problem | None:
    named = sum(isinstance(selector, int) for selector in fault.agents)
    if named <= MAX_PASSWORDS:
        return None
    return Problem("agents", f"{named} agents; an intruder has at most {MAX_PASSWORDS} passwords")


def _pose_problem(fault: PoseFault) -> Problem | None:
    if any(fault.bias_m) or fault.noise_m or fault.bias_yaw_deg:
        return None
    return Problem("bias_m", "0, as are noise_m and bias_yaw_deg: the pose would be right")
