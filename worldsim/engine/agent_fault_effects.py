"""Effects of faults of single agents: what the world shows them from now on, and the events."""

from collections.abc import Iterator

from worldsim.engine.operations import DisturbAgents
from worldsim.judge.event import By
from worldsim.judge.run_events import AgentFaultRunEvent, ClockChanged
from worldsim.scenario.faults import ClockFault
from worldsim.truth.agent_clocks import ClockError
from worldsim.truth.world import World


class AgentFaultEffects:
    """Begins and ends faults of agents in a world."""

    def __init__(self, world: World) -> None:
        self._world = world

    def apply(self, operation: DisturbAgents, t_s: float, by: By) -> Iterator[AgentFaultRunEvent]:
        """Apply an operation at a time [s]; yield an event for each agent."""
        for agent in operation.agents:
            yield self._set_clock(operation, operation.fault, agent, t_s, by)

    def _set_clock(
        self, operation: DisturbAgents, fault: ClockFault, agent: int, t_s: float, by: By
    ) -> ClockChanged:
        number, clocks = operation.number, self._world.clocks
        if operation.ends:
            clocks.end(number, agent)
        else:
            clocks.begin(number, agent, ClockError(t_s, fault.offset_s, fault.drift_ppm))
        return ClockChanged(
            t_s=t_s,
            agent=agent,
            planned=True,
            by=by,
            number=number,
            ends=operation.ends,
            offset_s=fault.offset_s,
            drift_ppm=fault.drift_ppm,
        )
