"""The report of ``qswarm netem check``: every parameter measured, printed and drawn."""

from pathlib import Path

from worldsim.link_check.checks import Finding, findings
from worldsim.link_check.packets import PACKETS
from worldsim.link_check.parameter_sets import parameter_sets
from worldsim.scenario.tables import Scenario

INTRODUCTION = f"""\
Each parameter is measured with up to {PACKETS} packets. ok: measured and configured differ by no
more than the tolerance, the 99.9 % interval of such a measurement. OUTSIDE: they differ by more."""
COLUMNS = f"  {'result':8} {'parameter':32} {'configured':>12} {'measured':>12} {'tolerance':>12}"


def report(scenario: Scenario, picture: Path) -> bool:
    """Measure, print and draw all links of a scenario; return whether all parameters are ok.

    Raises OSError where the picture cannot be written.
    """
    from worldsim.link_check.plot import plot  # noqa: PLC0415 - matplotlib is slow to import

    print(INTRODUCTION)
    sets, all_ok = parameter_sets(scenario), True
    for each in sets:
        print(f"\n{each.name}\n{COLUMNS}", flush=True)
        for finding in findings(each.link, scenario.seed, each.channel):
            print(row(finding), flush=True)
            all_ok = all_ok and finding.ok
    plot(sets, scenario.seed, picture)
    return all_ok


def row(finding: Finding) -> str:
    """Return a finding as a row of the table."""
    result = "ok" if finding.ok else "OUTSIDE"
    figures = f"{finding.configured:12.4f} {finding.measured:12.4f} {finding.tolerance:12.4f}"
    return f"  {result:8} {finding.name:32} {figures}"
