"""For how long a formation is asked for: the time in which no fault in force forbids it."""


class AskedTime:
    """Time that a team has had to form, in one stretch.

    A fault that forbids the formation breaks the time off; from its end on it counts anew.

    from_s: when the formation is asked for [s; simulated time]. forbidden: whether a fault in force
    forbids it then.
    """

    def __init__(self, from_s: float, *, forbidden: bool = False) -> None:
        self.from_s: float | None = None if forbidden else from_s
        """From when the time counts now [s; simulated time]; None while a fault forbids it."""
        self._broken_off_s = 0.0
        self._broken_off: tuple[float, float] | None = None
        """When the newest stretch that was broken off began, and when it ended [s]."""

    def note(self, t_s: float, *, forbidden: bool, standing_since_s: float | None = None) -> None:
        """Take from a time on whether a fault forbids the formation [s; simulated time].

        standing_since_s: since when the team stands, though not for long enough yet: it needed no
        longer than to then. None: it does not.
        """
        if not forbidden and self.from_s is None:
            self.from_s = t_s
        elif forbidden and self.from_s is not None:
            self._broken_off_s = self.until(t_s if standing_since_s is None else standing_since_s)
            self._broken_off = self.from_s, t_s
            self.from_s = None

    def settle(self, since_s: float) -> None:
        """Take it that the team has formed, and has stood since a time [s].

        Where it stood before a fault forbade it, the stretch before that fault is what counts.
        """
        if self.from_s is None and self._broken_off is not None and since_s < self._broken_off[1]:
            self.from_s = self._broken_off[0]

    def until(self, t_s: float) -> float:
        """Return the longest stretch up to a time [s]; 0 where a fault forbade all of it."""
        since_s = t_s if self.from_s is None else self.from_s
        return max(self._broken_off_s, t_s - since_s)
