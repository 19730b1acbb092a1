"""What commands share: arguments, options, and what is made of them."""

import re
from pathlib import Path
from typing import Annotated

import typer

MAX_RUNS = 1_000_000


def examples(*lines: str) -> str:
    """Return examples as the end of a command's help."""
    return "\n".join(("\b", "Examples:", *(f"  {line}" for line in lines)))


def _print_gallery(wanted: bool) -> None:
    if wanted:
        from worldsim.scenario.library import gallery

        pieces = gallery()
        width = max(len(str(piece.file)) for piece in pieces)
        for piece in pieces:
            print(f"{piece.file!s:{width}}  {piece.shows}")
        raise typer.Exit


def _print_schema(wanted: bool) -> None:
    if wanted:
        import json

        from worldsim.scenario.schema import schema

        print(json.dumps(schema(), indent=2))
        raise typer.Exit


ScenarioFile = Annotated[Path, typer.Argument(metavar="SCENARIO", help="A scenario file (TOML).")]
ScenarioFiles = Annotated[
    list[Path], typer.Argument(metavar="SCENARIO", help="One or more scenario files (TOML).")
]
Gallery = Annotated[
    bool,
    typer.Option(
        "--list",
        is_eager=True,
        callback=_print_gallery,
        help="List the scenarios that come along, and fly none.",
    ),
]
Schema = Annotated[
    bool,
    typer.Option(
        "--schema",
        is_eager=True,
        callback=_print_schema,
        help="Print the JSON Schema of a scenario file, and check none.",
    ),
]
RunFolder = Annotated[Path, typer.Argument(metavar="RUN", help="The folder of a run.")]
Agents = Annotated[int | None, typer.Option(metavar="N", help="Fly this many agents instead.")]
Seed = Annotated[int | None, typer.Option(metavar="S", help="Another seed: starts and radio.")]
Duration = Annotated[
    float | None, typer.Option(metavar="T", help="Simulated seconds to fly instead.")
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Set any key; may be given again."),
]
Lockstep = Annotated[
    bool,
    typer.Option("--lockstep", help="Take turns, slot by slot: the same result on any host."),
]
Shards = Annotated[
    int,
    typer.Option(metavar="N", min=1, max=64, help="Share the radio out to N processes (lockstep)."),
]
Out = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Where to; must not exist. [runs/SCENARIO-TIME]"),
]
NoRecording = Annotated[bool, typer.Option("--no-recording", help="Write no run.rrd.")]


def overrides_of(
    settings: list[str] | None, agents: int | None, seed: int | None, duration: float | None
) -> dict[str, str]:
    """Return the keys to override; an option of its own wins over --set.

    Raises typer.BadParameter for a setting that is not KEY=VALUE.
    """
    overrides = {}
    for setting in settings or []:
        key, equals, value = setting.partition("=")
        if not equals or not key.strip():
            raise typer.BadParameter(
                f"{setting!r}; write it as netem.loss_percent=50", param_hint="--set"
            )
        overrides[key.strip()] = value.strip()
    options = {"fleet.agents": agents, "seed": seed, "duration_s": duration}
    return overrides | {key: str(value) for key, value in options.items() if value is not None}


def check_lockstep(lockstep: bool, speed: float, shards: int) -> None:
    """Raise typer.BadParameter for what goes with lockstep alone, or not with it."""
    if lockstep and speed != 1.0:
        raise typer.BadParameter("not beside --lockstep: it has no speed", param_hint="--speed")
    if shards > 1 and not lockstep:
        raise typer.BadParameter("needs --lockstep", param_hint="--shards")


def seeds_of(text: str) -> range:
    """Return the seeds that a text like 0:20 names, half open. Raises typer.BadParameter."""
    parts = re.fullmatch(r"(\d{1,15}):(\d{1,15})", text)
    seeds = range(int(parts[1]), int(parts[2])) if parts else range(0)
    if not seeds or len(seeds) > MAX_RUNS:
        raise typer.BadParameter(
            f"{text!r}; write first:end, as 0:20 for 0 to 19, at most {MAX_RUNS} seeds",
            param_hint="--seeds",
        )
    return seeds
