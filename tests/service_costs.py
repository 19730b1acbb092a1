"""What an agent's services cost: CPU time of a controller that asks for none and for all.

``python -m tests.service_costs`` flies ``wedge-9`` in virtual time with a controller that hovers,
without a service and with all, by turns, and prints for each the CPU time of an agent's step, the
agent, its radio and its world together, and the ratio of each pair. The first pair warms up.
"""

import argparse
import sys
from statistics import median

from agent.controller import Intent, Senses
from agent.messages import ZERO
from agent.services import SERVICES
from agent.setup import AgentSetup
from worldsim.bench.fleets import flight_cpu_s
from worldsim.scenario.file import load
from worldsim.scenario.library import find_scenario
from worldsim.scenario.tables import Scenario


class Hover:
    """Stays where it is."""

    def __init__(self, setup: AgentSetup) -> None:
        """Keep nothing."""

    def decide(self, senses: Senses) -> Intent:
        """Return that it wants no motion."""
        return Intent(ZERO, ZERO, senses.yaw, 0.0, senses.position)


def scenario_of(services: tuple[str, ...], lasts_s: float) -> Scenario:
    """Return the scenario of a flight with services."""
    keys = {
        "control.controller": "tests.service_costs:Hover",
        "control.services": str(list(services)),
        "duration_s": str(lasts_s),
    }
    return load(find_scenario("wedge-9"), keys)


def step_s(services: tuple[str, ...], lasts_s: float) -> float:
    """Return the CPU time of an agent's step [s]."""
    scenario = scenario_of(services, lasts_s)
    steps = scenario.fleet.agents * scenario.fleet.tick_hz * lasts_s
    return flight_cpu_s(scenario) / steps


def main() -> int:
    """Fly the pairs, and print the CPU time of a step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=11)
    parser.add_argument("--seconds", type=float, default=10.0, help="simulated time of a flight")
    given = parser.parse_args()
    pairs = []
    for number in range(given.pairs + 1):
        pair = step_s((), given.seconds), step_s(SERVICES, given.seconds)
        if number:
            pairs.append(pair)
            print(f"{1e6 * pair[0]:.0f} us, {1e6 * pair[1]:.0f} us", flush=True)
    none, everything = (1e6 * median(column) for column in zip(*pairs, strict=True))
    ratios = sorted(everything / none for none, everything in pairs)
    print(
        f"none {none:.0f} us, all {everything:.0f} us of an agent's step (medians of {len(pairs)}"
        f" pairs); ratio {median(ratios):.2f}, {ratios[0]:.2f} to {ratios[-1]:.2f}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
