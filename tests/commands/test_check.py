"""check prints a scenario that is a scenario, and says on stderr what is unwise."""

from pathlib import Path

from tests.commands.conftest import Command
from worldsim.scenario.file import load, parse


def test_it_prints_the_resolved_scenario(small: Path, qswarm: Command) -> None:
    told = qswarm("check", small, "--seed", "7", "--set", "netem.loss_percent=50")
    assert (told.status, told.err) == (0, "")
    resolved = parse(told.out)
    assert resolved == load(small, {"seed": "7", "netem.loss_percent": "50"})
    assert list(small.parent.iterdir()) == [small]


def test_an_option_of_its_own_wins_over_set(small: Path, qswarm: Command) -> None:
    told = qswarm("check", small, "--duration", "9", "--set", "duration_s=3", "--set", "name=b")
    assert parse(told.out).duration_s == 9.0
    assert parse(told.out).name == "b"


def test_what_is_unwise_is_told_in_a_line_each(small: Path, qswarm: Command) -> None:
    told = qswarm(
        "check", small, "--set", "netem.range_m=0.9", "--set", "vehicle.max_speed_mps=1.5"
    )
    assert told.status == 0
    range_line, speed_line = told.err.splitlines()
    assert range_line.startswith(f"{small}: netem.range_m: warning: ")
    assert "only 'sim' can fly this" in speed_line
    assert parse(told.out).netem.range_m == 0.9
