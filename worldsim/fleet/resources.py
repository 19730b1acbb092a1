"""What the processes of a launched fleet use while it runs: CPU time by part, and memory."""

import os
from statistics import median

from worldsim.fleet.culprits import SharedSteps
from worldsim.fleet.process_state import private_mb, process_state
from worldsim.results.finished_run import ResourcesRow

MEASURED_AGENTS = 10
"""So many agents' memory is read, after the run: the kernel takes about a millisecond for each."""

PARTS = ("agents", "netem", "world")
CpuTimes = dict[str, dict[int, float]]
"""CPU time so far [s], by part and pid."""


class ResourceMeter:
    """Reads the CPU time of the processes at both ends of a run; steps: None, nothing is known."""

    def __init__(self, steps: SharedSteps | None) -> None:
        self.row: ResourcesRow | None = None
        """What was used; None before the end, and where it is not known."""
        self._steps = steps
        self._before: CpuTimes = {}

    def begin(self) -> None:
        """Note that the run begins: the start is not counted."""
        if self._steps is not None:
            self._before = _cpu_times(self._steps)

    def end(self, agent_steps: int) -> None:
        """Note that the run ends, while all processes are there.

        agent_steps: how often an agent was to step. Processes that began or ended during the run
        are not counted.
        """
        if self._steps is None or not agent_steps:
            return
        after = _cpu_times(self._steps)
        memories = [private_mb(pid) for pid in list(after["agents"])[:MEASURED_AGENTS]]
        known = [each for each in memories if each is not None]
        self.row = {
            "start_up_s": None,
            "agent_steps": agent_steps,
            "cpu_us_per_agent_step": {
                part: 1e6 * _used_s(self._before[part], after[part]) / agent_steps for part in PARTS
            },
            "agent_private_mb": median(known) if known else None,
        }


def _cpu_times(steps: SharedSteps) -> CpuTimes:
    return {
        "agents": _by_pid([steps.page.read(agent).pid for agent in range(steps.agents)]),
        "netem": _by_pid([steps.medium_pid(shard) for shard in range(steps.mediums)]),
        "world": _by_pid([os.getpid()]),
    }


def _by_pid(pids: list[int]) -> dict[int, float]:
    states = {pid: process_state(pid) for pid in pids}
    return {pid: state.cpu_s for pid, state in states.items() if state is not None}


def _used_s(before: dict[int, float], after: dict[int, float]) -> float:
    return sum(cpu_s - before[pid] for pid, cpu_s in after.items() if pid in before)
