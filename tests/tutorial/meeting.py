"""The meeting of docs/controllers.md: its files, and whether a flight of it came to agree."""

import json
import re
from pathlib import Path

import numpy as np

import worldsim.results
from tests.tutorial.bench import ROOT
from tests.tutorial.page import blocks

NAMED = re.compile(r"(?:#|//) (?:carousel/)?(meeting\.\w+)")


def save_files(folder: Path) -> None:
    """Save the controller in Python and in C, and the scenario, as the pages have them."""
    for page in ("controllers.md", "lines.md"):
        for block in blocks((ROOT / "docs" / page).read_text()):
            found = NAMED.match(block.text)
            if found is not None:
                text = block.text.replace("../qswarm", str(ROOT)).replace(
                    "carousel.meeting", "meeting"
                )
                (folder / found[1]).write_text(text)
    assert {"meeting.py", "meeting.c", "meeting.toml"} <= {each.name for each in folder.iterdir()}


def assert_agreed(run: Path) -> None:
    """Assert that all agents name the mean of their start positions at last, to 5 cm."""
    opened = worldsim.results.open(run)
    poses, signals = opened.poses, opened.signals
    first = np.asarray(poses["tick"]) == 0
    last = np.asarray(signals["tick"]) == max(signals["tick"])
    for axis in "xyz":
        mean = np.mean(np.asarray(poses[f"{axis}_m"])[first])
        said = np.asarray(signals["signal"]) == f"meet_{axis}"
        named = np.asarray(signals["value"])[last & said]
        assert len(named) == 9
        assert np.abs(named - mean).max() < 0.05


def trace_of(run: Path) -> str:
    """Return the trace of a run."""
    trace: str = json.loads((run / "summary.json").read_text())["trace_sha256"]
    return trace
