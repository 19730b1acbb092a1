"""I6: how often an agent may take up and give up the lead of a vertex."""

import pytest

from agent.messages import Role
from worldsim.judge.lead_changes import LeadChanges
from worldsim.judge.run_events import RoleChanged


@pytest.mark.parametrize(
    ("kinds", "taken", "allowed"),
    [
        ([], [], 3),
        (["Killed"], [], 3),
        (["Killed", "Killed"], [], 3),
        (["Killed", "Paused"], [], 6),
        (["Killed"], [3], 6),
        (["Killed"], [1, 2], 3),
        (["Killed", "Paused"], [3, 4], 9),
    ],
)
def test_each_kind_of_fault_and_a_taken_place_of_the_component_allow_three_changes(
    kinds: list[str], taken: list[int], allowed: int
) -> None:
    leads = LeadChanges()
    for kind in kinds:
        leads.strike(1.0, kind)
    leads.near_taken = frozenset(taken)
    for change in range(20):
        role: Role = "member" if change % 2 else "vertex"
        leads.take(RoleChanged(t_s=1.0 + change, agent=3, role=role), informed=True)
        assert (leads.take_excess() == 0) == (change < allowed)


@pytest.mark.parametrize(("restart_s", "excess"), [(2.0, 0), (20.0, 1)])
def test_what_faults_allowed_does_not_outlast_them(restart_s: float, excess: int) -> None:
    leads = LeadChanges()
    leads.strike(1.0, "Killed")
    leads.strike(1.0, "Paused")
    leads.restart(restart_s)  # agents came into reach
    for change in range(4):
        role: Role = "member" if change % 2 else "vertex"
        leads.take(RoleChanged(t_s=21.0 + change, agent=3, role=role), informed=True)
    assert leads.take_excess() == excess


def test_a_later_fault_is_answered_for_itself() -> None:
    leads = LeadChanges()
    leads.strike(1.0, "Killed")
    leads.strike(2.0, "Paused")
    for change in range(4):
        role: Role = "member" if change % 2 else "vertex"
        leads.take(RoleChanged(t_s=3.0 + change, agent=3, role=role), informed=True)
    assert leads.take_excess() == 1
