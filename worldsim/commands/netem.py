"""The command about the radio: ``netem check SCENARIO``, and ``netem RUN`` for a running fleet."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from worldsim.commands.operate import EventName, ForSeconds, change_radio
from worldsim.commands.options import Seed, Settings, examples, overrides_of
from worldsim.results.exit_status import FAIL, PASS

PICTURES = (".png", ".svg", ".pdf")

commands = typer.Typer()


@commands.command(
    epilog=examples(
        "qswarm netem check bursty-9",
        "qswarm netem check my.toml --set netem.loss_percent=50 --plot radio.png",
        "qswarm netem runs/mine set loss_percent=50 multihop.delay_ms=200 --for 10",
        "qswarm netem runs/mine partition 0,1/2,3",
        "qswarm netem runs/mine partition groups=[[0,1]] kind=one_way --for 5",
        "qswarm netem runs/mine jam centre_m=[0,0,0] radius_m=2",
        "qswarm netem runs/mine sabotage kind=spoof agents=[2] --for 5",
        "qswarm netem runs/mine show",
        "qswarm netem runs/mine end jam-2",
    )
)
def netem(
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="check SCENARIO | RUN ACTION [KEY=VALUE]",
            help="ACTION: show, set, partition, heal, jam, flap, sabotage or end.",
        ),
    ],
    seed: Seed = None,
    settings: Settings = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Picture that check draws (png, svg or pdf).",
            show_default="runs/SCENARIO-netem-TIME.png",
        ),
    ] = None,
    for_s: ForSeconds = None,
    name: EventName = None,
) -> int:
    """Check a scenario's radio, or change a running fleet's radio.

    check sends 100 000 packets over each kind of link, compares what was configured with what was
    measured, and draws a picture.
    """
    more = {"for_s": for_s, "name": name}
    match words:
        case ["check", *scenarios]:
            scenario = _one_scenario(scenarios)
            for option, value in (("--for", for_s), ("--name", name)):
                if value is not None:
                    raise typer.BadParameter("check changes nothing; omit it", param_hint=option)
            return _check(scenario, overrides_of(settings, None, seed, None), plot)
        case [run, action, *rest]:
            return change_radio(Path(run), action, rest, more)
    raise typer.BadParameter(
        f"{' '.join(words)!r}; write check SCENARIO, or RUN ACTION", param_hint="netem"
    )


def _one_scenario(scenarios: list[str]) -> str:
    if len(scenarios) != 1:
        detail = f"got {len(scenarios)} scenarios; check takes one"
        raise typer.BadParameter(detail, param_hint="SCENARIO")
    return scenarios[0]


def _check(given: str, overrides: dict[str, str], plot: Path | None) -> int:
    from worldsim.link_check.report import report
    from worldsim.scenario.file import load
    from worldsim.scenario.library import find_scenario
    from worldsim.scenario.toml import ScenarioError

    scenario = load(find_scenario(given), overrides)
    if plot is not None and plot.suffix not in PICTURES:
        detail = f"'{plot}'; must end in {', '.join(PICTURES)}"
        raise typer.BadParameter(detail, param_hint="--plot")
    picture = plot or Path("runs") / f"{scenario.name}-netem-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.png"
    if picture.exists():
        raise ScenarioError(picture, "", "exists; nothing is overwritten")
    try:
        all_ok = report(scenario, picture)
    except BrokenPipeError:  # of the output, not of the picture
        raise
    except OSError as error:
        raise ScenarioError(picture, "", f"cannot be written: {error.strerror}") from error
    result = "ok: all within" if all_ok else "OUTSIDE: not all within"
    print(f"\n{result} tolerance; drawn in {picture}")
    return PASS if all_ok else FAIL
