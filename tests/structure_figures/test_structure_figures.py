"""The figures of a row are right where they are known, and every row is a scenario."""

import json
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from tests.small_scenario import SMALL
from tests.structure_figures import __main__ as the_command
from tests.structure_figures.bound import arrival_bound_s, bottleneck
from tests.structure_figures.flights import measured
from tests.structure_figures.rows import ROWS, scenario_of
from tests.structure_figures.table import has_failed, lines, spread
from worldsim.scenario.file import parse


@pytest.mark.parametrize("seed", range(20))
def test_the_bottleneck_is_that_of_the_best_of_all_assignments(seed: int) -> None:
    costs = np.random.default_rng(seed).integers(0, 30, (4, 4 + seed % 3)).astype(float)
    best = min(
        max(costs[row, column] for row, column in enumerate(columns))
        for columns in permutations(range(costs.shape[1]), len(costs))
    )
    assert bottleneck(costs) == best


def test_the_bound_is_the_last_arrival_at_the_edge_of_a_slot() -> None:
    slots = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    positions = np.array([[9.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    assert arrival_bound_s(positions, slots, np.array([0.5, 0.5])) == pytest.approx(3.88 / 0.5)
    assert arrival_bound_s(positions, slots, np.array([0.1, 4.0])) == pytest.approx(0.88 / 0.1)
    assert bottleneck(np.empty((0, 3))) == 0.0


EVENTS = """
[[event]]
at_s = 8.0
leave = ["vertex:V1"]
[[event]]
at_s = 16.0
for_s = 2.0
partition = [[1]]
"""


def test_a_flight_is_measured_stage_by_stage() -> None:
    row = measured(parse(SMALL + EVENTS, overrides={"duration_s": "90.0", "seed": "1"}))
    form, left, parted, healed = row["stages"]
    assert [each["stage"] for each in row["stages"]] == ["form", "leave", "parted", "heal"]
    assert form["bound_s"] == pytest.approx(0.18 / 0.5)
    assert form["bound_s"] <= form["converge_s"] < 4.0
    assert (form["changes_mean"], form["changes_after"], form["quiet_s"]) == (
        0.0,
        0,
        pytest.approx(8.0 - form["converge_s"]),
    )
    assert left["bound_s"] == pytest.approx(0.88 / 0.5, abs=0.3)
    assert left["bound_s"] <= left["converge_s"] < 8.0
    assert (left["changes_mean"], left["changes_most"]) == (1.0, 1)
    assert (parted["forms"], healed["converge_s"], healed["quiet_s"]) == (False, 0.0, 60.0)
    assert row["simulated_s"] == pytest.approx(18.0 + 60.0, abs=0.1)
    assert min(row["bytes_per_s"].values()) > 50.0
    assert not has_failed(row)


def test_a_team_that_is_late_or_restless_has_failed() -> None:
    stage = {"forms": True, "converge_s": 5.0, "changes_after": 0}
    assert not has_failed({"broken": {}, "stages": [stage]})
    for change in ({"converge_s": None}, {"changes_after": 1}):
        assert has_failed({"broken": {}, "stages": [stage, stage | change]})
    assert not has_failed({"broken": {}, "stages": [stage | {"forms": False, "converge_s": None}]})
    assert has_failed({"broken": {"I2": 3}, "stages": [stage]})
    assert has_failed({"seed": 1, "failure": "hang", "detail": "no answer in 5 s"})


def test_the_90th_percentile_is_one_of_the_times() -> None:
    assert spread([float(k) for k in range(1, 11)]) == "5.5/9.0/10.0"
    assert (spread([]), spread([7.0])) == ("-", "7.0/7.0/7.0")


def test_a_flight_that_did_not_end_is_told_by_its_seed() -> None:
    told = lines("some-row", [{"seed": 4, "failure": "hang", "detail": "no answer in 5 s"}])
    assert told[0].split() == ["some-row", "-;", "4"]
    assert told[1].strip() == "seed 4: no answer in 5 s"


@pytest.mark.parametrize("name", ROWS)
def test_every_row_is_a_scenario(name: str) -> None:
    scenario = scenario_of(ROWS[name]._replace(by_sides=False), 3, {"comms.local_hz": "10"})
    assert (scenario.seed, scenario.comms.local_hz) == (3, 10.0)
    assert scenario.duration_s > 60.0


def test_a_row_by_sides_parts_the_team_where_it_stands() -> None:
    parted = scenario_of(ROWS["partition-sides-30s-clean"], 0, {})
    ((group,),) = (each.partition for each in parted.event)
    assert 0 < len(group) < 9
    at_random = scenario_of(ROWS["partition-random-30s-clean"], 0, {}).event[0].partition[0]
    assert group != at_random


def test_the_command_prints_a_row_keeps_it_and_shows_it_beside(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    file = tmp_path / "now.json"
    monkeypatch.setitem(ROWS, "small", ROWS["wedge-9-clean-6m"]._replace(text=lambda _: SMALL))
    arguments = ["figures", "small", "--seeds", "0:2", "--set", "duration_s=20.0"]
    monkeypatch.setattr("sys.argv", [*arguments, "--out", str(file)])
    assert the_command.main() == 0
    header, row = capsys.readouterr().out.splitlines()
    assert header.startswith("row ")
    assert row.split()[:3] == ["small", "form", "2/2"]
    assert [each["seed"] for each in json.loads(file.read_text())["rows"]["small"]] == [0, 1]
    monkeypatch.setattr("sys.argv", [*arguments, "--beside", str(file)])
    assert the_command.main() == 0
    again = capsys.readouterr().out.splitlines()
    assert [each.split()[0] for each in again] == ["row", "small", "now"]
    for wrong in (["nope"], ["small", "--set", "nope=1"], ["small", "--out", str(file)]):
        monkeypatch.setattr("sys.argv", ["figures", *wrong])
        assert the_command.main() == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
