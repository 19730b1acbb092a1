"""The life of a process: only the table's transitions happen, and the docs draw that table."""

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
    """A team under arbitrary faults, whose every change of state is checked."""

    def __init__(self) -> None:
        self.members = Membership(scenario())
        self._begun: dict[int, ProcessFault] = {}
        self._time_s = 0.0
        self._joined = 0

    def play(self, word: str, what: ProcessFault | int | None) -> None:
        before = states(self.members)
        self._time_s += 0.4
        self._do(word, what)
        for agent, after in enumerate(states(self.members)):
            assert after is before[agent] or (before[agent], after) in AFTER
            assert self.members.alive[agent] == (after in ALIVE)
            assert self.members.running[agent] == (after is State.RUNNING)
            assert self.members.has_process(agent, None) == (after in ALIVE | {State.BOOTING})
        assert self.members.all_alive == bool(np.all(self.members.alive))

    def _do(self, word: str, what: ProcessFault | int | None) -> None:
        members, number = self.members, len(self._begun)
        if word == "boot":
            members.apply(members.admission(self._time_s), self._time_s)
        elif word == "exit" and isinstance(what, int):
            if members.has_process(what, None):
                members.record_exit(what)
        elif word == "end" and isinstance(what, int):
            fault = self._begun.get(what)
            operation = fault and members.end_operation(what, fault, positions(), self._time_s)
            if operation:
                members.apply(operation, self._time_s)
        elif isinstance(what, ProcessFault):
            self._joined += isinstance(what, Join)
            if self._joined <= 3 or not isinstance(what, Join):
                self._begun[number] = what
                operation = members.begin_operation(number, what, CLAIMS, positions(), self._time_s)
                members.apply(operation, self._time_s)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.lists(steps, max_size=25))
def test_only_transitions_of_the_table_happen(
    played: list[tuple[str, ProcessFault | int | None]],
) -> None:
    life = Life()
    for word, what in played:
        life.play(word, what)


def test_a_change_that_the_table_does_not_have_is_an_error() -> None:
    with pytest.raises(TransitionError, match="a process that is dead cannot pause"):
        next_state(State.DEAD, "pause")


def test_every_state_but_the_first_can_be_reached_and_left() -> None:
    assert {after for _, after in AFTER} == set(State) - {State.ABSENT}
    assert {before for before, _ in AFTER} == set(State)
