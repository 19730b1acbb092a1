"""The tables of docs/wire.md, made from the code: keys of an agent, and fields of its messages."""

import ast
import inspect as python
import re
from collections.abc import Iterator
from functools import cache
from typing import Any

from msgspec import inspect

from agent import config, messages
from agent.messages import Beacon, Command, Datagram, Gossip, MissionData, Observation
from netem.wire.access import MAX_AGENT_PUT_B
from netem.wire.frame import Batch, Delivery, Inbox, Transmission
from netem.wire.keys import TOPICS, Keys, agent_name
from netem.wire.latency import LatencyReport

OF_AGENTS = ("setup", "observation", "rx", "command", "tx", "arrivals", "over", "alive")
GROUPS = {
    "From the world, and to it": (Observation, Command, LatencyReport),
    "Between an agent and the radio": (Transmission, Batch, Delivery, Inbox),
    "Payloads of frames": (Beacon, Gossip, Datagram, MissionData),
}
"""Messages by what they are for; the tables of what they hold follow each."""
POWERS = {2**k - 1: f"2^{k} - 1" for k in (15, 16, 31, 32, 53)} | {-(2**31): "-2^31"}


def wire_topics() -> str:
    """Return the table of an agent's keys."""
    run, rows = Keys("RUN"), []
    for name in OF_AGENTS:
        topic = TOPICS[name]
        key = run.of(name, agent_name(8) if name == "alive" else 8)
        lost = "blocks" if topic.blocking else "drops; in lockstep it blocks"
        service = "query" if name == "setup" else "token" if name == "alive" else lost
        most = MAX_AGENT_PUT_B.get(name)
        size = f"{most} B" if most is not None else "-"
        rows.append(f"| `{key}` | {topic.publisher} | {topic.rate} | {service} | {size} |")
    head = ["| key of agent 8 | who puts or answers | rate | when congested | at most |"]
    return "\n".join([*head, "|" + "---|" * 5, *rows, ""])


def wire_messages() -> str:
    """Return the tables of all messages: position, field, type, meaning."""
    seen: list[type] = []
    lines: list[str] = []
    for title, kinds in GROUPS.items():
        lines += [f"### {title}", ""]
        waiting: list[type] = list(kinds)
        while waiting:
            kind = waiting.pop(0)
            if kind not in seen:
                seen.append(kind)
                lines += _table(kind)
                waiting = [*_held(kind), *waiting]
    return "\n".join(lines)


def _table(kind: type) -> Iterator[str]:
    yield f"**{kind.__name__}.** {_first_sentence(kind)}"
    yield ""
    yield "| # | field | type | meaning |"
    yield "|---|---|---|---|"
    said = _meanings(kind)
    for number, field in enumerate(_fields(kind)):
        name = field.encode_name
        optional = "" if field.required else "; optional"
        yield f"| {number} | `{name}` | {_in_words(field.type)}{optional} | {said.get(name, '')} |"
    yield ""


@cache
def _fields(kind: type) -> tuple[Any, ...]:
    info = inspect.type_info(kind)
    assert isinstance(info, inspect.StructType | inspect.NamedTupleType)
    return info.fields


def _held(kind: type) -> list[type]:
    """Return the structures that the fields of one hold, in order."""
    return [each for field in _fields(kind) for each in _structures(field.type)]


def _structures(info: Any) -> Iterator[type]:
    match info:
        case inspect.Metadata(type=inner) | inspect.VarTupleType(item_type=inner):
            yield from _structures(inner)
        case inspect.StructType(cls=cls) | inspect.NamedTupleType(cls=cls):
            yield cls
        case inspect.UnionType(types=types) | inspect.TupleType(item_types=types):
            for each in types:
                yield from _structures(each)


def _in_words(info: Any) -> str:
    """Return a type in words."""
    match info:
        case inspect.Metadata(type=inner):
            return _in_words(inner)
        case inspect.LiteralType(values=values):
            return " or ".join(map(str, values))
        case inspect.StructType(cls=cls) | inspect.NamedTupleType(cls=cls):
            return str(cls.__name__)
        case inspect.VarTupleType() | inspect.TupleType() | inspect.UnionType():
            return _compound_in_words(info)
    return _scalar_in_words(info)


def _scalar_in_words(info: Any) -> str:
    match info:
        case inspect.IntType(ge=ge, le=le, lt=lt):
            return f"integer{_range(ge, lt - 1 if lt is not None else le)}"
        case inspect.FloatType(ge=ge, le=le):
            return f"float{_range(ge, le)}"
        case inspect.BytesType(max_length=most):
            return "bytes" if most is None else f"bytes, at most {most}"
        case inspect.StrType(pattern=pattern):
            return "text" if pattern is None else f"text, `{pattern}`"
        case inspect.BoolType():
            return "true or false"
    raise TypeError(f"no words for {info}")


def _compound_in_words(info: Any) -> str:
    match info:
        case inspect.VarTupleType(item_type=item, max_length=most):
            bound = "" if most is None else f" (at most {most})"
            return f"array of {_in_words(item)}{bound}"
        case inspect.TupleType(item_types=items):
            words = [_in_words(each) for each in items]
            alike = len(set(words)) == 1
            return f"{len(words)} x {words[0]}" if alike else f"[{'; '.join(words)}]"
    words = [_in_words(each) for each in info.types if not isinstance(each, inspect.NoneType)]
    return f"{' or '.join(words)} or nil"


def _range(least: float | None, most: float | None) -> str:
    if least is None and most is None:
        return ""
    return f", {_number(least)} to {_number(most)}"


def _number(value: float | None) -> str:
    return POWERS.get(int(value), f"{value:g}") if value is not None else ""


def _first_sentence(kind: type) -> str:
    text = python.cleandoc(kind.__doc__ or "").split("\n\n")[0]
    return _plain(text)


def _plain(text: str) -> str:
    """Return a comment or docstring on one line of Markdown."""
    text = re.sub(r":\w+:`~?([\w.]+)`", r"`\1`", " ".join(text.split()))
    text = re.sub(r"(?:agent\.config\.)?\b([A-Z][A-Z_]{3,})\b", _with_value, text)
    return text.replace("``", "`").replace("|", r"\|")


def _with_value(name: re.Match[str]) -> str:
    """Return the name of a constant with its value, for those who do not have the code."""
    value = getattr(messages, name[1], getattr(config, name[1], None))
    if value is None:
        return name[0]
    shown = ", ".join(value) if isinstance(value, tuple) else f"{value:g}"
    return f"{name[1]} ({shown})"


def _meanings(kind: type) -> dict[str, str]:
    """Return what is written beside or below each field of a class, its bases included."""
    found: dict[str, str] = {}
    for each in reversed(kind.__mro__):
        if each.__module__.partition(".")[0] in ("agent", "netem"):
            found |= _own_meanings(each)
    return found


def _own_meanings(kind: type) -> dict[str, str]:
    source = python.getsource(kind)
    lines = source.splitlines()
    (tree,) = ast.parse(source).body
    assert isinstance(tree, ast.ClassDef)
    found: dict[str, str] = {}
    for node, after in zip(tree.body, [*tree.body[1:], None], strict=True):
        if not isinstance(node, ast.AnnAssign) or not isinstance(node.target, ast.Name):
            continue
        comment = lines[(node.end_lineno or node.lineno) - 1].partition("  # ")[2]
        below = ""
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            below = str(after.value.value)
        found[node.target.id] = _plain(comment or below)
    return found
