"""Warnings of a start from which a formation cannot be led at once.

Agents allocate the places of a formation among those that hear each other, over one hop or several.
Such a team finds a leader for a vertex however far it is. Groups that do not hear each other are
teams of their own until they meet, and each sends somebody to a vertex that is out of reach of all.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from agent.qstructure.frame_path import Track
from netem.conditions import LinkModels
from netem.wire.channels import LOCAL
from worldsim.judge.connectivity import Connectivity
from worldsim.scenario.problem import Problem
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import path_of
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.start_positions import start_poses_of
from worldsim.truth.vehicle import Floats

KEY = "fleet.start"
SHOWN_SIZES: Final = 8


def start_warnings(scenario: Scenario) -> list[Problem]:
    """Return warnings of a start at which agents do not all hear each other.

    They name the vertices that are out of everybody's range. The start must have room for the
    fleet.
    """
    if not scenario.expect.converge:
        return []
    position = start_poses_of(scenario, Obstacles(scenario.obstacle)).position
    sizes = _group_sizes(scenario, position)
    if len(sizes) == 1:
        return []
    groups = _told(sizes)
    far = [f"{detail}; {groups}" for detail in _far_vertices(scenario, position)]
    alone = f"{groups}; each forms the whole formation until it meets the others"
    return [Problem(KEY, detail) for detail in far or [alone]]


def _far_vertices(scenario: Scenario, position: Floats) -> Iterator[str]:
    """Yield what is to be said of each vertex that is out of every agent's range."""
    models = LinkModels(scenario.netem)
    reach_m = np.array([models.reach_m(LOCAL, agent) for agent in range(len(position))])
    frame = Track(path_of(scenario.frame)).at(0.0)
    for name, point in scenario.formation.vertices.items():
        away_m = np.linalg.norm(position - np.array(frame.to_world(point)), axis=1)
        nearest = int(np.argmin(away_m))
        if np.all(away_m > reach_m):
            yield (
                f"vertex {name!r} is out of everybody's radio range: the nearest agent, {nearest},"
                f" starts {away_m[nearest]:.3g} m from it, and is heard up to"
                f" {reach_m[nearest]:g} m"
            )


def _group_sizes(scenario: Scenario, position: Floats) -> list[int]:
    """Return the sizes of the groups that hear each other at the start, the largest first."""
    rows = np.zeros((scenario.rows, 3))
    rows[: len(position)] = position
    alive = np.arange(scenario.rows) < len(position)
    label = Connectivity(scenario).groups(rows, alive)
    return sorted(np.bincount(label[alive]).tolist(), reverse=True)


def _told(sizes: list[int]) -> str:
    shown = ", ".join(map(str, sizes[:SHOWN_SIZES])) + (", ..." if len(sizes) > SHOWN_SIZES else "")
    return f"{len(sizes)} groups of agents do not hear each other ({shown} agents)"
