"""The faults in force that part the team: while there are any, it cannot be one."""

from typing import assert_never

from worldsim.judge.connectivity import LONGEST_STOP_S
from worldsim.judge.radio_events import (
    Flapped,
    Healed,
    Jammed,
    NetemOutage,
    Partitioned,
    RadioRunEvent,
)
from worldsim.judge.run_events import (
    AgentFaultRunEvent,
    ClockChanged,
    PoseChanged,
    Reconnected,
    SlowChanged,
    Starved,
    WorldStopped,
)
from worldsim.scenario.tables import CONVERGED_M


class PartingFaults:
    """The partitions, jams, flaps and wrong clocks in force, and whether agents are observed.

    slack_s: two ticks [s]. Clocks that differ by no more part nobody, nor do steps of one tick.
    """

    def __init__(self, slack_s: float) -> None:
        self._slack_s = slack_s
        self._partitions: set[int] = set()
        self._others: set[int] = set()
        self.unobserved = False
        """Whether netem is down or the world was stopped, and not all are observed again yet."""

    def __bool__(self) -> bool:
        return bool(self._partitions or self._others or self.unobserved)

    def handle_stop(self, event: WorldStopped | Reconnected) -> None:
        """Take the stop of the world, or the end of such a time."""
        self.unobserved = isinstance(event, WorldStopped)

    def handle_event(self, event: RadioRunEvent) -> None:
        """Take an event of the radio."""
        match event:
            case Partitioned():
                self._partitions.add(event.number)
            case Healed():
                ended = self._partitions if event.number is None else {event.number}
                self._partitions = self._partitions - ended
            case Jammed():
                self._mark(event.number, begins=event.jam is not None)
            case Flapped():
                self._mark(event.number, begins=event.flap is not None)
            case NetemOutage():
                self.unobserved = True
            case _:
                pass  # changed conditions part nobody for sure

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
        if parts:
            self._mark(event.number, begins=not event.ends)

    def _mark(self, number: int, *, begins: bool) -> None:
        if begins:
            self._others.add(number)
        else:
            self._others.discard(number)
