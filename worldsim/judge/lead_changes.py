"""Changes of who leads a vertex, for I6: no agent takes the lead up, or gives it up, too often.

Whether others follow a member is their choice, and distress is a search: neither counts.
"""

from collections import Counter
from math import inf

from worldsim.judge.run_events import RoleChanged

MAX_CHANGES = 3
"""An agent may change so often after each fault; after two kinds at one time twice as often."""
EFFECT_S = 1.5
"""So long after a fault the components that it changed are found at the latest [s]."""


class LeadChanges:
    """Counts each agent's changes since the last fault."""

    def __init__(self) -> None:
        self._leading: set[int] = set()
        self._changes: Counter[int] = Counter()
        self._excess = 0
        self._kinds: set[str] = set()
        """Kinds of the faults that the team answers to: those that came last, at one time."""
        self._fault_s = -inf
        self.near_taken: frozenset[int] = frozenset()
        """Agents in whose component a vehicle of others hovers in a place: one that an agent finds
        when it comes near is answered as a fault is."""

    def strike(self, t_s: float, kind: str) -> None:
        """Start anew after a fault at a time [s]; each kind is answered by changes of its own."""
        if t_s != self._fault_s:
            self._fault_s, self._kinds = t_s, set()
        self._kinds.add(kind)
        self._changes.clear()

    def take(self, event: RoleChanged, *, informed: bool) -> None:
        """Take a change of role; informed: whether it counts, as news reaches the agent."""
        agent, leads = event.agent, event.role == "vertex"
        if agent is None or leads == (agent in self._leading):
            return
        self._leading ^= {agent}
        if informed:
            self._changes[agent] += 1
            answered = max(1, len(self._kinds)) + (agent in self.near_taken)
            self._excess += self._changes[agent] > MAX_CHANGES * answered

    def forget(self, agent: int) -> None:
        """Take the start of an agent's new process, which leads nothing."""
        self._leading.discard(agent)

    def restart(self, time_s: float) -> None:
        """Start anew without an event, as agents came into reach, or went out of it.

        Soon after a fault that is its effect, which is looked for once a second.
        """
        if time_s - self._fault_s > EFFECT_S:
            self._kinds.clear()
        self._changes.clear()

    def take_excess(self) -> int:
        """Return how many changes beyond the allowed ones there were since the last call."""
        excess, self._excess = self._excess, 0
        return excess
