"""The faults in force that part the team: while there are any, it cannot be one."""

from worldsim.judge.radio_events import Flapped, Healed, Jammed, Partitioned, RadioRunEvent
from worldsim.judge.run_events import AgentFaultRunEvent


class PartingFaults:
    """The numbers of the partitions, jams, flaps and wrong clocks in force.

    slack_s: clocks that differ by no more part nobody [s].
    """

    def __init__(self, slack_s: float) -> None:
        self._slack_s = slack_s
        self._partitions: set[int] = set()
        self._others: set[int] = set()

    def __bool__(self) -> bool:
        return bool(self._partitions or self._others)

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
            case _:
                pass  # changed conditions part nobody for sure

    def handle_agent_fault(self, event: AgentFaultRunEvent) -> None:
        """Take the beginning or the end of a fault of an agent."""
        if abs(event.offset_s) > self._slack_s or event.drift_ppm:
            self._mark(event.number, begins=not event.ends)

    def _mark(self, number: int, *, begins: bool) -> None:
        if begins:
            self._others.add(number)
        else:
            self._others.discard(number)
