"""The life of a process: only transitions of the table happen."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine.test_membership import CLAIMS, positions, scenario, states
from worldsim.engine.membership import Membership
from worldsim.engine.process_life import (
    ALIVE,
    TRANSITIONS,
    State,
    TransitionError,
    next_state,
)
from worldsim.scenario.faults import Join, Kill, Leave, Pause, ProcessFault, Restart, Resume

ROOT = Path(__file__).parents[2]
AFTER = {(before, after) for (before, _), after in TRANSITIONS.items()}
selectors = st.lists(
    st.one_of(st.integers(0, 11), st.sampled_from(["all", "random:2", "vertex:V1", "queue:Q1"])),
    min_size=1,
    max_size=3,
).map(tuple)
plain = st.lists(
    st.one_of(st.integers(0, 11), st.sampled_from(["all", "random:2"])), min_size=1, max_size=3
).map(tuple)
faults = st.one_of(
    st.builds(Kill, selectors),
    st.builds(Leave, selectors),
    st.builds(Pause, selectors),
    st.builds(Restart, plain),
    st.builds(Resume, plain),
    st.just(Join(count=1)),
)
steps = st.one_of(
    st.tuples(st.just("begin"), faults),
    st.tuples(st.just("end"), st.integers(0, 20)),
    st.tuples(st.just("exit"), st.integers(0, 11)),
    st.tuples(st.just("boot"), st.none()),
)


class Life:
    """A team under arbitrary faults; every change of state is checked."""

    def __init__(self) -> None:
        self.members = Membership(scenario())
        self._begun: dict[int, ProcessFault] = {}
        self._time_s = 0.0
        self._joined = 0

    def apply(self, step: str, argument: ProcessFault | int | None) -> None:
        before = states(self.members)
        self._time_s += 0.4
        self._apply(step, argument)
        for agent, after in enumerate(states(self.members)):
            assert after is before[agent] or (before[agent], after) in AFTER
            assert self.members.alive[agent] == (after in ALIVE)
            assert self.members.running[agent] == (after is State.RUNNING)
            assert self.members.has_process(agent, None) == (after in ALIVE | {State.BOOTING})
        assert self.members.all_alive == bool(np.all(self.members.alive))

    def _apply(self, step: str, argument: ProcessFault | int | None) -> None:
        members, number = self.members, len(self._begun)
        if step == "boot":
            members.apply(members.admission(self._time_s), self._time_s)
        elif step == "exit" and isinstance(argument, int):
            if members.has_process(argument, None):
                members.record_exit(argument)
        elif step == "end" and isinstance(argument, int):
            fault = self._begun.get(argument)
            operation = fault and members.end_operation(argument, fault, positions(), self._time_s)
            if operation:
                members.apply(operation, self._time_s)
        elif isinstance(argument, ProcessFault):
            self._joined += isinstance(argument, Join)
            if self._joined <= 3 or not isinstance(argument, Join):
                self._begun[number] = argument
                operation = members.begin_operation(
                    number, argument, CLAIMS, positions(), self._time_s
                )
                members.apply(operation, self._time_s)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.lists(steps, max_size=25))
def test_only_transitions_of_the_table_happen(
    played: list[tuple[str, ProcessFault | int | None]],
) -> None:
    life = Life()
    for step, argument in played:
        life.apply(step, argument)


def test_a_transition_that_is_not_in_the_table_raises() -> None:
    with pytest.raises(TransitionError, match="a process that is dead cannot pause"):
        next_state(State.DEAD, "pause")


def test_every_state_but_absent_is_reached_and_every_state_is_left() -> None:
    assert {after for _, after in AFTER} == set(State) - {State.ABSENT}
    assert {before for before, _ in AFTER} == set(State)
