"""Checks of the faults of single agents whose processes go on."""

from worldsim.scenario.faults import AgentFault, ClockFault
from worldsim.scenario.problem import Problem


def agent_fault_problem(fault: AgentFault, at_s: float) -> Problem | None:
    """Return what makes a fault that begins at a time [s] invalid, besides its selectors."""
    return _clock_problem(fault, at_s)


def _clock_problem(fault: ClockFault, at_s: float) -> Problem | None:
    if fault.offset_s == fault.drift_ppm == 0.0:
        return Problem("offset_s", "0, as is drift_ppm: the clock would be right")
    if at_s + fault.offset_s < 0.0:
        detail = f"{fault.offset_s:g}; at {at_s:g} s the clock would show less than 0 s"
        return Problem("offset_s", detail)
    return None
