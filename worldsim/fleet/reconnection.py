"""Whether agents are observed again after an outage of netem, or after the world stood still."""

from collections.abc import Iterable

WITHIN_S = 12.5
"""Agents are observed again within so long, also on a loaded host [s; wall time]. A client tries to
connect twice a second."""
LONG_PAUSE_S, SETTLING_S = 5.0, 2.0
"""After a longer pause, what has waited in sockets may come first for so long [s; wall time]."""


class Reconnection:
    """The agents that have not been observed since a stop ended: they sent no command since.

    speed: simulated seconds in a second of wall time.
    """

    def __init__(self, speed: float) -> None:
        self.since_s: float | None = None
        """When the stop ended [s; simulated time]; None: nothing is awaited."""
        self._waiting: set[int] = set()
        self._from_s = 0.0
        self._speed = speed

    def begin(self, agents: Iterable[int], time_s: float, paused_s: float = 0.0) -> None:
        """Await that agents are observed after a time [s; simulated time].

        paused_s: how long a process was paused that goes on now [s; wall time].
        """
        self._waiting, self.since_s = set(agents), time_s
        settling_s = SETTLING_S if paused_s > LONG_PAUSE_S else 0.0
        self._from_s = time_s + settling_s * self._speed

    def cancel(self) -> None:
        """Await nothing: another outage begins."""
        self._waiting, self.since_s = set(), None

    def hear(self, agent: int, observed_s: float) -> None:
        """Take the time of an observation that an agent has answered [s; simulated time]."""
        if observed_s >= self._from_s:
            self._waiting.discard(agent)

    def awaits(self, agent: int) -> bool:
        """Return whether an agent has not been observed yet."""
        return agent in self._waiting

    def missing(self, running: Iterable[int]) -> tuple[int, ...]:
        """Return the running agents that have not been observed yet, in ascending order."""
        self._waiting.intersection_update(running)
        return tuple(sorted(self._waiting))

    def is_late(self, time_s: float) -> bool:
        """Return whether it has taken too long by a time [s]."""
        return self.since_s is not None and time_s - self.since_s > WITHIN_S * self._speed
