"""For every test: Ctrl-C means Ctrl-C, a closed terminal ends what runs in it; little garbage."""

import gc
import signal

import pytest
from hypothesis import settings

FLYING = (
    "campaign",
    "closed_loop",
    "commands",
    "engine",
    "export",
    "judge",
    "link_check",
    "pictures",
    "random_flights",
    "recording",
    "report",
    "schemes",
    "structure_figures",
)
"""Folders of tests that mostly fly: CI runs them compiled where it can, in half of the time."""
FLYING_FILES = (
    "test_control.py",
    "test_deadlock_escape.py",
    "test_documents.py",
    "test_evasion.py",
    "test_extreme_numbers.py",
    "test_gathering_teams.py",
    "test_numbers.py",
    "test_spare_vertices.py",
    "test_team.py",
)
"""The same of files in other folders."""

# A shell that starts this run in the background has it ignore SIGINT, and nohup has it ignore
# SIGHUP. Whatever a test starts would inherit that; some tests send these signals.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

# A busy host makes an example slow, not wrong: hypothesis would fail it after 200 ms.
settings.register_profile("no deadline", deadline=None)
settings.load_profile("no deadline")

# As in a run (worldsim.commands.app), the collector looks for reference cycles less often.
gc.set_threshold(200_000)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what flies, and does so compiled as well."""
    for item in items:
        flies = item.path.parent.name in FLYING or item.path.name in FLYING_FILES
        if flies and item.get_closest_marker("pure") is None:
            item.add_marker("flight")


def pytest_collection_finish() -> None:
    """Exempt the thousands of collected tests from garbage collection."""
    gc.freeze()
