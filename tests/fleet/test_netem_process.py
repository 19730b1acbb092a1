"""Netem's process follows the faults in force, whatever their order."""

from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.conditions import NetworkConditions
from netem.faults import FaultOrder, Outage, Partition
from netem.link_parameters import Conditions
from netem.messages import FaultOrders, MediumCounters
from worldsim.fleet.netem_process import NetemProcess
from worldsim.judge.event import By

PARTITION = Partition(((0,),))
COUNTERS = MediumCounters(
    slot=7, sent=2, addressed=4, fates={"delivered": 1}, in_flight=3, rejected={}
)


class Accepting:
    """A query that is answered at once."""

    def answered(self) -> bool:
        return True


class Around:
    """What a process of netem has to do with: bus, startup and launcher in one."""

    def __init__(self) -> None:
        self.actions: list[str] = []
        self.asked_by: list[str | None] = []
        self.orders: list[FaultOrders] = []
        self.setups: list[Any] = []

    def publisher(self, topic: str) -> Any:
        assert topic == "orders"
        return lambda data: self.orders.append(msgspec.json.decode(data, type=FaultOrders))

    def stop(self, process: str, action: str, by: str | None = None) -> None:
        assert process == "netem"
        self.actions.append(action)
        self.asked_by.append(by)

    def resume_medium(self, speed: float, resumption: Any) -> Accepting:
        self.setups.append(resumption)
        return Accepting()


@pytest.fixture
def around() -> Around:
    return Around()


class Driven:
    """A process of netem, its faults, and the slot."""

    def __init__(self, around: Around) -> None:
        made: Any = around
        self.network = NetworkConditions(Conditions())
        self.netem = NetemProcess(made, made, made, self.network, speed=1.0)
        self.slot = 0

    def order(self, order: FaultOrder, by: By = None) -> None:
        self.netem.order(order, self.slot, by)
        self.network.apply(order)

    def follow(self, times: int = 1) -> None:
        for _ in range(times):
            self.netem.follow(self.slot, COUNTERS)
            self.slot += 1


def begin(number: int, fault: Any) -> FaultOrder:
    return FaultOrder.begin(number, 1.0, fault)


def test_a_killed_netem_goes_on_with_the_faults_in_force_and_its_counters(around: Around) -> None:
    driven = Driven(around)
    driven.order(begin(0, PARTITION))
    driven.order(begin(1, Outage("kill")))
    driven.follow()
    driven.order(FaultOrder(0, 2.0))
    driven.order(begin(2, PARTITION))
    driven.follow()
    assert (around.actions, driven.netem.state) == (["kill"], "dead")
    driven.order(FaultOrder(1, 3.0))
    driven.follow(3)
    assert (around.actions, driven.netem.state) == (["kill", "start"], "up")
    (setup,) = around.setups
    assert [order.number for order in setup.orders] == [2]
    assert setup.counters.fates == {"delivered": 1, "dropped_medium": 3}
    assert [each.orders[0].number for each in around.orders] == [0], "the setup holds the others"


def test_orders_wait_for_a_paused_netem(around: Around) -> None:
    driven = Driven(around)
    driven.order(begin(0, Outage("pause")))
    driven.follow()
    driven.order(begin(1, PARTITION))
    driven.follow()
    assert around.orders == []
    driven.order(FaultOrder(0, 2.0))
    driven.follow()
    assert around.actions == ["pause", "resume"]
    assert [each.orders[0].number for each in around.orders] == [1]


@pytest.mark.parametrize("by", [None, "operator"])
def test_a_kill_is_by_who_asked_for_it_even_over_a_pause(around: Around, by: By) -> None:
    driven = Driven(around)
    driven.order(begin(0, Outage("pause")), None if by else "operator")
    driven.order(begin(1, Outage("kill")), by)
    driven.follow()
    assert (around.actions, around.asked_by) == (["kill"], [by])


steps = st.lists(
    st.tuples(st.booleans(), st.integers(0, 3), st.sampled_from(["kill", "pause"])), max_size=12
)


@settings(derandomize=True, deadline=None, max_examples=200)
@given(steps)
def test_netem_is_up_exactly_where_no_outage_is_in_force(given_steps: list) -> None:
    around = Around()
    driven = Driven(around)
    in_force: dict[int, str] = {}
    for begins, number, cause in given_steps:
        if begins and number not in in_force:
            in_force[number] = cause
            driven.order(begin(number, Outage(cause)))
        elif not begins and number in in_force:
            del in_force[number]
            driven.order(FaultOrder(number, 1.0))
        driven.follow(4)
        state = driven.netem.state
        assert (state == "up") == (not in_force)
        if "kill" in in_force.values():
            assert state == "dead"
    alive, stopped = True, False
    for action in around.actions:
        assert alive != (action == "start"), "a dead process is started, a living one is not"
        assert stopped or action != "resume"
        alive = action != "kill"
        stopped = action == "pause"
