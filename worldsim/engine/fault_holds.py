"""Holds: which faults in force keep an agent down, so that overlapping faults end by themselves."""


class FaultHolds:
    """The numbers of the faults that hold each agent; an agent is free when the last one ends."""

    def __init__(self) -> None:
        self._holding: dict[int, set[int]] = {}
        """By agent."""

    def begin(self, number: int, agents: tuple[int, ...]) -> None:
        """Let a fault hold some agents, whether or not other faults hold them too."""
        for agent in agents:
            self._holding.setdefault(agent, set()).add(number)

    def end(self, number: int) -> tuple[int, ...]:
        """End a fault; return the agents that it held and that no other fault holds."""
        held = [agent for agent, numbers in self._holding.items() if number in numbers]
        for agent in held:
            self._holding[agent].discard(number)
        return tuple(sorted(agent for agent in held if not self._holding[agent]))

    def release(self, agents: tuple[int, ...]) -> None:
        """Free some agents of all faults: a restart or a resume asks for it."""
        for agent in agents:
            self._holding.pop(agent, None)
