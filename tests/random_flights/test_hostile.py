"""The safety filter keeps I1 under hostile controllers, for every vehicle and set of sensors.

``python -m tests.random_flights.hostile --count 2000`` flies as many as wanted.
"""

from collections import Counter
from functools import partial
from pathlib import Path

import pytest

from agent.guidance.safety_monitor import SafetyMonitor
from tests.random_flights import hostile
from tests.random_flights.campaign import Campaign, report
from tests.random_flights.controllers import KINDS as HOSTILES
from tests.random_flights.hostile import CASES, CONTROLLERS, case_of
from worldsim.scenario.file import parse
from worldsim.search.fleets import KINDS, SENSORS

BASE = 5
SHORT = 300
"""Steps of all agents in a flight of the suite."""
ROWS = len(KINDS) * len(SENSORS)


def test_every_kind_of_vehicle_and_set_of_sensors_keeps_i1(tmp_path: Path) -> None:
    flights = Campaign(partial(hostile.scenario, BASE, steps=SHORT), tmp_path, twice_every=0)
    rows = flights.fly(range(ROWS))
    assert [row for row in rows.values() if "failure" in row] == [], report(rows)


def test_members_that_lie_about_the_structure_bring_nobody_near_another(tmp_path: Path) -> None:
    generate = partial(hostile.scenario, BASE, steps=SHORT, controller="Liar")
    rows = Campaign(generate, tmp_path, twice_every=4).fly(range(4))
    assert [row for row in rows.values() if "failure" in row] == [], report(rows)


def test_numbers_in_a_row_fly_every_vehicle_and_set_of_sensors_and_all_numbers_every_case() -> None:
    assert len({case_of(number).row for number in range(ROWS)}) == ROWS
    assert {case_of(number) for number in range(len(CASES))} == set(CASES)


@pytest.mark.pure
def test_without_the_filter_every_kind_of_hostile_but_those_that_stand_does_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unsafe(self: SafetyMonitor, wanted: object, *known: object) -> object:
        return wanted

    monkeypatch.setattr(SafetyMonitor, "safe_velocity", unsafe)
    harm = Counter[str]()
    for name in ("Chase", "Spiral", "Crush", "HeadOn", "Oscillate", "Mixed"):
        generate = partial(hostile.scenario, BASE, steps=150, controller=name)
        rows = Campaign(generate, tmp_path / name, twice_every=0).fly(range(3))
        harm[name] = sum(row.get("failure") == "I1" for row in rows.values())
    assert min(harm.values()) > 0, harm


def test_the_command_prints_a_row_for_each_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["it", "--count", "2", "--steps", "40", "--out", str(tmp_path), "--controller", "Still"]
    monkeypatch.setattr("sys.argv", words)
    assert hostile.main() == 0
    out = capsys.readouterr().out
    assert "| kinematic, proximity | 1 | 0 |" in out
    assert "| Still | 2 | 0 |" in out


def test_hostile_scenarios_name_the_controller_of_their_case() -> None:
    for number in (3, 50):
        found = parse(hostile.scenario(BASE, number).text)
        assert found.control.controller.endswith(f":{case_of(number).controller}")
        assert found.vehicle.kind == case_of(number).kind
        assert found.vehicle.sensors == case_of(number).sensors
    assert len(CONTROLLERS) == len(HOSTILES) + 1
