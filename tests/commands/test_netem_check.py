"""netem check: a scenario's radio tried out, told line by line, and drawn."""

from pathlib import Path

from tests.commands.conftest import Command


def test_every_link_is_told_and_drawn(small: Path, qswarm: Command) -> None:
    told = qswarm(
        "netem", "check", "small.toml", "--set", "netem.loss_percent=20", "--plot", "p.png"
    )
    assert (told.status, told.err) == (0, "")
    assert "  ok       loss [%]   " in told.out
    assert "OUTSIDE: " in told.out
    assert told.out.endswith("\nok: all within tolerance; drawn in p.png\n")
    assert (small.parent / "p.png").read_bytes().startswith(b"\x89PNG")


def test_no_picture_is_overwritten(small: Path, qswarm: Command) -> None:
    (small.parent / "p.png").write_text("mine")
    told = qswarm("netem", "check", "small.toml", "--plot", "p.png")
    assert (told.status, told.err) == (2, "p.png: exists; nothing is overwritten\n")


def test_bad_input_is_one_line(small: Path, qswarm: Command) -> None:
    told = qswarm("netem", "check", "small.toml", "--set", "netem.distribution=gamma")
    assert (told.status, told.out, told.err.count("\n")) == (2, "", 1)
    assert "netem.distribution" in told.err
    assert qswarm("netem", "chekc", "small.toml").status == 2
