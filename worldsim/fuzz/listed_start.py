"""A drawn start written out: then agents can be left out, and the others start where they did."""

from typing import Final

import numpy as np

from worldsim.scenario.tables import Scenario
from worldsim.search.draws import Tables
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.start_positions import start_poses_of

METRE_DIGITS, DEGREE_DIGITS = 3, 1


def with_listed_start(tables: Tables, scenario: Scenario) -> Tables | None:
    """Return a scenario's tables with the poses at which it starts; None where they are listed."""
    if (tables["fleet"].get("start") or {}).get("kind") == "list":
        return None
    poses = start_poses_of(scenario, Obstacles(scenario.obstacle))
    start: Final = {
        "kind": "list",
        "positions_m": np.round(poses.position, METRE_DIGITS).tolist(),
        "yaws_deg": np.round(np.degrees(poses.yaw), DEGREE_DIGITS).tolist(),
    }
    return {**tables, "fleet": {**tables["fleet"], "start": start}}
