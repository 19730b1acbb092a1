"""Slow controllers: agents whose steps take long, and whose answers so come late.

While an agent is busy with a step it takes no other observation. As processes the agents are told
how long to take, and really do. In lockstep and virtual time this is the model of it: the answer to
the observation of slot s counts from the slot in which it would have come, and the agent is given
its next observation in its first turn from then on.
"""

from math import ceil
from typing import NamedTuple

from agent.messages import Command
from worldsim.scenario.timeline import SLACK_S
from worldsim.truth.world import Clock


class LateAnswer(NamedTuple):
    """An agent's answer that has not come yet."""

    agent: int
    command: Command
    encoded: bytes


class SlowControllers:
    """Which agents are slow, and the answers that are still to come.

    Of several faults of one agent the one with the longest delay acts.
    """

    def __init__(self, clock: Clock, modelled: bool) -> None:
        self._clock = clock
        self._modelled = modelled
        """Whether the agents themselves do not take any time."""
        self._delays_s: dict[int, dict[int, float]] = {}
        """By agent and the fault's number."""
        self._due: dict[int, int] = {}
        """The slot in which each busy agent's answer comes, at the latest."""
        self._late: dict[int, LateAnswer] = {}
        self.struck: dict[int, int] = {}
        """How many steps each fault has made slow, by its number."""

    def __bool__(self) -> bool:
        return bool(self._delays_s or self._due)

    def begin(self, number: int, agent: int, delay_s: float) -> None:
        """Let an agent's steps take so long [s]."""
        self._delays_s.setdefault(agent, {})[number] = delay_s

    def end(self, number: int, agent: int) -> None:
        """End a fault of an agent; a step that it has begun takes its time."""
        delays_s = self._delays_s.get(agent, {})
        delays_s.pop(number, None)
        if not delays_s:
            self._delays_s.pop(agent, None)

    def forget(self, agent: int) -> None:
        """Expect no answer of an agent any more: its process has ended."""
        self._due.pop(agent, None)
        self._late.pop(agent, None)

    def is_late(self, agent: int, slot: int) -> bool:
        """Return whether an agent's answer may be late in a slot by its faults, not by the host."""
        due = self._due.get(agent)
        if due is not None and due + self._clock.slots_per_tick < slot:
            del self._due[agent]
        return agent in self._due

    def takes_observation(self, agent: int, slot: int) -> bool:
        """Return whether an agent takes the observation of a slot: it is not busy."""
        if not self._modelled or agent not in self._due:
            return True
        if self._due[agent] > slot:
            return False
        del self._due[agent]
        return True

    def begin_step(self, agent: int, slot: int) -> tuple[int, float]:
        """Begin an agent's step; return by how many slots its answer is late.

        And how long its process takes for that [s; simulated time]; 0 where that is modelled.
        """
        delays_s = self._delays_s.get(agent)
        if not delays_s:
            return 0, 0.0
        number = max(delays_s, key=delays_s.__getitem__)
        delay_s = delays_s[number]
        self.struck[number] = self.struck.get(number, 0) + 1
        late_slots = ceil(delay_s * self._clock.slot_hz - SLACK_S)
        self._due[agent] = slot + late_slots
        return late_slots, 0.0 if self._modelled else delay_s

    def hold(self, agent: int, command: Command, encoded: bytes) -> bool:
        """Take an agent's answer; return whether it is held until it is due."""
        if not self._modelled or agent not in self._due:
            return False
        self._late[agent] = LateAnswer(agent, command, encoded)
        return True

    def answers(self, slot: int) -> list[LateAnswer]:
        """Return the held answers that come in a slot, agents in ascending order."""
        come = [agent for agent in sorted(self._late) if self._due[agent] <= slot]
        return [self._late.pop(agent) for agent in come]
