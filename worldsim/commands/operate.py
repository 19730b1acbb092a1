"""The commands to a running fleet: ``mission`` and ``fault``, and what ``netem RUN`` does.

A running fleet is found by its run directory. Its world carries out the request and answers with
the events that followed.
"""

from collections import Counter
from collections.abc import Mapping
from itertools import starmap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from worldsim.commands.options import RunFolder, examples
from worldsim.results.exit_status import PASS

if TYPE_CHECKING:
    from worldsim.fleet.active_fault import ActiveFault

AGENT_FAULTS = ("clock", "pose", "slow", "starve", "intruder")
FAULTS = (
    *("kill", "leave", "restart", "pause", "resume", "join"),
    *AGENT_FAULTS,
    "disk_full",
    "end",
)
RADIO_ACTIONS = ("show", "set", "partition", "heal", "jam", "flap", "sabotage", "end")
ForSeconds = Annotated[
    float | None, typer.Option("--for", metavar="S", help="Undo it after S simulated seconds.")
]
EverySeconds = Annotated[
    float | None,
    typer.Option("--every", metavar="S", help="Do it again every S seconds, until it is ended."),
]
EventName = Annotated[
    str | None,
    typer.Option(
        "--name", metavar="NAME", help="Name by which it can be ended.", show_default="KIND-NUMBER"
    ),
]

EventKeys = Mapping[str, float | str | None]
NO_KEYS: EventKeys = {}
_OPTIONS = {"for_s": "--for", "name": "--name"}
"""Keys of an event that are options of a command."""
_NEEDED = {"join": "say how many agents join", "end": "name the fault to end"}
"""What is missing where no word follows an action; agents after the others."""

commands = typer.Typer()


@commands.command(
    epilog=examples(
        "qswarm mission runs/mine three-horizontal-lines --to 4",
        "qswarm mission runs/mine my-formation.toml",
        "qswarm mission runs/mine --frame yaw_deg=90",
        "qswarm mission runs/mine --frame waypoints_m=[[0,0,0],[9,0,0]] --frame speed_mps=0.2",
    )
)
def mission(
    run: RunFolder,
    formation: Annotated[
        str | None,
        typer.Argument(
            metavar="FORMATION", help="A formation file (TOML), or a formation of the library."
        ),
    ] = None,
    to: Annotated[
        int | None,
        typer.Option(
            metavar="I", help="Agent that receives the mission.", show_default="lowest id"
        ),
    ] = None,
    frame: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUE", help="Change a key of the target frame, as in [frame]; repeatable."
        ),
    ] = None,
    version: Annotated[
        int | None,
        typer.Option(metavar="N", help="Version of the mission.", show_default="the next one"),
    ] = None,
) -> int:
    """Give a running fleet a new formation or target frame.

    One agent receives the mission; it spreads to the others by radio.
    """
    if (formation is None) == (not frame):
        raise typer.BadParameter(
            "give either a formation or --frame, exactly one of them", param_hint="mission"
        )
    event = {"frame": _table(frame or [])} if formation is None else _formation(formation)
    return _request(run, event, to=to, version=version)


@commands.command(
    epilog=examples(
        "qswarm fault runs/mine kill 2 vertex:V1 --for 5",
        "qswarm fault runs/mine pause random:2",
        "qswarm fault runs/mine join 2",
        "qswarm fault runs/mine kill random:1 --for 2 --every 10 --name outage",
        "qswarm fault runs/mine clock 3 offset_s=3 --for 10",
        "qswarm fault runs/mine pose 3 bias_m=[0.5,0,0] --for 10",
        "qswarm fault runs/mine intruder 2 per_s=10000 --for 5",
        "qswarm fault runs/mine end outage",
    )
)
def fault(
    run: RunFolder,
    action: Annotated[
        str, typer.Argument(metavar="ACTION", help="One of: " + ", ".join(FAULTS) + ".")
    ],
    selectors: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SELECTOR",
            help="Agents: ids, vertex:V1, queue:Q1, random:2 or all."
            " With kill or pause: netem or world too, alone; with restart or resume: netem."
            " With join: how many."
            f" With end: a fault's name. With {', '.join(AGENT_FAULTS)}: KEY=VALUE too."
            " With disk_full: none.",
            show_default=False,
        ),
    ] = None,
    for_s: ForSeconds = None,
    every_s: EverySeconds = None,
    name: EventName = None,
) -> int:
    """Inject a fault of processes or agents into a running fleet.

    kill ends processes, leave removes the vehicles too, restart brings them back; pause stops
    processes until resume; join adds new agents. clock lets agents' clocks be wrong (offset_s,
    drift_ppm). pose lets agents measure their poses wrong (bias_m, noise_m, bias_yaw_deg).
    slow lets each step of agents take delay_s. starve lets processes run for cpu_percent of each
    period_s only. intruder lets a process attack the router (per_s), with the passwords of agents
    or without any.
    disk_full lets nothing more of recording and events be written, at once. end ends a fault of
    any kind before its time, by its name: its kind and number, as in "kill-2", unless --name gave
    it another one.
    """
    if action in RADIO_ACTIONS and action not in FAULTS:
        raise _bad(action, "ACTION", f"it is of the radio; write qswarm netem {run} {action}")
    if action not in FAULTS:
        raise _bad(action, "ACTION", f"allowed: {', '.join(FAULTS)}")
    event = _fault(action, selectors or [])
    return _request(run, event, {"for_s": for_s, "every_s": every_s, "name": name})


def _fault(action: str, words: list[str]) -> dict[str, Any]:
    """Return the event of a fault, from the words after it."""
    if action == "disk_full":
        if words not in ([], ["now"]):
            detail = "disk_full strikes no agents; write it alone: it begins at once"
            raise _bad(" ".join(words), "SELECTOR", detail)
        return {"disk_full": True}
    if not words and action != "intruder":
        raise typer.BadParameter(_NEEDED.get(action, "name agents, or all"), param_hint="SELECTOR")
    match action:
        case "join":
            return {"join": _number(" ".join(words), "SELECTOR")}
        case "end":
            return _end(words)
        case _ if action in AGENT_FAULTS:
            keys = [word for word in words if "=" in word]
            agents = [word for word in words if "=" not in word]
            return {action: {"agents": _selectors(agents), **_table(keys)}}
    return {action: _selectors(words)}


def change_radio(run: Path, action: str, words: list[str], more: EventKeys) -> int:
    """Change the radio of a running fleet, or print its state; return the exit status.

    more: keys of the event besides its action; None for one that is not given.
    """
    if action in {"show", "heal"} and words:
        raise _bad(" ".join(words), "KEY=VALUE", f"{action} takes no further words")
    given = [f"--{key.removesuffix('_s')}" for key, value in more.items() if value is not None]
    if action == "show" and given:
        raise typer.BadParameter("show changes nothing; omit it", param_hint=given[0])
    match action:
        case "show":
            return _print_radio(run)
        case "set":
            event: dict[str, Any] = {"netem": _table(words)}
        case "heal":
            event = {"heal": True}
        case "end":
            event = _end(words)
        case "partition" if not any("=" in word for word in words):
            event = {"partition": _groups(words)}
        case "partition" | "jam" | "flap" | "sabotage":
            event = {action: _table(words)}
        case _:
            raise _not_of_radio(run, action)
    return _request(run, event, more)


def _not_of_radio(run: Path, action: str) -> typer.BadParameter:
    detail = f"allowed: {', '.join(RADIO_ACTIONS)}"
    if action in FAULTS:
        detail = f"it is not of the radio; write qswarm fault {run} {action}"
    return _bad(action, "ACTION", detail)


def _selectors(words: list[str]) -> list[int | str]:
    return [int(each) if each.isdecimal() else each for each in words]


def _end(words: list[str]) -> dict[str, Any]:
    if len(words) != 1:
        raise _bad(" ".join(words), "NAME", "end takes the name of one fault")
    return {"end": words[0]}


def _request(
    run: Path,
    event: dict[str, Any],
    more: EventKeys = NO_KEYS,
    **terms: Any,
) -> int:
    """Request an event from a run's world, and print the events that followed."""
    from worldsim.fleet.control import Request
    from worldsim.fleet.operator_client import ask
    from worldsim.judge.event_text import sentence

    event = event | {key: value for key, value in more.items() if value is not None}
    answer = ask(run, Request(event, **terms))
    for followed in answer.events:
        print(f"{followed.t_s:.2f} s: {sentence(followed)}")
    if "end" in event and not answer.events:
        print(f"{answer.t_s:.2f} s: {event['end']} ends; there is nothing to undo now")
    if answer.name is not None and "name" not in event:
        print(f"its name, to end it early: {answer.name}")
    return PASS


def _print_radio(run: Path) -> int:
    """Print a fleet's state as TOML: the keys of [netem], and a [[fault]] for each in force."""
    import msgspec

    from worldsim.fleet.control import Request
    from worldsim.fleet.operator_client import ask
    from worldsim.scenario.file import as_toml

    answer = ask(run, Request())
    counts = Counter(each.kind for each in answer.faults if each.kind != "partition")
    parted = any(each.kind == "partition" for each in answer.faults)
    told = ["partitioned" if parted else "not partitioned", *starmap(_counted, counts.items())]
    print(f"# at {answer.t_s:.2f} s: {', '.join(told)}")
    changes = [each.name for each in answer.faults if each.fault.netem is not None]
    if changes:
        print(f"# [netem] as changed by {', '.join(changes)}")
    tables = msgspec.to_builtins(answer.conditions)
    conditions = {key: value for key, value in tables.items() if value != {}}
    print(as_toml({"netem": conditions, "fault": [*map(_shown, answer.faults)]}), end="")
    return PASS


def _shown(active: "ActiveFault") -> dict[str, Any]:
    """Return a fault in force as a table: what it is, whom it strikes, when, and its values."""
    import msgspec

    keys = ("name", "kind", "since_s", "until_s", "agents", "process")
    table = {key: getattr(active, key) for key in keys}
    of_radio = msgspec.to_builtins(active.fault).get(active.kind, {})
    for key, value in {**of_radio, **active.values}.items():
        # Of a partition, a sabotage and a sensor fault, a value is called kind too.
        table[f"{active.kind}_kind" if key == "kind" else key] = value
    return table


def _counted(kind: str, count: int) -> str:
    return f"{count} {kind}{'s' if count > 1 else ''}"


def _formation(given: str) -> dict[str, Any]:
    from worldsim.scenario.file import formation_tables
    from worldsim.scenario.library import find_formation

    return {"formation": formation_tables(find_formation(given))}


def _table(settings: list[str]) -> dict[str, Any]:
    """Return KEY=VALUE... as a table; a dotted key names a key of an inner table."""
    from worldsim.commands.options import overrides_of
    from worldsim.scenario.toml import override

    given: list[str] = []
    for setting in settings:
        key, equals, _ = (part.strip() for part in setting.partition("="))
        if not equals or not key:
            raise _bad(setting, "KEY=VALUE", "write it as KEY=VALUE")
        if key in _OPTIONS:
            raise _bad(setting, "KEY=VALUE", f"it is an option; write {_OPTIONS[key]} VALUE")
        for before in given:
            if f"{key}.".startswith(f"{before}.") or f"{before}.".startswith(f"{key}."):
                raise _bad(setting, "KEY=VALUE", f"{before} is given before")
        given.append(key)
    table: dict[str, Any] = {}
    override(table, overrides_of(settings, None, None, None), "KEY=VALUE")
    return table


def _groups(words: list[str]) -> list[list[int]]:
    """Return the groups of a partition written as 0,1/2,3."""
    if not words:
        raise typer.BadParameter("write groups, e.g. 0,1/2,3", param_hint="partition")
    groups = "".join(words).split("/")
    return [[_number(each, "partition") for each in group.split(",")] for group in groups]


def _number(text: str, hint: str) -> int:
    if not text.strip().isdecimal():
        raise _bad(text, hint, "a whole number from 0 is needed")
    return int(text)


def _bad(given: str, hint: str, detail: str) -> typer.BadParameter:
    return typer.BadParameter(f"{given!r}; {detail}", param_hint=hint)
