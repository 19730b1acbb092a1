"""Faults that nest and cross: each ends by itself, and a later fault outlives an earlier one."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.messages import Scan
from tests.engine.test_timeline_effects import scenario
from worldsim.engine.fault_holds import FaultHolds
from worldsim.engine.process_life import State
from worldsim.engine.step import SlotLoop, world_of
from worldsim.scenario.timeline import steps
from worldsim.truth.proximity_sensor import NO_READING, ProximityReading
from worldsim.truth.sensor_faults import SensorFaults

TRUE = ProximityReading(vehicles=((1.0, 0.0, 0.0),))


def states_of_1(*events: str) -> dict[float, State]:
    """Return agent 1's state at each half second of 12 s."""
    flown = scenario(*events)
    loop = SlotLoop(flown, world_of(flown, command_ticks=1))
    found = {}
    while loop.world.time_s < 12.0:
        for operation in loop.due():
            loop.apply(operation)
        if (2.0 * loop.world.time_s).is_integer():
            found[loop.world.time_s] = loop.members.state(1)
        loop.open()
        loop.close(b"")
    return found


def test_a_permanent_kill_outlives_the_end_of_an_earlier_one() -> None:
    first = "at_s = 1\nfor_s = 5\nkill = [1]"
    for later in ("at_s = 3\nkill = [1]", "at_s = 3\nkill = ['all']"):
        assert states_of_1(first, later)[11.5] is State.DEAD
    again = states_of_1(first, "at_s = 2\nrestart = [1]", "at_s = 4\nkill = [1]")
    assert (again[3.5], again[11.5]) == (State.RUNNING, State.DEAD)


@pytest.mark.parametrize(("second_s", "for_s"), [(2.0, 2.0), (2.0, 6.0)], ids=["inner", "crossing"])
@pytest.mark.parametrize(
    ("fault", "down"), [("kill", State.DEAD), ("leave", State.GONE), ("pause", State.PAUSED)]
)
def test_an_agent_is_back_only_after_the_last_of_its_faults(
    fault: str, down: State, second_s: float, for_s: float
) -> None:
    events = (f"at_s = 1\nfor_s = 5\n{fault} = [1]", f"at_s = {second_s}\nfor_s = {for_s}\n")
    states = states_of_1(events[0], f"{events[1]}{fault} = [1]")
    last_end_s = max(6.0, second_s + for_s)
    held = [state for at_s, state in states.items() if 1.0 <= at_s < last_end_s]
    assert set(held) == {down}
    assert states[last_end_s + 1.5] is State.RUNNING


def test_an_end_and_a_beginning_at_one_decimal_time_happen_in_that_order() -> None:
    """1.1 + 2.2 is more than 3.3 in floating point; the kill at 3.3 s must come last."""
    states = states_of_1("at_s = 1.1\nfor_s = 2.2\nkill = [1]", "at_s = 3.3\nkill = [1]")
    assert states[11.5] is State.DEAD


tenths = st.integers(1, 500)


@settings(derandomize=True, deadline=None, max_examples=300)
@given(tenths, tenths)
def test_ends_fall_on_the_decimal_time_that_a_person_adds_up(at: int, lasts: int) -> None:
    at_s, for_s = at / 10, lasts / 10
    flown = scenario(f"at_s = {at_s}\nfor_s = {for_s}\nkill = [1]")
    (_, end) = steps(flown)
    assert end.at_s == (at + lasts) / 10


def test_of_two_faults_of_a_sensor_the_later_acts_and_the_earlier_again_after_it() -> None:
    faults = SensorFaults(seed=1)
    faults.begin(1, 0, "proximity", "silent")
    faults.begin(2, 0, None, "stuck")
    stuck = faults.reading(0, TRUE, 1)
    moved = ProximityReading(vehicles=((2.0, 0.0, 0.0),))
    assert faults.reading(0, moved, 2) == stuck == TRUE
    faults.end(2, 0)
    assert faults.reading(0, moved, 3) == NO_READING
    assert faults.scans(0, (Scan(kind=0, ranges=b""),), 3) == (Scan(kind=0, ranges=b""),)
    faults.end(1, 0)
    assert faults.reading(0, moved, 4) == moved
    assert not faults


@settings(derandomize=True, deadline=None)
@given(
    st.lists(st.sets(st.integers(0, 3), min_size=1), min_size=1, max_size=6),
    st.randoms(use_true_random=False),
)
def test_an_agent_is_free_exactly_when_no_fault_holds_it(held, random) -> None:
    holds = FaultHolds()
    for number, agents in enumerate(held):
        holds.begin(number, tuple(agents))
    left = dict(enumerate(held))
    order = list(left)
    random.shuffle(order)
    for number in order:
        ended = left.pop(number)
        free = {agent for agent in ended if not any(agent in other for other in left.values())}
        assert set(holds.end(number)) == free
