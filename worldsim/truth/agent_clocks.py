"""Agents' clocks that are wrong: ahead or behind by an offset, and drifting, until they are set."""

from typing import Final, NamedTuple

PPM: Final = 1e-6


class ClockError(NamedTuple):
    """The error that one fault puts on a clock."""

    since_s: float  # when it began [s; simulated time]
    offset_s: float  # added to the time at once [s]
    drift_ppm: float  # and so much more for each second since then

    def at(self, time_s: float) -> float:
        """Return how far the clock is ahead at a time [s; simulated time]."""
        return self.offset_s + self.drift_ppm * PPM * (time_s - self.since_s)


class AgentClocks:
    """How far each agent's clock is off. The errors of faults in force together add up."""

    def __init__(self) -> None:
        self._errors: dict[int, dict[int, ClockError]] = {}
        """By agent and the fault's number."""
        self.struck: dict[int, int] = {}
        """How many times each fault gave wrong, by its number."""

    def __bool__(self) -> bool:
        return bool(self._errors)

    @property
    def wrong(self) -> list[int]:
        """The agents with an error, in ascending order."""
        return sorted(self._errors)

    def begin(self, number: int, agent: int, error: ClockError) -> None:
        """Begin a fault of an agent's clock."""
        self._errors.setdefault(agent, {})[number] = error

    def end(self, number: int, agent: int) -> None:
        """End a fault of an agent's clock."""
        errors = self._errors.get(agent, {})
        errors.pop(number, None)
        if not errors:
            self._errors.pop(agent, None)

    @property
    def in_force(self) -> dict[int, dict[int, ClockError]]:
        """The errors of each fault in force, by its number, by agent."""
        found: dict[int, dict[int, ClockError]] = {}
        for agent, errors in self._errors.items():
            for number, error in errors.items():
                found.setdefault(number, {})[agent] = error
        return found

    def ahead_s(self, agent: int, time_s: float) -> float:
        """Return how far an agent's clock is ahead of the time [s]; negative where it is behind."""
        return sum(error.at(time_s) for error in self._errors.get(agent, {}).values())

    def shown_s(self, agent: int, time_s: float) -> float:
        """Return the time that an agent's clock shows [s], and count it.

        Faults that would let it show less than 0 s are refused; what is below is rounding.
        """
        errors = self._errors.get(agent)
        if errors is None:
            return time_s
        for number, error in errors.items():
            self.struck[number] = self.struck.get(number, 0) + (error.at(time_s) != 0.0)
        return max(0.0, time_s + self.ahead_s(agent, time_s))
