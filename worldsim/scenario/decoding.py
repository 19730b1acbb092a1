"""Plain data into typed tables; an error names the key, and what is allowed there.

msgspec finds the error and its place; the words come from the types, so a new key needs none.
"""

import re
import types
from collections.abc import Iterator
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar, Union, get_args, get_origin

import msgspec

from worldsim.scenario.allowed_values import allowed, got, tag_type, tags
from worldsim.scenario.toml import ScenarioError

T = TypeVar("T")

_WHERE = re.compile(r" - at (?P<key>`key` in )?`\$(?P<path>[^`]*)`$")
_STEP = re.compile(r"\.(?P<field>[^.\[]+)|\[(?P<index>\d+|\.\.\.)\]")
_OWN_WORDS = ("Expected ", "Invalid ")
"""Messages begin so where msgspec finds the error; others are of a structure's own checks."""
_FIELD = re.compile(
    r"Object (?P<what>contains unknown|missing required) field `(?P<field>.*)`$", re.DOTALL
)


class Spot(NamedTuple):
    """A place in the data."""

    key: str  # dotted, from the root
    value: Any  # the value found there
    kind: Any  # the type required there


def decode(data: Any, kind: type[T], file: str | Path, at: str = "") -> T:
    """Return ``data`` as the tables of ``kind``, or raise ScenarioError. at: the data's own key."""
    for key, number in _numbers(data, at):
        if not isfinite(number):
            raise ScenarioError(file, key, f"got {number}; must be a finite number")
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        key, detail = _explained(str(error), Spot(at, data, kind))
        raise ScenarioError(file, key, detail) from error


def _numbers(data: Any, key: str) -> Iterator[tuple[str, float]]:
    if isinstance(data, float):
        yield key, data
    elif isinstance(data, dict):
        for name, value in data.items():
            yield from _numbers(value, _joined(key, name))
    elif isinstance(data, list):
        for index, value in enumerate(data):
            yield from _numbers(value, f"{key}[{index}]")


def _explained(message: str, root: Spot) -> tuple[str, str]:
    """Return the key that msgspec's message is about, and the error in words."""
    where = _WHERE.search(message)
    spot = _follow(where["path"] if where else "", root)
    if where and where["key"]:
        return spot.key, "a name is empty or too long; allowed: 1 to 64 characters"
    said = message[: where.start()] if where else message
    field = _FIELD.match(said)
    if field is None and not said.startswith(_OWN_WORDS):
        return spot.key, said
    if field is None:
        return spot.key, f"{got(spot.value)}; allowed: {allowed(spot.kind)}"
    key = _joined(spot.key, field["field"])
    if field["what"] == "missing required":
        return key, f"is missing; allowed: {_allowed_at(spot, field['field'])}"
    return key, unknown_key(field["field"], [name.encode_name for name in _fields(spot)])


def unknown_key(name: str, known: list[str]) -> str:
    """Return what is wrong with a key that is none of those known."""
    begun = [key for key in known if key.startswith(f"{name}_")]
    close = begun or get_close_matches(name, known, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"unknown key; {hint}allowed: {', '.join(known)}"


def _allowed_at(spot: Spot, name: str) -> str:
    types_of = {field.encode_name: field.type for field in _fields(spot)}
    return allowed(types_of[name]) if name in types_of else tags(spot.kind)


def _fields(spot: Spot) -> tuple[Any, ...]:
    kind = _chosen(spot.kind, spot.value)
    return msgspec.structs.fields(kind) if _is_table(kind) else ()


def _follow(path: str, root: Spot) -> Spot:
    spot = root
    for step in _STEP.finditer(path):
        spot = _inside(spot, step["field"], step["index"])
    return spot


def _inside(spot: Spot, field: str | None, index: str | None) -> Spot:
    """Take one step into the data: to a key of a table or mapping, or an index of a list."""
    kind = _chosen(spot.kind, spot.value)
    if field is not None:
        known = {each.encode_name: each.type for each in _fields(spot)}
        inner = known[field] if field in known else tag_type(spot.kind)
        return Spot(_joined(spot.key, field), spot.value[field], inner)
    kinds = get_args(kind)
    if index == "...":
        name = _misfit(spot.value, kinds[1])
        return Spot(_joined(spot.key, name), spot.value[name], kinds[1])
    position = int(index or 0)
    inner = kinds[0] if kinds[-1] is Ellipsis else kinds[position]
    return Spot(f"{spot.key}[{position}]", spot.value[position], inner)


def _misfit(mapping: dict[str, Any], kind: Any) -> str:
    """Return the first key whose value does not fit; msgspec does not name a mapping's key."""
    for name, value in mapping.items():
        try:
            msgspec.convert(value, kind)
        except msgspec.ValidationError:
            return name
    raise LookupError(f"every value fits {kind}")


def _chosen(kind: Any, value: Any) -> Any:
    """Return the bare type that applies: of a union the one that the value's tag asks for."""
    if get_origin(kind) is Annotated:
        return _chosen(get_args(kind)[0], value)
    if get_origin(kind) not in (Union, types.UnionType):
        return kind
    options = [option for option in get_args(kind) if option is not types.NoneType]
    if len(options) == 1:
        return _chosen(options[0], value)
    if isinstance(value, list):
        bare = (_chosen(each, value) for each in options)
        return next((each for each in bare if get_origin(each) is tuple), kind)
    for option in options if isinstance(value, dict) else ():
        config = getattr(option, "__struct_config__", None)
        if config is not None and (not config.tag or value.get(config.tag_field) == config.tag):
            return option
    return kind


def _is_table(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def _joined(key: str, name: str) -> str:
    return f"{key}.{name}" if key else name
