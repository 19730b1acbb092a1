"""Effects of faults of single agents: what the world shows them from now on, and the events."""

from collections.abc import Iterator
from math import radians
from typing import Any, assert_never

from worldsim.engine.operations import DisturbAgents
from worldsim.engine.slow_controllers import SlowControllers
from worldsim.engine.starvation import Share, Starvation
from worldsim.judge.event import By
from worldsim.judge.run_events import (
    AgentFaultRunEvent,
    ClockChanged,
    Intruded,
    PoseChanged,
    SlowChanged,
    Starved,
)
from worldsim.scenario.faults import (
    ClockFault,
    FaultOfEach,
    Intruder,
    PoseFault,
    SlowFault,
    StarveFault,
)
from worldsim.truth.agent_clocks import ClockError
from worldsim.truth.pose_errors import PoseError
from worldsim.truth.world import World


class AgentFaultEffects:
    """Begins and ends faults of agents in a world."""

    def __init__(self, world: World, slow: SlowControllers, starvation: Starvation) -> None:
        self._world = world
        self._slow, self._starvation = slow, starvation

    def apply(
        self, operation: DisturbAgents, t_s: float, by: By
    ) -> Iterator[AgentFaultRunEvent | Intruded]:
        """Apply an operation at a time [s]; yield an event for each agent, or one for all."""
        fault = operation.fault
        if isinstance(fault, Intruder):
            yield _intruded(operation, fault, t_s, by)
            return
        for agent in operation.agents:
            if operation.ends:
                self._end(operation.number, fault, agent)
            else:
                self._begin(operation.number, fault, agent, t_s)
            yield _event(operation, fault, agent, t_s, by)

    def _begin(self, number: int, fault: FaultOfEach, agent: int, t_s: float) -> None:
        world = self._world
        match fault:
            case ClockFault():
                error = ClockError(t_s, fault.offset_s, fault.drift_ppm)
                world.clocks.begin(number, agent, error)
            case PoseFault():
                wrong = PoseError(fault.bias_m, fault.noise_m, radians(fault.bias_yaw_deg))
                world.pose_errors.begin(number, agent, wrong)
            case SlowFault():
                self._slow.begin(number, agent, fault.delay_s)
            case StarveFault():
                share = Share(t_s, fault.cpu_percent, fault.period_s)
                self._starvation.begin(number, agent, share)
            case _:
                assert_never(fault)

    def _end(self, number: int, fault: FaultOfEach, agent: int) -> None:
        world = self._world
        match fault:
            case ClockFault():
                world.clocks.end(number, agent)
            case PoseFault():
                world.pose_errors.end(number, agent)
            case SlowFault():
                self._slow.end(number, agent)
            case StarveFault():
                self._starvation.end(number, agent)
            case _:
                assert_never(fault)


def _event(
    operation: DisturbAgents, fault: FaultOfEach, agent: int, t_s: float, by: By
) -> AgentFaultRunEvent:
    common: dict[str, Any] = {
        "t_s": t_s,
        "agent": agent,
        "planned": True,
        "by": by,
        "number": operation.number,
        "ends": operation.ends,
    }
    match fault:
        case ClockFault(offset_s=offset_s, drift_ppm=drift_ppm):
            return ClockChanged(**common, offset_s=offset_s, drift_ppm=drift_ppm)
        case PoseFault(bias_m=bias_m, noise_m=noise_m, bias_yaw_deg=yaw_deg):
            return PoseChanged(**common, bias_m=bias_m, noise_m=noise_m, bias_yaw_deg=yaw_deg)
        case SlowFault(delay_s=delay_s):
            return SlowChanged(**common, delay_s=delay_s)
        case StarveFault(cpu_percent=cpu_percent, period_s=period_s):
            return Starved(**common, cpu_percent=cpu_percent, period_s=period_s)
    assert_never(fault)


def _intruded(operation: DisturbAgents, fault: Intruder, t_s: float, by: By) -> Intruded:
    return Intruded(
        t_s=t_s,
        agent=None,
        planned=True,
        by=by,
        number=operation.number,
        agents=None if operation.ends else operation.agents,
        per_s=fault.rate,
        nobody=fault.agents if fault.agents and not operation.agents else None,
    )
