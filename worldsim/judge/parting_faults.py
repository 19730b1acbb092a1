"""The radio's faults in force that part the team: while there are any, it cannot be one."""

from worldsim.judge.radio_events import Flapped, Healed, Jammed, Partitioned, RadioRunEvent


class PartingFaults:
    """The numbers of the partitions, jams and flaps in force."""

    def __init__(self) -> None:
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

    def _mark(self, number: int, *, begins: bool) -> None:
        if begins:
            self._others.add(number)
        else:
            self._others.discard(number)
