"""An agent of which all is rejected takes no part, unless a fault or the host may be why."""

from typing import Any

import pytest

from netem.sender_counts import SenderRow
from worldsim.results.refused_agents import refused_rows, refused_texts


def texts(rows: list[SenderRow], agents: int = 9, *faults: tuple[str, list[int]]) -> list[str]:
    struck: list[Any] = [{"kind": kind, "agents": struck} for kind, struck in faults]
    return refused_texts(refused_rows((), rows, ()), struck, agents)


def test_it_is_named_with_what_is_rejected_and_why() -> None:
    foreign = [SenderRow(8, 0, {"spoofed": 40, "invalid": 60})]
    ours = [SenderRow(0, 100, {}), SenderRow(1, 90, {"stale": 3}), SenderRow(8, 1, {"stale": 99})]
    rows = refused_rows(foreign, ours, [SenderRow(8, 100, {})])
    assert [(row["agent"], row["messages"], row["accepted"]) for row in rows] == [
        (1, "transmissions", 90),
        (8, "frames", 0),
        (8, "transmissions", 1),
    ]
    assert refused_texts(rows, [], 9) == [
        "agent 8 takes no part: whoever hears it rejects all of its frames"
        " (60 invalid: not the fields of the wire, 40 spoofed: another agent's id)",
        "agent 8 takes no part: netem rejects all but 1 of its transmissions (99 stale: old slots)",
    ]


@pytest.mark.parametrize(
    ("row", "named"),
    [
        (SenderRow(8, 0, {"ahead": 10}), True),
        (SenderRow(8, 0, {"ahead": 9}), False),
        (SenderRow(8, 2, {"ahead": 1000}), False),
    ],
)
def test_a_few_messages_prove_nothing(row: SenderRow, named: bool) -> None:
    assert bool(texts([row])) is named


@pytest.mark.parametrize("kind", ["slow", "starve", "clock", "pose", "intruder"])
def test_who_is_struck_by_a_fault_that_lets_it_say_so_is_not_blamed(kind: str) -> None:
    rows = [SenderRow(7, 0, {"incarnation": 99}), SenderRow(8, 0, {"stale": 99})]
    assert [text[:7] for text in texts(rows, 9, (kind, [8]))] == ["agent 7"]
    assert len(texts(rows, 9, ("jam", [8]))) == 2


def test_where_half_of_all_are_untimely_the_host_is_why() -> None:
    late = [SenderRow(agent, 0, {"stale": 99, "repeated": 1}) for agent in range(5)]
    assert texts(late, agents=10) == []
    assert len(texts(late, agents=11)) == 5
    malformed = [SenderRow(agent, 0, {"malformed": 99}) for agent in range(5)]
    assert len(texts(malformed, agents=5)) == 5
