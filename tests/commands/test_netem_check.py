"""netem check: each link's figures are printed and drawn."""

from pathlib import Path

from tests.commands.conftest import Command


def test_every_link_is_printed_and_drawn(small: Path, qswarm: Command) -> None:
    printed = qswarm(
        "netem", "check", "small.toml", "--set", "netem.loss_percent=20", "--plot", "p.png"
    )
    assert (printed.status, printed.err) == (0, "")
    assert "  ok       loss [%]   " in printed.out
    assert "OUTSIDE: " in printed.out
    assert printed.out.endswith("\nok: all within tolerance; drawn in p.png\n")
    assert (small.parent / "p.png").read_bytes().startswith(b"\x89PNG")


def test_no_picture_is_overwritten(small: Path, qswarm: Command) -> None:
    (small.parent / "p.png").write_text("mine")
    printed = qswarm("netem", "check", "small.toml", "--plot", "p.png")
    assert (printed.status, printed.err) == (2, "p.png: exists; nothing is overwritten\n")
    assert (small.parent / "p.png").read_text() == "mine"


def test_bad_input_is_one_line(small: Path, qswarm: Command) -> None:
    printed = qswarm("netem", "check", "small.toml", "--set", "netem.distribution=gamma")
    assert (printed.status, printed.out, printed.err.count("\n")) == (2, "", 1)
    assert "netem.distribution" in printed.err
    assert qswarm("netem", "chekc", "small.toml").status == 2
