"""The benchmark: every row is measured, the best repeat counts, and goals are bounds."""

import json

import pytest

from worldsim.bench import table
from worldsim.bench.fleets import wedge
from worldsim.bench.part_costs import control_step_us, frame_us
from worldsim.bench.recording_cost import recording_mb, recording_us
from worldsim.bench.table import MEASURES, Row, measured
from worldsim.bench.team_growth import agent_cost
from worldsim.commands.app import command


@pytest.fixture
def quick(monkeypatch):
    """Two measures that take no time: each repeat returns the next number."""
    slower, faster = iter([3.0, 1.0, 2.0]), iter([30.0, 60.0, 40.0])
    rows = (
        ("less", "us", 2.0, False, lambda: next(slower)),
        ("more", "x", 70.0, True, lambda: next(faster)),
    )
    monkeypatch.setattr(table, "MEASURES", rows)


def test_the_best_of_the_repeats_counts(quick):
    assert [(row.measured, row.reached) for row in measured(3)] == [(1.0, True), (60.0, False)]


@pytest.mark.parametrize(
    ("more", "reached"), [(True, [False, True, True]), (False, [True, True, False])]
)
def test_a_goal_is_a_bound_on_the_right_side(more, reached):
    assert [Row("x", "us", 2.0, value, more).reached for value in (1.0, 2.0, 3.0)] == reached


def test_a_figure_without_a_goal_is_there_to_be_known():
    assert Row("x", "B", None, 3.0, False).reached


def test_each_part_takes_some_time():
    assert control_step_us(50) > 0.0
    assert frame_us(9) > 0.0
    assert recording_us(9) > 0.0
    assert recording_mb(50) > recording_mb(9) > 1.0
    assert len({name for name, *_ in MEASURES}) == len(MEASURES)


def test_fleets_start_at_one_density():
    for agents in (9, 72):
        x, y, z = wedge(agents, 1.0).fleet.start.size_m
        assert agents / (x * y * z) == pytest.approx(9 / 75, rel=0.05)


def test_what_an_agent_costs_is_of_one_flight_and_counts_each_channel():
    cost = agent_cost(9, 1.5)
    assert agent_cost(9, 1.5) is cost
    assert cost.step_us <= cost.dearest_us <= cost.worst_us
    assert cost.flight_us > cost.step_us > 0.0
    assert 0.0 < cost.heard_by <= 8.0
    assert cost.local_bps == pytest.approx(20.0 * cost.beacon_b)
    assert 50.0 < cost.beacon_b < 1200.0
    assert cost.sent_bps - cost.local_bps == pytest.approx(cost.multihop_bps)
    assert cost.multihop_bps > 0.0


def test_teams_side_by_side_cost_as_much_radio_as_one():
    alone, beside = agent_cost(3, 1.0), agent_cost(3, 1.0, together=7)
    assert beside.sent_bps == pytest.approx(alone.sent_bps, rel=0.1)
    assert 0.0 < beside.heard_by <= 2.0


def test_traffic_is_measured_by_size_and_channel():
    names = {name for name, *_ in MEASURES}
    for agents in (9, 20, 50, 100, 200):
        for figure in ("beacon, encoded", "local channel", "multihop channel"):
            assert f"{figure}, N = {agents}" in names
    assert "agent step, mean, N = 200 against 10" in names


def test_the_command_prints_each_row_and_overwrites_nothing(quick, capsys, tmp_path):
    file = tmp_path / "speed.json"
    assert command(["bench", "--repeats", "3", "--json", str(file)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["less", "more"]
    assert lines[1].endswith("not reached")
    assert [row["measured"] for row in json.loads(file.read_text())["rows"]] == [1.0, 60.0]
    assert command(["bench", "--json", str(file)]) == 2
    assert "speed.json" in capsys.readouterr().err
