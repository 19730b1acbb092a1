"""check prints a scenario that can be parsed again, and warns on stderr."""

from pathlib import Path

from tests.commands.conftest import Command
from worldsim.scenario.file import load, parse


def test_check_prints_the_resolved_scenario(small: Path, qswarm: Command) -> None:
    printed = qswarm("check", small, "--seed", "7", "--set", "netem.loss_percent=50")
    assert (printed.status, printed.err) == (0, "")
    resolved = parse(printed.out)
    assert resolved == load(small, {"seed": "7", "netem.loss_percent": "50"})
    assert list(small.parent.iterdir()) == [small]


def test_an_option_wins_over_set(small: Path, qswarm: Command) -> None:
    printed = qswarm("check", small, "--duration", "9", "--set", "duration_s=3", "--set", "name=b")
    assert parse(printed.out).duration_s == 9.0
    assert parse(printed.out).name == "b"


def test_each_warning_is_one_line(small: Path, qswarm: Command) -> None:
    printed = qswarm(
        "check", small, "--set", "netem.range_m=0.9", "--set", "vehicle.max_speed_mps=1.5"
    )
    assert printed.status == 0
    range_line, start_line, speed_line = printed.err.splitlines()
    assert range_line.startswith(f"{small}: netem.range_m: warning: ")
    assert start_line.startswith(f"{small}: fleet.start: warning: 2 groups of agents")
    assert "'qswarm run' rejects this" in speed_line
    assert parse(printed.out).netem.range_m == 0.9
