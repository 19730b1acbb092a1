"""Commands to a running fleet: qswarm mission | fault | netem RUN; the last is read elsewhere."""

from pathlib import Path
from typing import Annotated, Any

import typer

from worldsim.commands.options import RunFolder, examples

VERBS = ("kill", "leave", "restart", "pause", "resume", "join")
UNSPOKEN = frozenset({"planned", "by", "tables", "conditions", "path", "number"})
RADIO = ("show", "set", "partition", "heal", "jam", "flap")
ForSeconds = Annotated[
    float | None, typer.Option("--for", metavar="S", help="Undo it after so many seconds.")
]


def attach(app: typer.Typer) -> None:
    """Add these commands to the command line."""
    for command, lines in COMMANDS:
        app.command(epilog=examples(*lines))(command)


def mission(
    run: RunFolder,
    formation: Annotated[
        Path | None, typer.Argument(metavar="[FORMATION]", help="A formation file (TOML).")
    ] = None,
    to: Annotated[
        int | None, typer.Option(metavar="I", help="The agent that it is given to. [the lowest id]")
    ] = None,
    frame: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=VALUE", help="Where the frame goes, keys as in [frame]."),
    ] = None,
    version: Annotated[
        int | None, typer.Option(metavar="N", help="Its version. [the next]")
    ] = None,
) -> int:
    """Give a running team a new formation, or a new frame: to one agent, it spreads by radio."""
    if (formation is None) == (not frame):
        raise typer.BadParameter("a formation file or --frame, one of them", param_hint="mission")
    event = {"frame": _table(frame or [])} if formation is None else _formation(formation)
    return _told(run, event, to=to, version=version)


def fault(
    run: RunFolder,
    verb: Annotated[str, typer.Argument(metavar="VERB", help="One of: " + ", ".join(VERBS))],
    whom: Annotated[
        list[str],
        typer.Argument(metavar="SELECTOR...", help="Ids, vertex:V1, queue:Q1, random:2 or all."),
    ],
    for_s: ForSeconds = None,
) -> int:
    """Hurt a running fleet: processes that die, stop, come back; 'join N' for new ones."""
    if verb not in VERBS:
        raise typer.BadParameter(f"{verb!r}; {', '.join(VERBS)}", param_hint="VERB")
    if verb == "join":
        return _told(run, {"join": _number(" ".join(whom))}, for_s=for_s)
    chosen = [int(each) if each.isdecimal() else each for each in whom]
    return _told(run, {verb: chosen}, for_s=for_s)


def radio(run: Path, verb: str, words: list[str], for_s: float | None) -> int:
    """Change the radio of a running fleet, or show it; return the exit status."""
    if verb in {"show", "heal"} and words:
        raise typer.BadParameter(f"{' '.join(words)!r}; {verb} stands alone", param_hint="WORD")
    match verb:
        case "show":
            return _shown(run)
        case "set":
            event: dict[str, Any] = {"netem": _table(words)}
        case "heal":
            event = {"heal": True}
        case "partition" if not any("=" in word for word in words):
            event = {"partition": _groups(words)}
        case "partition" | "jam" | "flap":
            event = {verb: _table(words)}
        case _:
            raise typer.BadParameter(f"{verb!r}; {', '.join(RADIO)}", param_hint="VERB")
    return _told(run, event, for_s=for_s)


COMMANDS = (
    (
        mission,
        (
            "qswarm mission runs/mine --to 4 deploy/formations/three-horizontal-lines.toml",
            "qswarm mission runs/mine --frame yaw_deg=90",
            "qswarm mission runs/mine --frame waypoints_m=[[0,0,0],[9,0,0]] --frame speed_mps=0.2",
        ),
    ),
    (
        fault,
        (
            "qswarm fault runs/mine kill 2 vertex:V1 --for 5",
            "qswarm fault runs/mine pause random:2",
            "qswarm fault runs/mine join 2",
        ),
    ),
)


def _told(run: Path, event: dict[str, Any], **terms: Any) -> int:
    """Ask for an event, and print what came of it."""
    from worldsim.fleet.control import Request
    from worldsim.fleet.operator_client import ask
    from worldsim.judge.run_events import as_row

    if (for_s := terms.pop("for_s", None)) is not None:
        event = {**event, "for_s": for_s}
    for told in map(as_row, ask(run, Request(event, **terms)).events):
        t_s, kind, agent = told.pop("t_s"), told.pop("kind"), told.pop("agent")
        whose = "" if agent is None else f" agent {agent}"
        rest = ", ".join(f"{k} {v}" for k, v in told.items() if k not in UNSPOKEN)
        print(f"{t_s:.2f} s: {kind}{whose}{': ' if rest else ''}{rest}")
    return 0


def _shown(run: Path) -> int:
    import msgspec

    from worldsim.fleet.control import Request
    from worldsim.fleet.operator_client import ask
    from worldsim.scenario.file import as_toml

    answer = ask(run, Request())
    standing: dict[str, list[dict[str, Any]]] = {}
    for active in answer.faults:
        for kind, keys in msgspec.to_builtins(active.fault).items():
            if kind != "netem":
                standing.setdefault(kind, []).append({"since_s": active.since_s, **keys})
    told = [_counted(kind, len(each)) for kind, each in standing.items() if kind != "partition"]
    parted = "parted" if "partition" in standing else "not parted"
    print(f"# at {answer.t_s:.2f} s, {', '.join([parted, *told])}")
    tables = msgspec.to_builtins(answer.conditions)
    conditions = {key: value for key, value in tables.items() if value != {}}
    print(as_toml({"netem": conditions, **standing}), end="")
    return 0


def _counted(kind: str, count: int) -> str:
    return f"{count} {kind}{'s' if count > 1 else ''}"


def _formation(file: Path) -> dict[str, Any]:
    from worldsim.scenario.file import formation_tables

    return {"formation": formation_tables(file)}


def _table(settings: list[str]) -> dict[str, Any]:
    """Return KEY=VALUE... as a table; dotted keys lead into tables within it."""
    from worldsim.commands.options import overrides_of
    from worldsim.scenario.toml import override

    for setting in settings:
        key, equals, _ = setting.partition("=")
        if not equals or not key.strip():
            raise typer.BadParameter(f"{setting!r}; write it as KEY=VALUE", param_hint="WORD")
    table: dict[str, Any] = {}
    override(table, overrides_of(settings, None, None, None), "KEY=VALUE")
    return table


def _groups(words: list[str]) -> list[list[int]]:
    """Return the groups of a partition written as 0,1/2,3."""
    return [[_number(each) for each in group.split(",")] for group in "".join(words).split("/")]


def _number(text: str) -> int:
    if not text.strip().isdecimal():
        raise typer.BadParameter(f"{text!r}; a number from 0", param_hint="WORD")
    return int(text)
