"""A survey in words: one line a measure."""

from worldsim.link_check.checks import Finding

HEAD = f"  {'':6} {'':32} {'configured':>12} {'measured':>12} {'99.9 %':>12}"


def told(finding: Finding) -> str:
    """Return a finding as a line of a table."""
    word = "held" if finding.held else "BROKEN"
    figures = f"{finding.configured:12.4f} {finding.measured:12.4f} {finding.bound:12.4f}"
    return f"  {word:6} {finding.name:32} {figures}"
