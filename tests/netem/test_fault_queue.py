"""Orders to the medium: kept for their slot, carried out in turn, refused when they are none."""

import msgspec
import pytest

from netem.fault_queue import FaultQueue
from netem.faults import FaultOrder, Heal, Partition
from netem.link_keys import Conditions
from netem.medium import Medium
from netem.messages import FaultOrders, MediumSetup
from netem.wire.frame import Outgoing, Transmission, WireError
from tests.netem.ordering import begin

CHANGED = begin(1, Conditions(loss_percent=100.0))
PARTED = begin(2, Partition(((0,),)))
HEALED = begin(3, Heal())


def test_orders_wait_for_their_slot_and_come_once_in_turn() -> None:
    book = FaultQueue()
    for slot, order in ((8, CHANGED), (8, PARTED), (12, HEALED)):
        book.put(msgspec.json.encode(FaultOrders(slot, (order,))))
    assert book.due(7) == []
    assert book.due(9) == [CHANGED, PARTED]
    assert book.due(9) == []
    assert book.due(12) == [HEALED]


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xc1",
        b'{"slot": -1, "orders": []}',
        b'{"slot": 1, "orders": [{"number": 1, "at_s": 0, "event": {"explode": {}}}]}',
    ],
)
def test_what_is_no_order_is_refused(data: bytes) -> None:
    with pytest.raises(WireError, match="malformed"):
        FaultQueue().put(data)


def test_the_medium_obeys() -> None:
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
    assert fate(1, PARTED) == "dropped_partition"
    assert fate(2, HEALED) == "delivered"
    assert fate(3, CHANGED) == "dropped_loss"
