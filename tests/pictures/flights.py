"""The flights of which pictures are taken, with the times that show what matters in each."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from worldsim.commands.app import command
from worldsim.recording.panels import MOTION, NETWORK


class Flight(NamedTuple):
    """A scenario of the library with other keys, how long it flies, and when it is looked at."""

    scenario: str
    until_s: float
    times_s: tuple[float, ...]
    more: str = ""
    """Tables to add to the scenario (TOML)."""
    tab: str = MOTION
    """The tab of the layout that shows what matters."""


STORM = """
[[event]]
at_s = 17.0
for_s = 5.0
jam = { centre_m = [-1.5, 1.5, 0.0], radius_m = 1.6 }
"""

FLIGHTS: Mapping[str, Flight] = {
    "wedge-9": Flight("wedge-9", 15.0, (1.0, 4.0, 15.0)),
    "switching-6": Flight("switching-6", 52.0, (10.0, 22.0, 52.0)),
    "field-6": Flight("field-6", 40.0, (5.0, 20.0, 40.0)),
    "partition-9": Flight("partition-9", 30.0, (10.0, 19.0, 30.0), STORM, NETWORK),
    "flocking-9": Flight("flocking-9", 12.0, (1.0, 6.0, 12.0)),
    "wedge-100": Flight("wedge-100", 5.0, (1.0, 3.0, 5.0)),
}
LIBRARY = Path(__file__).parents[2] / "deploy" / "scenarios"


def fly(name: str, folder: Path) -> Path:
    """Fly one of FLIGHTS in virtual time, in a new folder; return its recording."""
    flight = FLIGHTS[name]
    folder.mkdir(parents=True)
    text = (LIBRARY / f"{flight.scenario}.toml").read_text(encoding="utf-8")
    formations = str(LIBRARY.parent / "formations")
    scenario = folder / f"{name}.toml"
    scenario.write_text(text.replace("../formations", formations) + flight.more, encoding="utf-8")
    arguments = [str(scenario), "--duration", str(flight.until_s), "--quiet"]
    command(["sim", *arguments, "--out", str(folder / "run")])
    return folder / "run" / "run.rrd"
