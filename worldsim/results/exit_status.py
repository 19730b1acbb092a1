"""The exit statuses of ``qswarm``: a contract with shell scripts and CI."""

PASS = 0
"""Every expectation is met."""
FAIL = 1
"""An expectation is not met, or an invariant is violated."""
BAD_INPUT = 2
"""The input is wrong; nothing was started and nothing overwritten."""
INCONCLUSIVE = 3
"""The host was too slow, the run ended early, or results were lost: no pass, and no failure."""
INTERRUPTED = 130
"""Ctrl-C or SIGTERM."""
INTERRUPTION = "interrupted"
"""How the reason begins of what they have cut off."""
OUTPUT_CLOSED = 141
"""Nothing reads the output any more, as in `qswarm ... | head`."""

EXIT_STATUS = {"pass": PASS, "fail": FAIL, "inconclusive": INCONCLUSIVE}
"""The status for each outcome in summary.json."""
