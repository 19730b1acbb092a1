"""A scenario's radio, tried out: every parameter set measured and told, and drawn."""

from pathlib import Path

from worldsim.link_check.checks import Finding, findings
from worldsim.link_check.parameter_sets import parameter_sets
from worldsim.scenario.tables import Scenario

HEAD = f"  {'':6} {'':32} {'configured':>12} {'measured':>12} {'99.9 %':>12}"


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


def told(finding: Finding) -> str:
    """Return a finding as a line of a table."""
    word = "held" if finding.held else "BROKEN"
    figures = f"{finding.configured:12.4f} {finding.measured:12.4f} {finding.bound:12.4f}"
    return f"  {word:6} {finding.name:32} {figures}"
