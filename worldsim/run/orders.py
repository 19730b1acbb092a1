"""Missions on their way into the team: each goes to one agent, which spreads it by radio."""

from agent.codec import encode_formation
from agent.comms.mission import ORIGINS
from agent.messages import Mission
from worldsim.run.faults import Order


class Orders:
    """Keeps the newest mission until an agent says that it flies it.

    So an order outlives the agent that it was given to, and an observation that was lost.
    """

    def __init__(self) -> None:
        self.pending: Mission | None = None
        self._issued = 0

    def issue(self, order: Order, newest_key: int) -> int:
        """Make a mission of an order, newer than any told so far; return its key."""
        self._issued = max(self._issued, newest_key // ORIGINS) + 1
        key = self._issued * ORIGINS
        self.pending = Mission(key, order.path, encode_formation(order.formation))
        return key

    def heard(self, key: int) -> None:
        """Take note of the mission that an agent flies."""
        if self.pending is not None and key >= self.pending.key:
            self.pending = None
