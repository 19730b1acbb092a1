"""Missions on their way into the team: each goes to one agent, which spreads it by radio."""

from agent.codec import encode_formation
from agent.comms.mission import ORIGINS
from agent.messages import Mission
from worldsim.scenario.timeline import Order


class Orders:
    """Keeps the newest mission until an agent says that it flies it.

    So an order outlives the agent that it was given to, and an observation that was lost.
    """

    def __init__(self) -> None:
        self.pending: Mission | None = None
        self.to: int | None = None
        self._issued = 0

    def newest(self, newest_key: int) -> int:
        """Return the version of the newest mission, issued or told of by an agent."""
        return max(self._issued, newest_key // ORIGINS)

    def issue(self, order: Order, newest_key: int) -> int:
        """Make a mission of an order, newer than any told so far; return its key."""
        self._issued = order.version or self.newest(newest_key) + 1
        self.to = order.to
        key = self._issued * ORIGINS
        self.pending = Mission(key, order.path, encode_formation(order.formation))
        return key

    def heard(self, key: int) -> None:
        """Take note of the mission that an agent flies."""
        if self.pending is not None and key >= self.pending.key:
            self.pending = None
