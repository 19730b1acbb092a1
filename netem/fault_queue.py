"""The world's orders to the medium, kept until the slot before which they are to be carried out."""

from collections import deque

import msgspec

from netem.faults import FaultOrder
from netem.messages import MAX_ORDERS_B, FaultOrders
from netem.wire.frame import WireError


class FaultQueue:
    """FaultOrders that have come, in the order in which they came."""

    def __init__(self) -> None:
        self._waiting: deque[FaultOrders] = deque()

    def take(self, data: bytes) -> None:
        """Note what the world sent, or raise WireError."""
        if len(data) > MAX_ORDERS_B:
            raise WireError(f"oversize: {len(data)} B where {MAX_ORDERS_B} B are allowed")
        try:
            self._waiting.append(msgspec.json.decode(data, type=FaultOrders))
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise WireError(f"malformed FaultOrders: {error}") from error

    def due(self, slot: int) -> list[FaultOrder]:
        """Return, and forget, what is to be done before a slot is played."""
        found: list[FaultOrder] = []
        while self._waiting and self._waiting[0].slot <= slot:
            found.extend(self._waiting.popleft().orders)
        return found
