"""Fleets for the benchmark: wedges of any size at one density, flown in virtual time."""

from math import ceil
from time import process_time

from agent.qstructure.formation import FormationSpec, QueueSpec
from agent.qstructure.shape import Ray
from netem.link_parameters import Conditions
from worldsim.engine.virtual import VirtualFleet
from worldsim.scenario.start import BoxStart
from worldsim.scenario.tables import Fleet, Scenario

EDGES = ((-1.0, 1.0, 1.0), (-1.0, -1.0, 1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, -1.0))
BOX_M = (5.0, 5.0, 3.0)
"""Start box of BOX_AGENTS agents; larger fleets start at the same density."""
BOX_AGENTS = 9
RANGE_M = 6.0
EIGHT_IN_RANGE_M = 2.5
"""Radio range within which an agent of a large fleet hears about eight others."""


def wedge(agents: int, duration_s: float, range_m: float = RANGE_M) -> Scenario:
    """Return a wedge of ``agents`` that start at the density of nine in 5 x 5 x 3 m."""
    queues = tuple(QueueSpec(f"Q{i}", ("V1",), Ray(edge)) for i, edge in enumerate(EDGES))
    scale = (agents / BOX_AGENTS) ** (1.0 / 3.0)
    x, y, z = (ceil(10.0 * side * scale) / 10.0 for side in BOX_M)
    return Scenario(
        name=f"wedge-{agents}",
        fleet=Fleet(agents=agents, start=BoxStart(size_m=(x, y, z))),
        formation=FormationSpec("wedge", {"V1": (0.0, 0.0, 0.0)}, queues),
        duration_s=duration_s,
        netem=Conditions(range_m=range_m),
    )


def flight_cpu_s(scenario: Scenario) -> float:
    """Fly a scenario without a recording; return the CPU time of the flight [s]."""
    fleet = VirtualFleet(scenario)
    started_s = process_time()
    for _ in range(scenario.slots):
        fleet.slot()
    return process_time() - started_s
