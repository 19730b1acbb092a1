"""What was drawn, written out: where agents start, and whom a fault struck.

Then agents and faults can be left out, and the others start where they did and are struck as they
were: a random choice depends on how many agents there are, and on which event it belongs to.
"""

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np

from worldsim.scenario.tables import Scenario
from worldsim.search.draws import Tables
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.start_positions import start_poses_of

METRE_DIGITS, DEGREE_DIGITS = 3, 1
OF_AGENTS: Final = ("kill", "leave", "pause", "restart", "resume")
"""Actions whose value is a list of selectors."""


def with_listed_start(tables: Tables, scenario: Scenario) -> Tables:
    """Return a scenario's tables with the poses at which it starts."""
    if (tables["fleet"].get("start") or {}).get("kind") == "list":
        return tables
    poses = start_poses_of(scenario, Obstacles(scenario.obstacle))
    start = {
        "kind": "list",
        "positions_m": np.round(poses.position, METRE_DIGITS).tolist(),
        "yaws_deg": np.round(np.degrees(poses.yaw), DEGREE_DIGITS).tolist(),
    }
    return {**tables, "fleet": {**tables["fleet"], "start": start}}


def with_named_agents(tables: Tables, rows: Iterable[Mapping[str, Any]]) -> Tables:
    """Return tables whose faults name the agents that they struck.

    rows: of the flight's events.jsonl; their numbers are those of the scenario's events.
    """
    struck: dict[tuple[int, str], set[int]] = {}
    for row in rows:
        if row.get("number") is not None and row.get("agent") is not None:
            struck.setdefault((row["number"], row["kind"]), set()).add(row["agent"])
    events = [
        _named(event, {kind: sorted(ids) for (of, kind), ids in struck.items() if of == number})
        for number, event in enumerate(tables.get("event") or ())
    ]
    return {**tables, "event": events} if events else tables


def _named(event: Tables, struck: Mapping[str, list[int]]) -> Tables:
    found = dict(event)
    for kind, ids in struck.items():
        value = event.get(kind)
        if kind in OF_AGENTS and value and all(_names_agents(each) for each in value):
            found[kind] = ids
        elif isinstance(value, dict) and "agents" in value:
            found[kind] = {**value, "agents": ids}
    return found


def _names_agents(selector: int | str) -> bool:
    """Whether a selector selects agents, and no other process."""
    return selector not in ("netem", "world")
