"""Fault orders: queued until their slot, applied in order, rejected when malformed."""

import msgspec
import pytest

from netem.fault_queue import FaultQueue
from netem.faults import FaultOrder, Heal, Partition
from netem.link_parameters import Conditions
from netem.medium import Medium
from netem.messages import FaultOrders, MediumSetup
from netem.wire.frame import Outgoing, Transmission, WireError
from tests.netem.fault_orders import begin

ALL_LOST = begin(1, Conditions(loss_percent=100.0))
PARTITION = begin(2, Partition(((0,),)))
HEAL = begin(3, Heal())


def test_orders_are_due_at_their_slot_once_and_in_order() -> None:
    queue = FaultQueue()
    for slot, order in ((8, ALL_LOST), (8, PARTITION), (12, HEAL)):
        queue.put(msgspec.json.encode(FaultOrders(slot, (order,))))
    assert queue.due(7) == []
    assert queue.due(9) == [ALL_LOST, PARTITION]
    assert queue.due(9) == []
    assert queue.due(12) == [HEAL]


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xc1",
        b'{"slot": -1, "orders": []}',
        b'{"slot": 1, "orders": [{"number": 1, "at_s": 0, "event": {"explode": {}}}]}',
    ],
)
def test_a_malformed_order_is_rejected(data: bytes) -> None:
    with pytest.raises(WireError, match="malformed"):
        FaultQueue().put(data)


def test_the_medium_applies_orders() -> None:
    medium = Medium(MediumSetup(1, 2, 4, 80.0, Conditions()))
    medium.place(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)))

    def fate(slot: int, *orders: FaultOrder) -> str:
        for order in orders:
            medium.apply(order)
        before = medium.counters(slot).fates
        medium.transmit(0, 0.0, Transmission(slot, 0, (Outgoing(0, b"x"),)))
        medium.collect(1, 1.0)
        after = medium.counters(slot).fates
        return next(name for name in after if after[name] > before[name])

    assert fate(0) == "delivered"
    assert fate(1, PARTITION) == "dropped_partition"
    assert fate(2, HEAL) == "delivered"
    assert fate(3, ALL_LOST) == "dropped_loss"
