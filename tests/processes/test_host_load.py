"""A fleet on a host that another program keeps busy: no verdict, and what to do."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.host_load import busy_loops
from tests.processes.harness import Started
from tests.processes.test_fleet import launched, summary_of

pytestmark = pytest.mark.processes


def test_a_host_too_busy_makes_a_run_inconclusive_and_names_who_was_late(
    start: Callable[..., Started], scenario: Callable[[float], str], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    with busy_loops(2 * (os.cpu_count() or 1)):
        fleet = launched(start, scenario(60.0), run, "--no-recording", "--speed", "40")
        assert fleet.status(60.0) == 3, fleet.text
    reason = summary_of(run)["reason"]
    assert reason.startswith("the host was too slow: ")
    assert " of ticks were late, most often those of agent-" in reason
    assert "use --lockstep, fewer agents or a lower --speed" in reason
