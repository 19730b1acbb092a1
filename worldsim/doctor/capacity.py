"""How many agents this host flies: measured on a small fleet of processes, and in virtual time.

A fleet of processes needs CPU time for each step of each agent: the agent's own, netem's and the
world's. It keeps up while all of them together leave some of the cores free.
"""

import os
from pathlib import Path
from time import process_time
from typing import NamedTuple

from worldsim.bench.fleets import wedge
from worldsim.bench.measures import InvalidFigureError
from worldsim.bench.process_costs import flown, process_wedge
from worldsim.doctor.checks import Check
from worldsim.engine.virtual import VirtualFleet

AGENTS, FLIGHT_S = 16, 3.0
VIRTUAL_CPU_S = 1.0
USABLE = 0.75
"""Of the cores; with more, some ticks are late."""
STAT = Path("/proc/stat")
TICK_HZ = 20.0


class Capacity(NamedTuple):
    """What a host can fly at 20 Hz in real time."""

    cpu_us: float  # CPU time of a step of an agent, netem's and the world's share included
    cores: float  # usable by this process
    others: float  # cores that other programs kept busy meanwhile
    late_percent: float  # of the ticks of the small fleet

    @property
    def agents(self) -> int:
        """Number of agents with all cores."""
        return agents_in_real_time(self.cpu_us, self.cores)

    @property
    def agents_now(self) -> int:
        """Number of agents beside the programs that run now."""
        return agents_in_real_time(self.cpu_us, max(0.0, self.cores - self.others))


def agents_in_real_time(cpu_us: float, cores: float, tick_hz: float = TICK_HZ) -> int:
    """Return how many agents keep up on some cores. cpu_us: of one agent's step [us]."""
    return int(USABLE * cores * 1e6 / (cpu_us * tick_hz))


def measured_capacity() -> Capacity:
    """Fly a small fleet of processes for a few seconds. Raises InvalidFigureError."""
    before = _busy_s()
    own_before = _children_s()
    summary = flown(process_wedge(AGENTS, FLIGHT_S), False)
    busy_s, wall_s = (now - then for now, then in zip(_busy_s(), before, strict=True))
    own_s = _children_s() - own_before
    cores = float(len(os.sched_getaffinity(0)))
    others = (busy_s - own_s) / wall_s if wall_s > 0.0 else 0.0
    resources = (summary["resources"] or {}).get("cpu_us_per_agent_step")
    if not resources:
        raise InvalidFigureError("its CPU time was not measured")
    late = summary["late_tick_fraction"] or 0.0
    return Capacity(sum(resources.values()), cores, min(cores, max(0.0, others)), 100.0 * late)


def virtual_steps_per_s() -> float:
    """Return the agent-steps that virtual time makes in a second of CPU time, on one core."""
    fleet = VirtualFleet(wedge(AGENTS, 60.0))
    began_s, slots = process_time(), 0
    while process_time() - began_s < VIRTUAL_CPU_S:
        for _ in range(4):
            fleet.slot()
        slots += 4
    return slots / 4 * AGENTS / (process_time() - began_s)


def virtual_check(steps_per_s: float) -> Check:
    """Return how fast virtual time is, from its agent-steps in a second of CPU time."""
    speed = steps_per_s / (AGENTS * TICK_HZ)
    return Check("virtual time", f"{AGENTS} agents at {speed:.0f} x real time on one core (sim)")


def process_check(capacity: Capacity) -> Check:
    """Return what fleet of processes keeps up, and what is in its way."""
    says = (
        f"about {capacity.agents} agents in real time at {TICK_HZ:g} Hz (run):"
        f" {capacity.cpu_us:.0f} us of CPU for each step of an agent, {capacity.cores:g} cores"
    )
    hints = []
    if capacity.agents_now < 0.9 * capacity.agents:
        busy = f"{capacity.others:.1f} cores are busy with other programs"
        hints.append(f"{busy}: about {capacity.agents_now} at present")
    if capacity.late_percent >= 1.0:
        hints.append(f"{capacity.late_percent:.0f} % of ticks were late in a fleet of {AGENTS}")
    rest = "sim and run --lockstep fly any number, as fast as they can"
    return Check("processes", says, "; ".join([*hints, rest]) if hints else "")


def _busy_s() -> tuple[float, float]:
    """Return the CPU time that all cores were busy, and the wall time, since the start [s]."""
    fields = [int(each) for each in STAT.read_text(encoding="ascii").splitlines()[0].split()[1:9]]
    hertz, cores = os.sysconf("SC_CLK_TCK"), os.cpu_count() or 1
    idle = fields[3] + fields[4]
    return (sum(fields) - idle) / hertz, sum(fields) / hertz / cores


def _children_s() -> float:
    times = os.times()
    return times.children_user + times.children_system
