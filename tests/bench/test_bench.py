"""The benchmark: every row is measured, the best repeat counts, and goals are bounds."""

import json
import signal
import sys
from io import StringIO

import pytest

from worldsim.bench import table
from worldsim.bench.fleets import wedge
from worldsim.bench.measures import InvalidFigureError, Measure, Row, chosen, measured_row
from worldsim.bench.part_costs import control_step_us, frame_us
from worldsim.bench.recording_cost import recording_mb, recording_us
from worldsim.bench.table import MEASURES
from worldsim.bench.team_growth import agent_cost
from worldsim.bench.ticking import ticking
from worldsim.commands.app import command
from worldsim.results import progress_line


@pytest.fixture(autouse=True)
def signals():
    """Restore the handlers that a benchmark sets."""
    numbers = (signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.getsignal(number) for number in numbers}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def quick(monkeypatch):
    """Set the figures of two measures that take no time: each call returns the next one."""

    def become(less, more):
        least, most = iter(less), iter(more)
        rows = (
            Measure("less", "us", 2.0, False, lambda: next(least)),
            Measure("more", "x", 70.0, True, lambda: next(most)),
        )
        monkeypatch.setattr(table, "MEASURES", rows)

    become([3.0, 1.0, 2.0], [30.0, 60.0, 40.0])
    return become


def test_the_best_of_the_repeats_counts(quick):
    rows = [measured_row(measure, 3) for measure in table.MEASURES]
    assert [(row.measured, row.reached) for row in rows] == [(1.0, True), (60.0, False)]


def test_a_measurement_that_proves_nothing_has_no_figure():
    def never():
        raise InvalidFigureError("not converged")

    row = measured_row(Measure("x", "us", None, False, never), 3)
    assert (row.measured, row.invalid, row.reached) == (None, "not converged", False)


def test_rows_are_chosen_by_name_in_their_order():
    measures = [Measure(name, "us", None, False, float) for name in ("step, N = 9", "frame", "end")]

    def names(*patterns):
        return [measure.name for measure in chosen(measures, patterns)]

    assert names() == ["step, N = 9", "frame", "end"]
    assert names("end", "STEP*") == ["step, N = 9", "end"]
    assert names("e*", "*e*") == ["step, N = 9", "frame", "end"]
    with pytest.raises(LookupError, match="ste"):
        names("end", "ste")


def test_progress_is_called_while_code_runs_and_not_after_it():
    calls = []
    with ticking(lambda: calls.append(len(calls)), every_s=0.001):
        while len(calls) < 3:
            sum(range(1000))
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGALRM) == signal.SIG_DFL
    assert calls[:3] == [0, 1, 2]


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
    assert [line.split()[0] for line in lines] == ["code:", "less", "more"]
    assert lines[2].endswith("not reached")
    assert [row["measured"] for row in json.loads(file.read_text())["rows"]] == [1.0, 60.0]
    assert command(["bench", "--save", str(file)]) == 2
    assert "speed.json: exists" in capsys.readouterr().err


def test_the_command_compares_with_saved_figures(quick, capsys, tmp_path):
    file = str(tmp_path / "before.json")
    assert command(["bench", "--repeats", "1", "--save", file]) == 0
    quick([3.6], [30.0])
    capsys.readouterr()
    assert command(["bench", "--repeats", "1", "--against", file]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "1.20 x 3  WORSE" in lines[1]
    assert "1.00 x 30 " in lines[2]
    assert lines[3] == f"against {file}: 2 compared, 1 worse by more than 10 %: less"


@pytest.mark.parametrize(("most", "status"), [("19", 1), ("20", 0), ("30", 0)])
def test_a_slowdown_fails_the_command_only_where_asked(quick, capsys, tmp_path, most, status):
    file = str(tmp_path / "before.json")
    quick([3.0], [36.0])
    assert command(["bench", "--repeats", "1", "--save", file]) == 0
    quick([3.0], [30.0])  # 20 % worse, counted on the inverse
    arguments = ["bench", "--repeats", "1", "--against", file, "--fail-over", most]
    assert command(arguments) == status
    lines = capsys.readouterr().out.splitlines()
    assert ("WORSE" in lines[-2]) == bool(status)
    assert lines[-1].endswith(f"{status} worse by more than {most} %{': more' * status}")


def test_a_limit_is_an_error_where_nothing_can_be_compared(quick, capsys, tmp_path, monkeypatch):
    """The one row is new, and the other one was saved in another unit."""
    file = str(tmp_path / "before.json")
    assert command(["bench", "--repeats", "1", "--save", file]) == 0
    less, more = table.MEASURES
    monkeypatch.setattr(table, "MEASURES", (less._replace(name="new"), more._replace(unit="s")))
    capsys.readouterr()
    arguments = ["bench", "--repeats", "1", "--against", file]
    assert command([*arguments, "--fail-over", "5"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert line.startswith(f"{file}: rows: --fail-over has nothing to compare")
    assert command(arguments) == 0


@pytest.mark.parametrize("save", [True, False])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_an_interrupted_benchmark_saves_the_rows_that_it_has(
    monkeypatch, capsys, tmp_path, save, number
):
    def interrupt():
        signal.raise_signal(number)
        return 2.0

    signal.signal(signal.SIGINT, signal.default_int_handler)  # a background shell ignores it
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # where the command sets no handler
    rows = [("first", lambda: 1.0), ("second", interrupt), ("third", lambda: 3.0)]
    measures = tuple(Measure(name, "us", None, False, measure) for name, measure in rows)
    monkeypatch.setattr(table, "MEASURES", measures)
    file = tmp_path / "part.json"
    assert command(["bench", *(["--save", str(file)] * save)]) == 130
    (line,) = capsys.readouterr().err.splitlines()
    if save:
        assert line == f"qswarm: interrupted; 1 of 3 rows are in {file}"
        assert [row["name"] for row in json.loads(file.read_text())["rows"]] == ["first"]
    else:
        assert line == "qswarm: interrupted"
        assert not file.exists()


def test_an_interrupted_benchmark_removes_its_progress_line(monkeypatch):
    class Terminal(StringIO):
        def isatty(self):
            return True

    def interrupt():
        while not terminal.getvalue():
            signal.raise_signal(signal.SIGALRM)
        raise KeyboardInterrupt

    terminal = Terminal()
    monkeypatch.setattr(progress_line, "QUIET_S", 0.0)
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(table, "MEASURES", (Measure("first", "us", None, False, interrupt),))
    assert command(["bench"]) == 130
    shown, end = terminal.getvalue().rsplit("\r\x1b[K", 1)
    assert "1 of 1: first, 0 s" in shown
    assert end == "qswarm: interrupted\n"


def test_a_bad_file_is_named_before_anything_is_measured(capsys, tmp_path):
    file = tmp_path / "old.json"
    file.write_text('{"rows": []}')
    assert command(["bench", "--against", str(file)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err == (
        f"{file}: format: is missing; 'qswarm-bench' of qswarm bench --save is needed\n"
    )


def test_long_measurements_are_shown_on_stderr(quick, capsys, monkeypatch):
    from worldsim.results import progress_line  # noqa: PLC0415 - as the command does

    monkeypatch.setattr(progress_line, "QUIET_S", 0.0)
    shown = []

    def until_shown():
        while not shown:
            shown.extend(line for line in sys.stderr.getvalue().splitlines() if line)
        return 1.0

    rows = (Measure("slow", "us", None, False, until_shown),)
    monkeypatch.setattr(table, "MEASURES", rows)
    assert command(["bench", "--repeats", "1"]) == 0
    assert shown == ["1 of 1: slow, 1 s"]
