"""Fault orders from the world, queued until the slot before which they apply."""

from collections import deque

import msgspec

from netem.faults import FaultOrder
from netem.messages import MAX_ORDERS_B, FaultOrders
from netem.wire.frame import WireError


class FaultQueue:
    """Fault orders in the order of their arrival."""

    def __init__(self) -> None:
        self._waiting: deque[FaultOrders] = deque()

    def put(self, data: bytes) -> None:
        """Queue an encoded FaultOrders. Raises WireError where it is oversize or malformed."""
        if len(data) > MAX_ORDERS_B:
            raise WireError(f"oversize: {len(data)} B where {MAX_ORDERS_B} B are allowed")
        try:
            self._waiting.append(msgspec.json.decode(data, type=FaultOrders))
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise WireError(f"malformed FaultOrders: {error}") from error

    def due(self, slot: int) -> list[FaultOrder]:
        """Remove and return the orders that apply before a slot or before an earlier one."""
        due: list[FaultOrder] = []
        while self._waiting and self._waiting[0].slot <= slot:
            due.extend(self._waiting.popleft().orders)
        return due
