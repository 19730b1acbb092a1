"""A scenario to start from: every table and key with its allowed values, generated from the types.

Keys that the example sets are active. Every other key is commented out by a ``#`` without a space,
with its default value, or an example where it has no default. Prose begins with ``# ``.
"""

import json
from collections.abc import Iterator, Mapping
from inspect import cleandoc
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from msgspec import NODEFAULT, inspect

from agent.config import Control
from worldsim.scenario.allowed_values import allowed_by
from worldsim.scenario.decoding import decode
from worldsim.scenario.events import Name
from worldsim.scenario.tables import Scenario
from worldsim.scenario.toml import ScenarioError

COLUMN = 34
Given = Mapping[str, Any]

EXAMPLE: Given = {
    "schema": 1,
    "seed": 1,
    "duration_s": 20.0,
    "fleet": {
        "agents": 5,
        "start": {"kind": "box", "size_m": [4.0, 4.0, 2.0], "spacing_m": 0.6},
    },
    "formation": {
        "name": "arrow",
        "vertices": {"V1": [0.0, 0.0, 0.0]},
        "queue": [
            {"name": "left", "vertices": ["V1"], "shape": {"kind": "ray", "direction": [-1, 1, 0]}},
            {
                "name": "right",
                "vertices": ["V1"],
                "shape": {"kind": "ray", "direction": [-1, -1, 0]},
            },
        ],
    },
    "netem": {"range_m": 6.0},
    "expect": {"converge_within_s": 12.0},
}
EXAMPLES: Given = {
    "agent.ids": [0],
    "agent.vehicle.max_speed_mps": 0.3,
    "control.cast_far_m": 0.5,
    "event.at_s": 10.0,
    "event.kill": [4],
    "expect.reform_within_s": 10.0,
    "expect.in_formation_fraction": 0.95,
    "expect.max_slot_error_m": 0.12,
    "expect.min_lambda2": 0.5,
    "expect.min_separation_m": 0.25,
    "expect.min_obstacle_distance_m": 0.4,
    "expect.attitude_within_deg": 10.0,
    "expect.property.name": "all fly slowly at last",
    "expect.property.figure": "speed_mps",
    "expect.property.at_most": 0.45,
    "expect.property.must": "eventually",
    "event.frame.yaw_deg": 90.0,
    "formation.queue.capacity": 0.5,
    "formation.queue.orientation.yaw_deg": "10*d",
    "netem.delay_ms": 20.0,
    "netem.jitter_ms": 5.0,
    "netem.delay_correlation_percent": 25.0,
    "netem.distribution": "normal",
    "netem.loss_percent": 10.0,
    "netem.duplicate_percent": 1.0,
    "netem.corrupt_percent": 1.0,
    "netem.reorder_percent": 1.0,
    "netem.rate_kbit": 1000.0,
    "netem.rate_overhead_b": 50,
    "netem.limit": 100,
    "netem.gemodel.p_percent": 2.0,
    "netem.gemodel.r_percent": 25.0,
    "netem.path_loss.exponent": 3.0,
    "netem.path_loss.reference_loss_db": 40.0,
    "netem.path_loss.budget_db": 65.0,
    "netem.local.loss_percent": 10.0,
    "netem.multihop.loss_percent": 20.0,
    "netem.link.from": 0,
    "netem.link.to": 1,
    "netem.link.loss_percent": 90.0,
    "obstacle": [{"shape": "sphere", "centre_m": [9, 0, 0], "radius_m": 0.5}],
    "obstacle_field.centre_m": [9.0, 9.0, 0.0],
    "obstacle_field.size_m": [6.0, 6.0, 2.0],
    "obstacle_field.count": 3,
    "vehicle.max_turn_left_deg": 45.0,
    "vehicle.max_turn_right_deg": 45.0,
}
OF_OWN_CONTROLLERS = ("command", "parameters", "services", "safety_filter")
"""Keys of [control] that serve controllers of one's own; see docs/controllers.md."""
BRIEF: Mapping[str, tuple[str, ...]] = {
    "agent": ("ids", "vehicle"),  # a command needs a program; see docs/wire.md
    "agent.vehicle": ("max_speed_mps",),
    "control": tuple(key for key in Control.__struct_fields__ if key not in OF_OWN_CONTROLLERS),
    "event": ("at_s", "kill"),
    "expect.property": ("name", "figure", "at_most", "must"),
    "formation.queue.orientation": ("yaw_deg",),
    "frame": ("waypoints_m", "start_s", "pauses_s", "yaw", "yaw_deg", "turn_dps"),
    "netem.local": ("loss_percent",),
    "netem.multihop": ("loss_percent",),
    "netem.link": ("from", "to", "loss_percent"),
    "obstacle_field": (
        "centre_m",
        "size_m",
        "count",
        "shape",
        "radius_m",
        "corridor_m",
        "clear_of_start_m",
    ),
}
"""Of these tables, only some keys are shown, as an example."""

HEAD = """\
# {name}: what this scenario is for, in one line.
#
#     qswarm check {name}.toml     validate it, and print it with all defaults
#     qswarm sim {name}.toml       run it in virtual time
#     qswarm run {name}.toml       run it with real processes
#
# The unit of a number is in its key. To set a key that is commented out, remove its '#'. Its value
# here is the default, or an example where there is no default."""


class Place(NamedTuple):
    """A table in the template."""

    name: str  # dotted
    given: Given | None  # the keys that the example sets; None: the example has no such table
    brackets: str = "[{}]"  # of its header

    @property
    def comment(self) -> str:
        """The comment sign before the header of a table that the example does not have."""
        return "#" if self.given is None else ""

    def key(self, name: str) -> str:
        """Return the dotted name of a key of the table."""
        return f"{self.name}.{name}" if self.name else name


def write(name: str) -> Path:
    """Write the template as NAME.toml in the current folder; return the file.

    name: with or without .toml. Raises ScenarioError for an invalid name, an existing file, or a
    failing disk.
    """
    name = name.removesuffix(".toml")
    file = Path(f"{name}.toml")
    decode(name, Name, file)
    try:
        with file.open("x", encoding="utf-8") as out:
            out.write(template(name))
    except FileExistsError:
        raise ScenarioError(file, "", "exists; nothing is overwritten") from None
    except OSError as error:
        raise ScenarioError(file, "", f"cannot be written: {error.strerror}") from error
    return file


def template(name: str) -> str:
    """Return the text of the template; a scenario that runs and passes as it is."""
    info = inspect.type_info(Scenario)
    assert isinstance(info, inspect.StructType)
    lines = _keys(info, Place("", {**EXAMPLE, "name": name}))
    return "\n".join([HEAD.format(name=name), *lines, ""])


def _keys(info: inspect.StructType, place: Place) -> Iterator[str]:
    """Return the lines of a table's keys and then those of its inner tables."""
    shown = BRIEF.get(place.name)
    fields = [field for field in info.fields if shown is None or field.encode_name in shown]
    for field in fields:
        if _table_of(field.type) is None:
            yield _key(field, place)
    for field in fields:
        if (table := _table_of(field.type)) is not None:
            yield from _tables(field, table, place)


def _key(field: inspect.Field, place: Place) -> str:
    name = field.encode_name
    if place.given is not None and name in place.given:
        setting = f"{name} = {_toml(place.given[name])}"
    else:
        setting = f"#{name} = {_toml(_example(field, place.key(name)))}"
    return f"{setting:{COLUMN}} # {allowed_by(field.type)}"


def _tables(field: inspect.Field, table: inspect.StructType, place: Place) -> Iterator[str]:
    """Return the lines of a table; of several, all of the first and the set keys of the others."""
    name = place.key(field.encode_name)
    given = place.given.get(field.encode_name) if place.given is not None else None
    if not _is_list(field.type):
        yield from _whole(table, Place(name, given))
        return
    first, *others = given or [None]
    yield from _whole(table, Place(name, first, "[[{}]]"))
    for other in others:
        yield f"\n[[{name}]]"
        yield from (f"{key} = {_toml(value)}" for key, value in other.items())


def _whole(table: inspect.StructType, place: Place) -> Iterator[str]:
    yield ""
    yield from (f"# {line}".rstrip() for line in _description(table))
    yield f"{place.comment}{place.brackets.format(place.name)}"
    yield from _keys(table, place)


def _description(table: inspect.StructType) -> list[str]:
    return cleandoc(table.cls.__doc__ or "").replace("``", "").splitlines()


def _example(field: inspect.Field, name: str) -> Any:
    """Return a key's default, or an example where it has none."""
    if name in EXAMPLES:
        return EXAMPLES[name]
    if field.default is not NODEFAULT and field.default is not None:
        return msgspec.to_builtins(field.default)
    if field.default_factory is not NODEFAULT:
        return msgspec.to_builtins(field.default_factory())
    raise LookupError(f"{name} has no default: the template needs an example")


def _table_of(info: inspect.Type) -> inspect.StructType | None:
    """Return the table of a type: itself, optional or in a list; None for a plain value."""
    match info:
        case inspect.Metadata():
            return _table_of(info.type)
        case inspect.VarTupleType():
            return _table_of(info.item_type)
        case inspect.UnionType(types=types):
            within = [option for option in types if not isinstance(option, inspect.NoneType)]
            return _table_of(within[0]) if len(within) == 1 else None
        case inspect.StructType(tag=None):
            return info
    return None


def _is_list(info: inspect.Type) -> bool:
    return isinstance(
        info.type if isinstance(info, inspect.Metadata) else info, inspect.VarTupleType
    )


def _toml(value: Any) -> str:
    """Return a plain value in TOML's inline form."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_toml(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    whole = isinstance(value, float) and value.is_integer()
    return json.dumps(int(value) if whole else value)
