"""A medium that goes on where one was killed: conditions, faults and counters hold over it."""

from netem.faults import FaultOrder, Outage, Partition
from netem.link_parameters import Conditions
from netem.medium import Medium
from netem.messages import MediumSetup, Resumption
from netem.wire.frame import Outgoing, Transmission
from tests.netem.fault_orders import begin, end

SETUP = MediumSetup(1, 3, 4, 80.0, Conditions(delay_ms=100.0, loss_percent=30.0))
POINTS = ((0.0, 0.0, 0.0),) * 3


def fly(medium: Medium, slots: range) -> None:
    for slot in slots:
        medium.place(POINTS)
        sender = slot % 3
        medium.transmit(sender, slot / 80.0, Transmission(slot, 0, (Outgoing(0, b"beacon"),)))
        medium.collect((slot + 1) % 3, (slot + 1) / 80.0)


def conserved(medium: Medium) -> None:
    counters = medium.counters(0)
    assert counters.addressed == sum(counters.fates.values()) + counters.in_flight


def test_counters_and_faults_go_on_and_no_frame_has_an_earlier_ones_count() -> None:
    first = Medium(SETUP)
    first.apply(begin(7, Partition(((0,),))))
    fly(first, range(40))
    before = first.counters(40)
    assert before.in_flight > 0
    orders = (FaultOrder.begin(7, 0.0, Partition(((0,),))),)
    resumes = Resumption(40, orders, before.after_kill())
    second = Medium(MediumSetup(1, 3, 4, 80.0, SETUP.conditions, resumes=resumes))
    conserved(second)
    fates = second.counters(40).fates
    lost = before.fates["dropped_medium"] + before.in_flight
    assert (second.in_flight, fates["dropped_medium"]) == (0, lost)

    fly(second, range(40, 80))
    conserved(second)
    after = second.counters(80)
    assert (after.sent, len(after.struck)) == (80, 1)
    assert after.struck[0][1] > before.struck[0][1]
    second.apply(end(7))
    counts = [frame.count for frame in second.collect(1, 99.0)]
    assert counts
    assert min(counts) > 40


def test_a_kill_takes_what_is_in_flight_and_leaves_nothing_to_collect() -> None:
    for cause, left in (("kill", False), ("pause", True)):
        medium = Medium(SETUP)
        fly(medium, range(40))
        medium.apply(FaultOrder.begin(0, 0.5, Outage(cause)))
        assert medium.down
        conserved(medium)
        medium.apply(end(0))
        assert not medium.down
        assert bool(medium.in_flight) == left
