"""The command about the radio: qswarm netem check SCENARIO, and netem RUN for a running fleet."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from worldsim.commands.operate import ForSeconds, radio
from worldsim.commands.options import Seed, Settings, overrides_of

PICTURES = (".png", ".svg", ".pdf")
Words = Annotated[
    list[str],
    typer.Argument(
        metavar="(check SCENARIO | RUN VERB [WORD]...)",
        help="VERB: show, set, partition, heal, jam or flap; WORD: KEY=VALUE.",
    ),
]
Plot = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Where the picture goes. [runs/SCENARIO-netem-TIME.png]"),
]


def netem(
    words: Words,
    seed: Seed = None,
    settings: Settings = None,
    plot: Plot = None,
    for_s: ForSeconds = None,
) -> int:
    """Try a scenario's radio, or change that of a running fleet.

    check: 100 000 packets a link, configured against measured; a picture.
    """
    match words:
        case ["check", scenario]:
            return _check(Path(scenario), overrides_of(settings, None, seed, None), plot)
        case [run, verb, *rest]:
            return radio(Path(run), verb, rest, for_s)
    raise typer.BadParameter(
        f"{' '.join(words)!r}; check SCENARIO, or RUN and a verb", param_hint="netem"
    )


def _check(file: Path, overrides: dict[str, str], plot: Path | None) -> int:
    from worldsim.link_check.report import report
    from worldsim.scenario.file import load
    from worldsim.scenario.toml import ScenarioError

    scenario = load(file, overrides)
    if plot is not None and plot.suffix not in PICTURES:
        raise typer.BadParameter(f"'{plot}'; it ends in {', '.join(PICTURES)}", param_hint="--plot")
    picture = plot or Path("runs") / f"{scenario.name}-netem-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.png"
    if picture.exists():
        raise ScenarioError(picture, "", "exists; nothing is overwritten")
    try:
        all_ok = report(scenario, picture)
    except OSError as error:
        raise ScenarioError(picture, "", f"cannot be written: {error.strerror}") from error
    result = "ok: all within" if all_ok else "OUTSIDE: not all within"
    print(f"\n{result} tolerance; drawn in {picture}")
    return 0 if all_ok else 1
