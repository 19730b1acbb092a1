"""Other draws from a slot on: until then a flight is the same to the bit, and after it another."""

import numpy as np
import pytest

from tests.small_scenario import SMALL
from worldsim.engine.virtual import VirtualFleet
from worldsim.scenario.file import parse

SLOTS = 80
AT = 40
RADIOS = {
    "loss": "loss_percent = 50\n",
    "bursts": "gemodel = { p_percent = 20, r_percent = 40 }\n",
    "jitter": "delay_ms = 50\njitter_ms = 50\n",
}
NOISES = {
    "proximity": "[sensor.proximity]\nnoise_m = 0.05\n",
    "laser": '[vehicle]\nsensors = ["laser"]\n[sensor.laser]\nnoise_m = 0.05\n',
    "pose": "[[event]]\nat_s = 0.1\npose = { agents = [0], noise_m = 0.1 }\n",
    "wrong readings": '[[event]]\nat_s = 0.1\nsensor = { agents = [0], mode = "wrong" }\n',
}


def traces(tables: str, redraw: int | None) -> list[str]:
    """Return the hash of all that happened so far, slot by slot."""
    fleet, found = VirtualFleet(parse(f"{SMALL}{tables}")), []
    for slot in range(SLOTS):
        if slot == redraw:
            fleet.redraw(99)
        fleet.slot()
        found.append(fleet.loop.trace.sha256)
    return found


@pytest.mark.parametrize("radio", RADIOS)
def test_a_flight_is_the_same_until_it_is_drawn_anew(radio: str) -> None:
    tables = f"[netem]\n{RADIOS[radio]}"
    whole, other = traces(tables, None), traces(tables, AT)
    assert whole[:AT] == other[:AT]
    assert whole[-1] != other[-1]


@pytest.mark.parametrize("noise", NOISES)
def test_sensors_draw_anew(noise: str) -> None:
    fleet = VirtualFleet(parse(f"{SMALL}{NOISES[noise]}"))
    for _ in range(AT):
        fleet.slot()
    before = fleet.loop.world.observe([0])
    assert fleet.loop.world.observe([0]) == before
    fleet.redraw(99)
    assert fleet.loop.world.observe([0]) != before


def test_without_chance_other_draws_change_nothing() -> None:
    assert traces("", None) == traces("", AT)


def test_starts_stay_those_of_the_scenario() -> None:
    fleets = [VirtualFleet(parse(SMALL)) for _ in range(2)]
    fleets[1].redraw(99)
    one, other = (fleet.loop.world.vehicles.position for fleet in fleets)
    assert np.array_equal(one, other)
