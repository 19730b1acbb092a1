"""Warnings of formations that a scenario's team cannot fill: queues that stay empty."""

from collections.abc import Iterator

from agent.qstructure.formation import FormationSpec, formation_of
from worldsim.scenario.problem import Problem
from worldsim.scenario.tables import Scenario


def empty_queues(scenario: Scenario) -> Iterator[Problem]:
    """Yield a warning for each queue that nobody of the team flies in, besides shared vertices.

    A formation that comes later may meet those who join: it is filled with all of them.
    """
    yield from _of_formation(scenario, "formation", scenario.formation, scenario.fleet.agents)
    for index, event in enumerate(scenario.event):
        if isinstance(event.action, FormationSpec):
            key = f"event[{index}].formation"
            yield from _of_formation(scenario, key, event.action, scenario.rows)


def _of_formation(
    scenario: Scenario, key: str, spec: FormationSpec, team: int
) -> Iterator[Problem]:
    formation = formation_of(spec, scenario.control.spacing_m)
    left = team - len(formation.common)
    for j, count in enumerate(formation.divide(team)):
        if count == 0:
            yield Problem(
                f"{key}.queue[{j}].capacity",
                f"queue {spec.queue[j].name!r} stays empty: {left} agents besides shared vertices"
                f" are too few for its share of {formation.capacities[j]:.3g}",
            )
