"""Error texts: what a type allows, and what was found instead."""

from collections.abc import Iterable
from datetime import date, time
from typing import Annotated, Any

from msgspec import Meta, inspect

MAX_SHOWN = 60


def allowed(kind: Any) -> str:
    """Return what a type allows, in words."""
    return allowed_by(inspect.type_info(kind))


def tags(kind: Any) -> str:
    """Return the tags by which the tables of a union are distinguished."""
    return " or ".join(map(repr, _tags_of(kind)))


def tag_type(kind: Any) -> Any:
    """Return the type of the key that distinguishes the tables of a union."""
    return Annotated[str, Meta(description=tags(kind))]


def _tags_of(kind: Any) -> list[str]:
    info = inspect.type_info(kind)
    while isinstance(info, inspect.Metadata):
        info = info.type
    return _tags(info.types if isinstance(info, inspect.UnionType) else (info,))


def got(value: Any) -> str:
    """Return what was found in a file, in words."""
    if isinstance(value, bool):
        return f"got {str(value).lower()}"
    if isinstance(value, str):
        return f"got the text {_short(repr(value))}"
    if isinstance(value, date | time):
        return f"got the date or time {value}, which is text only in quotes"
    if isinstance(value, dict):
        return "got a table"
    if isinstance(value, list):
        return f"got a list of {len(value)}"
    return f"got {_short(str(value))}"


def allowed_by(info: inspect.Type) -> str:
    """Return what a type allows, in words, from msgspec's description of it."""
    match info:
        case inspect.Metadata(extra_json_schema={"description": str(words)}):
            return words
        case inspect.UnionType():
            return _union(info)
        case inspect.LiteralType():
            return " or ".join(repr(value) for value in info.values)
        case inspect.IntType() | inspect.FloatType():
            return _number(info)
        case inspect.StrType():
            return _text(info)
        case _:
            return _nested(info)


def _nested(info: inspect.Type) -> str:
    match info:
        case inspect.BoolType():
            return "true or false"
        case inspect.TupleType():
            return f"a list of {len(info.item_types)}, each {allowed_by(info.item_types[0])}"
        case inspect.VarTupleType():
            count = _count(info.min_length, info.max_length)
            return f"a list{count}, each {allowed_by(info.item_type)}"
        case inspect.DictType(value_type=inspect.AnyType()):
            return "a table"
        case inspect.DictType():
            count = _count(info.min_length, info.max_length)
            return f"a table{count}, each {allowed_by(info.value_type)}"
        case inspect.StructType():
            return f"a table of {', '.join(field.encode_name for field in info.fields)}"
    raise LookupError(f"no words for {info}")


def _union(info: inspect.UnionType) -> str:
    kinds = _tags(info.types)
    if kinds:
        return f"a table with {_tag_field(info.types)} = {' or '.join(map(repr, kinds))}"
    options = [option for option in info.types if not isinstance(option, inspect.NoneType)]
    return " or ".join(allowed_by(option) for option in options)


def _number(info: inspect.IntType | inspect.FloatType) -> str:
    words = "a whole number" if isinstance(info, inspect.IntType) else "a number"
    if info.ge is not None and info.ge == info.le:
        return f"{info.ge:g}"
    bounds = (("from", info.ge), ("above", info.gt), ("up to", info.le), ("below", info.lt))
    limits = [f"{word} {_figure(bound)}" for word, bound in bounds if bound is not None]
    return f"{words} {' and '.join(limits)}".rstrip().replace(" and up to", " up to")


def _figure(bound: float) -> str:
    return str(int(bound)) if bound == int(bound) else f"{bound:g}"


def _text(info: inspect.StrType) -> str:
    count = _count(info.min_length, info.max_length)
    return f"text{count} characters" if count else "text"


def _count(least: int | None, most: int | None) -> str:
    if least is None and most is None:
        return ""
    if least == most:
        return f" of {least}"
    return f" of {least or 0} to {most}" if most is not None else f" of {least} or more"


def _tags(options: Iterable[inspect.Type]) -> list[str]:
    return [
        str(option.tag)
        for option in options
        if isinstance(option, inspect.StructType) and option.tag is not None
    ]


def _tag_field(options: Iterable[inspect.Type]) -> str:
    """Return the key whose value selects one of the tables of a union."""
    return next(
        str(option.tag_field) for option in options if isinstance(option, inspect.StructType)
    )


def _short(text: str) -> str:
    return text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 3] + "..."
