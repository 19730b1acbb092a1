"""A run as one MCAP file with JSON messages, to open in Foxglove.

``/scene`` is the 3D scene and ``/log`` the events in words, both in Foxglove's own schemas. Every
table has a topic of its name. Rows of one tick are one message with a list ``rows``; tables without
a tick and an agent have a message for each row. Times are simulated, from 0 on. A number that was
not measured is null.
"""

import json
from collections.abc import Iterator, Mapping
from heapq import merge
from importlib import import_module
from math import ceil, isnan
from pathlib import Path
from typing import Any, NamedTuple

from worldsim.export.scene import STAMP_SCHEMA, Json, Scenes, scene_schema, stamp
from worldsim.judge.event_text import WARNINGS
from worldsim.results.run import Run
from worldsim.results.table import Column, Kind, Table
from worldsim.scenario.file import dump

SCENE_HZ = 10.0
"""So many scenes a second at most: they are the largest part of a file."""
INFO, WARNING = 2, 3
"""foxglove.Log's levels."""
JSON_TYPES: dict[Kind, Any] = {
    "number": ["number", "null"],
    "integer": "integer",
    "flag": "boolean",
    "text": "string",
}
BY_TICK = ("t_s", "tick", "agent")
"""A table that begins with these columns has a message for each tick."""


class Message(NamedTuple):
    """One message of a topic."""

    t_s: float
    topic: str
    content: Json


class MissingPackageError(Exception):
    """A package that is needed is not installed; one line that says how to get it."""


def write_mcap(run: Run, file: Path) -> None:
    """Write a run as an MCAP file. Raises OSError, and MissingPackageError without ``mcap``."""
    tables = run.tables
    schemas = {
        "/scene": ("foxglove.SceneUpdate", scene_schema()),
        "/log": ("foxglove.Log", _LOG_SCHEMA),
        **{f"/{name}": (f"qswarm.{name}", table_schema(table)) for name, table in tables.items()},
    }
    streams = [_scenes(run), _log(run), *(_messages(table) for table in tables.values())]
    with file.open("wb") as out:
        writer = _writer_class()(out)
        writer.start(profile="", library="qswarm")
        channels = {topic: _channel(writer, topic, *each) for topic, each in schemas.items()}
        for number, message in enumerate(merge(*streams, key=lambda each: each.t_s)):
            at_ns = round(message.t_s * 1e9)
            data = json.dumps(message.content, allow_nan=False, separators=(",", ":")).encode()
            writer.add_message(channels[message.topic], at_ns, data, at_ns, number)
        writer.add_attachment(0, 0, "scenario.toml", "text/plain", dump(run.scenario).encode())
        writer.finish()


def table_schema(table: Table) -> Json:
    """Return the JSON Schema of a table's messages, each column with its meaning."""
    columns = {column.name: _described(column) for column in table.layout.columns}
    if not _is_by_tick(table):
        return {"type": "object", "description": table.layout.says, "properties": columns}
    keys = {name: columns.pop(name) for name in BY_TICK[:2]}
    rows = {"type": "array", "items": {"type": "object", "properties": columns}}
    return {
        "type": "object",
        "description": table.layout.says,
        "properties": {**keys, "rows": rows},
    }


def _described(column: Column) -> Json:
    unit = f" [{column.unit}]" if column.unit else ""
    frame = f", {column.frame} frame" if column.frame else ""
    return {"type": JSON_TYPES[column.kind], "description": f"{column.says}{unit}{frame}"}


def _writer_class() -> Any:
    try:
        return import_module("mcap.writer").Writer
    except ModuleNotFoundError as error:
        raise MissingPackageError("mcap is not installed: pip install 'qswarm[export]'") from error


def _channel(writer: Any, topic: str, name: str, schema: Json) -> int:
    data = json.dumps(schema).encode()
    schema_id = writer.register_schema(name=name, encoding="jsonschema", data=data)
    channel: int = writer.register_channel(topic, "json", schema_id)
    return channel


def _scenes(run: Run) -> Iterator[Message]:
    scenes, step = Scenes(run.scenario), max(1, ceil(run.scenario.fleet.tick_hz / SCENE_HZ))
    for tick in run.ticks[::step]:
        yield Message(tick.time_s, "/scene", scenes.scene(tick))


def _log(run: Run) -> Iterator[Message]:
    texts = run.events["text"].tolist()
    for event, text in sorted(
        zip(run.run_events, texts, strict=True), key=lambda each: each[0].t_s
    ):
        content = {
            "timestamp": stamp(event.t_s),
            "level": WARNING if isinstance(event, WARNINGS) else INFO,
            "message": text,
            "name": event.kind,
            "file": "",
            "line": 0,
        }
        yield Message(event.t_s, "/log", content)


def _messages(table: Table) -> Iterator[Message]:
    rows = (
        {name: _plain(value) for name, value in zip(table, row, strict=True)}
        for row in zip(*(values.tolist() for values in table.values()), strict=True)
    )
    topic = f"/{table.name}"
    if not _is_by_tick(table):
        found = (Message(_time_s(row), topic, row) for row in rows)
        yield from sorted(found, key=lambda each: each.t_s)
        return
    message: Message | None = None
    for row in rows:
        t_s, tick = row.pop("t_s"), row.pop("tick")
        if message is None or message.content["tick"] != tick:
            if message is not None:
                yield message
            message = Message(t_s, topic, {"t_s": t_s, "tick": tick, "rows": []})
        message.content["rows"].append(row)
    if message is not None:
        yield message


def _is_by_tick(table: Table) -> bool:
    return tuple(table)[: len(BY_TICK)] == BY_TICK


def _time_s(row: Mapping[str, Any]) -> float:
    """Return the time of a row that has one; what holds for the whole run is at its start."""
    time_s: float = row.get("t_s", row.get("from_s", 0.0))
    return time_s


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and isnan(value) else value


_TEXT: Json = {"type": "string"}
_LOG_SCHEMA: Json = {
    "title": "foxglove.Log",
    "type": "object",
    "properties": {
        "timestamp": STAMP_SCHEMA,
        "level": {"type": "integer"},
        "message": _TEXT,
        "name": _TEXT,
        "file": _TEXT,
        "line": {"type": "integer"},
    },
}
