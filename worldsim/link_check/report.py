"""A scenario's radio, tried out: every parameter set measured and told, and drawn."""

from pathlib import Path

from worldsim.link_check.checks import findings
from worldsim.link_check.parameter_sets import parameter_sets
from worldsim.link_check.telling import HEAD, told
from worldsim.scenario.tables import Scenario


def survey(scenario: Scenario, file: Path) -> bool:
    """Measure all links of a scenario, print what was found, draw it; return whether all held.

    Raises OSError where the picture cannot be written.
    """
    from worldsim.link_check.plot import plot  # noqa: PLC0415 - matplotlib takes its time

    sets, held = parameter_sets(scenario), True
    for each in sets:
        print(f"{each.name}\n{HEAD}", flush=True)
        for finding in findings(each.link, scenario.seed, each.channel):
            print(told(finding), flush=True)
            held = held and finding.held
    plot(sets, scenario.seed, file)
    return held
