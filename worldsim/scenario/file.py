"""Scenario files: TOML in, a typed and checked scenario out, or an error with file and key.

``tables`` defines the format, ``rules`` the rules between keys. A path is relative to the file
that contains it. Where a formation's file is named, a name of the library is allowed too.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import tomli_w

from agent.controller import COMMAND
from agent.qstructure.formation import FormationError, FormationSpec, formation_of
from agent.qstructure.mission_check import MissionError, check_mission
from worldsim.scenario.decoding import decode
from worldsim.scenario.event_checks import FormationSource, check_timeline
from worldsim.scenario.library import formation_from
from worldsim.scenario.obstacle_tables import MAX_OBSTACLES, resolve_field
from worldsim.scenario.rules import check_rules, tilt_problem
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import path_of
from worldsim.scenario.toml import Data, ScenarioError, override, read, tables

_PLAIN_ARRAY = re.compile(r"\[\n((?: +[^\s\[\]{}][^\n]*,\n)+) *\]")


def load(path: Path, overrides: Mapping[str, str] | None = None) -> Scenario:
    """Return a file's scenario, with the values of dotted keys overridden. Raises ScenarioError."""
    return parse(read(path), path, overrides)


def parse(
    text: str, name: str | Path = "scenario.toml", overrides: Mapping[str, str] | None = None
) -> Scenario:
    """Return the scenario of a TOML text. Raises ScenarioError.

    name: the text's name in errors; paths in the text are relative to its folder.
    """
    overrides = overrides or {}
    try:
        data = tables(text, name)
        override(data, overrides, name)
        _name_command(data)
        source = _place_formation(data, Path(name))
        later = _place_events(data, Path(name))
        scenario = _with_field(decode(data, Scenario, name), name)
        check_rules(scenario, name)
        _check_formation(scenario, Path(name), *source)
        check_timeline(scenario, Path(name), later)
    except ScenarioError as error:
        raise _marked_as_override(error, overrides) from error
    return scenario


def dump(scenario: Scenario) -> str:
    """Return a scenario as TOML with every default; ``parse`` of it returns an equal scenario."""
    return as_toml(msgspec.to_builtins(scenario))


def as_toml(plain: Data) -> str:
    """Return plain tables as readable TOML; keys that are None are omitted."""
    return _PLAIN_ARRAY.sub(_on_one_line, tomli_w.dumps(_without_none(plain)))


def formation_tables(path: Path) -> Data:
    """Return the checked tables of a formation file. Raises ScenarioError."""
    formation = tables(read(path), path)
    decode(formation, FormationSpec, path)
    return formation


def _name_command(data: Data) -> None:
    """Let a command be the controller, where no other is named."""
    control = data.get("control")
    if isinstance(control, dict) and control.get("command"):
        control.setdefault("controller", COMMAND)


def _place_formation(data: Data, file: Path) -> FormationSource:
    """Put what the formation's file holds in place of its name; return its source."""
    table = data.get("formation")
    if not isinstance(table, dict) or "file" not in table:
        return FormationSource(file, "formation.")
    other = next((key for key in table if key != "file"), None)
    if other is not None:
        raise ScenarioError(file, f"formation.{other}", "cannot be combined with file")
    if not isinstance(table["file"], str):
        raise ScenarioError(
            file, "formation.file", "must be text: a formation file, or a formation of the library"
        )
    path, data["formation"] = _formation_file(file, "formation.file", table["file"])
    return FormationSource(path, "")


def _place_events(data: Data, file: Path) -> dict[int, FormationSource]:
    """Put what formations' files hold in place of their names; return the sources."""
    events = data.get("event")
    sources = {}
    for index, event in enumerate(events if isinstance(events, list) else ()):
        named = event.get("formation") if isinstance(event, dict) else None
        if isinstance(named, str):
            key = f"event[{index}].formation"
            path, event["formation"] = _formation_file(file, key, named)
            sources[index] = FormationSource(path, "")
    return sources


def _formation_file(file: Path, key: str, named: str) -> tuple[Path, Data]:
    """Return the path and the tables of the formation that a key names, by path or library name."""
    try:
        path = formation_from(file.parent, named)
    except FileNotFoundError as error:
        raise ScenarioError(file, key, str(error)) from error
    return path, formation_tables(path)


def _with_field(scenario: Scenario, file: str | Path) -> Scenario:
    """Return a scenario with its random field of obstacles, if any, drawn."""
    field = scenario.obstacle_field
    if field is None:
        return scenario
    drawn, problem = resolve_field(field, scenario.fleet.start, scenario.seed)
    if problem is not None:
        key, detail = problem
        raise ScenarioError(file, f"obstacle_field.{key}", detail)
    obstacles = (*scenario.obstacle, *drawn)
    if len(obstacles) > MAX_OBSTACLES:
        detail = f"{len(obstacles)} obstacles with those listed; at most {MAX_OBSTACLES}"
        raise ScenarioError(file, "obstacle_field", detail)
    return msgspec.structs.replace(scenario, obstacle=obstacles, obstacle_field=None)


def _check_formation(scenario: Scenario, file: Path, source: Path, prefix: str) -> None:
    control = scenario.control
    try:
        formation = formation_of(scenario.formation, control.spacing_m)
        formation.check(scenario.fleet.agents, scenario.min_slot_distance_m)
        check_mission(
            formation, path_of(scenario.frame), scenario.rows, scenario.control.allocation
        )
    except FormationError as error:
        raise ScenarioError(source, prefix + error.key, error.detail) from error
    except MissionError as error:
        raise ScenarioError(file, error.key, error.detail) from error
    tilted = tilt_problem(scenario, formation, scenario.fleet.agents)
    if tilted is not None:
        raise ScenarioError(file, *tilted)


def _marked_as_override(error: ScenarioError, overrides: Mapping[str, str]) -> ScenarioError:
    """Return the error with a remark if its key was set on the command line, not in the file."""
    if any(error.key == key or error.key.startswith((f"{key}.", f"{key}[")) for key in overrides):
        return ScenarioError(
            error.file, error.key, f"{error.detail} (it was set on the command line)"
        )
    return error


def _on_one_line(array: re.Match[str]) -> str:
    """Write an array of numbers or names on one line."""
    items = [line.strip(" ") for line in array[1].removesuffix(",\n").split("\n")]
    return f"[{' '.join(items)}]"


def _without_none(value: Any) -> Any:
    """Omit keys that are None: TOML has no null."""
    if isinstance(value, dict):
        return {key: _without_none(inner) for key, inner in value.items() if inner is not None}
    return [_without_none(inner) for inner in value] if isinstance(value, list | tuple) else value
