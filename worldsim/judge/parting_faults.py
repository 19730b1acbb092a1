"""The faults in force that part the team: while there are any, it cannot be one."""

from typing import assert_never

from worldsim.judge.connectivity import LONGEST_STOP_S
from worldsim.judge.cutting_faults import CuttingFaults
from worldsim.judge.radio_events import LinkRunEvent, NetemOutage
from worldsim.judge.run_events import (
    AgentFaultRunEvent,
    ClockChanged,
    PoseChanged,
    Reconnected,
    SlowChanged,
    Starved,
    WorldStopped,
)
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import CONVERGED_M, Scenario


class PartingFaults:
    """The faults in force by which the team cannot be one, and whether agents are observed.

    Beside those of the radio that cut links, these are wrong clocks and poses, and slow and starved
    agents, beyond bounds.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._slack_s = 2.0 / scenario.fleet.tick_hz
        """Clocks that differ by no more part nobody, nor do steps of one tick [s]."""
        self._cutting = CuttingFaults(scenario)
        self._others: set[int] = set()
        self._over_s: dict[int, float] = {}
        """When those of them are over that have ended, by number [s; simulated time]."""
        self.unobserved = False
        """Whether netem is down or the world was stopped, and not all are observed again yet."""

    def __bool__(self) -> bool:
        return bool(self.in_force or self._over_s)

    @property
    def in_force(self) -> bool:
        """Whether there are any that have not ended; others may not be over yet."""
        return bool(self._cutting or self._others or self.unobserved)

    def see(self, tick: Tick) -> bool:
        """Take a tick before it is judged.

        Return whether the radio begins to part, or ceases, or a fault that has ended is over.
        """
        before = bool(self._cutting), len(self._over_s)
        self._cutting.see(tick)
        for number in [each for each, at_s in self._over_s.items() if at_s <= tick.time_s]:
            del self._over_s[number]
        return before != (bool(self._cutting), len(self._over_s))

    def handle_stop(self, event: WorldStopped | Reconnected) -> None:
        """Take the stop of the world, or the end of such a time."""
        self.unobserved = isinstance(event, WorldStopped)

    def handle_event(self, event: LinkRunEvent | NetemOutage) -> bool:
        """Take an event of the radio; return whether it disturbs the team.

        A partition, jam or flap that never cut a link of the team does not.
        """
        if isinstance(event, NetemOutage):
            self.unobserved = True
            return True
        return self._cutting.handle_event(event)

    def handle_agent_fault(self, event: AgentFaultRunEvent) -> None:
        """Take the beginning or the end of a fault of an agent."""
        match event:
            case ClockChanged():
                parts = abs(event.offset_s) > self._slack_s or event.drift_ppm != 0.0
            case PoseChanged():
                parts = event.displaces_m > 0.5 * CONVERGED_M or event.bias_yaw_deg != 0.0
            case SlowChanged():
                parts = event.delay_s > 0.5 * self._slack_s
            case Starved():
                parts = event.stops_s > LONGEST_STOP_S
            case _:
                assert_never(event)
        if not parts:
            return
        if not event.ends:
            self._others.add(event.number)
            self._over_s.pop(event.number, None)
        elif event.number in self._others:
            self._others.remove(event.number)
            if event.over_s > event.t_s:
                self._over_s[event.number] = event.over_s
