"""The tables of a run: their columns, and how they are made of the ticks and events.

To add a column: declare it in LAYOUTS, and add its values where the table is made. The documents
and the exported files take names, units, frames and meanings from LAYOUTS.
"""

import json
from collections.abc import Iterable, Sequence
from math import isnan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from worldsim.judge.event_text import sentence
from worldsim.judge.run_events import (
    FormationGiven,
    FrameGiven,
    RoleChanged,
    RunEvent,
    as_row,
)
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures
from worldsim.recording.layout import agent_name
from worldsim.results.table import Column, Layout, Table
from worldsim.scenario.tables import Scenario

WORLD = "world"
TIME_SLACK_S = 1e-6
"""Event times are rounded to the microsecond."""

_TIME = Column("t_s", "number", "s", "", "simulated time")
_TICK = Column("tick", "integer", "", "", "number of the tick, from 0")
_AGENT = Column("agent", "integer", "", "", "the agent's id")
_ROW = (_TIME, _TICK, _AGENT)


def _point(says: str) -> tuple[Column, ...]:
    return tuple(Column(f"{axis}_m", "number", "m", WORLD, f"{says}, {axis}") for axis in "xyz")


def _count(name: str, says: str) -> Column:
    return Column(name, "integer", "frames", "", says)


LAYOUTS: dict[str, Layout] = {
    "agents": Layout(
        "a row for each agent of the run, those included that join later",
        (
            _AGENT,
            Column("name", "text", "", "", "the agent's name in pictures and logs"),
            Column("at_start", "flag", "", "", "whether it is there from the start"),
            Column("vehicle", "text", "", "", "kind of its vehicle"),
            Column("radius_m", "number", "m", "", "what sensors see of the vehicle"),
            Column("max_speed_mps", "number", "m/s", "", "limit of the speed"),
            Column("max_turn_deg", "number", "deg", "", "limit of a turn, theta of the cast-zone"),
        ),
    ),
    "poses": Layout(
        "a row for each tick and agent, by tick, then agent; NaN: no vehicle in the world",
        (
            *_ROW,
            *_point("position of the vehicle's centre"),
            Column("yaw_rad", "number", "rad", WORLD, "heading, from x towards y"),
            Column("pitch_rad", "number", "rad", WORLD, "nose up"),
            Column("roll_rad", "number", "rad", WORLD, "right side down"),
            Column(
                "running", "flag", "", "", "whether the process runs (not dead, paused or booting)"
            ),
        ),
    ),
    "targets": Layout(
        "a row for each tick and agent, by tick, then agent; NaN: no target",
        (*_ROW, *_point("target-on-queue, where the agent wants to go")),
    ),
    "places": Layout(
        "a row for each tick and agent, by tick, then agent: what the agent claims and is",
        (
            *_ROW,
            Column("queue", "integer", "", "", "index of its queue in the formation, -1: none"),
            Column("queue_name", "text", "", "", "name of the queue; empty: none"),
            Column("rank", "integer", "", "", "place along the queue, from 0, -1: none"),
            Column("mission", "integer", "", "", "key of the mission it flies, -1: none"),
            Column("role", "text", "", "", "latest role it reported; empty before the first"),
        ),
    ),
    "links": Layout(
        "a row for each time that one agent heard another without a break, by its start",
        (
            Column("from_s", "number", "s", "", "simulated time of the first tick"),
            Column("to_s", "number", "s", "", "simulated time of the last tick"),
            Column("from_tick", "integer", "", "", "number of the first tick"),
            Column("to_tick", "integer", "", "", "number of the last tick"),
            Column("hearer", "integer", "", "", "id of the agent that hears"),
            Column("heard", "integer", "", "", "id of the agent that is heard"),
        ),
    ),
    "events": Layout(
        "a row for each event, as in events.jsonl",
        (
            _TIME,
            Column("kind", "text", "", "", "the event's key, such as kill or slot"),
            Column("agent", "integer", "", "", "id of the agent, -1: no single one"),
            Column("text", "text", "", "", "the event as a sentence"),
            Column("details", "text", "", "", "the event's other keys, as JSON"),
        ),
    ),
    "metrics": Layout(
        "a row for each tick and agent, by tick, then agent; NaN: not measured",
        (
            *_ROW,
            Column(
                "separation_m",
                "number",
                "m",
                "",
                "least distance to another vehicle since the last tick, centre to centre",
            ),
            Column("slot_error_m", "number", "m", "", "distance to the own slot"),
            Column("force", "number", "", "", "size of the control force u_i of eq. (28)"),
            Column(
                "turn_deg",
                "number",
                "deg",
                "",
                "azimuth of the wanted velocity before the safety filter, less the heading",
            ),
            Column(
                "obstacle_distance_m",
                "number",
                "m",
                "",
                "least distance since the last tick, centre to surface",
            ),
        ),
    ),
    "signals": Layout(
        "a row for each tick, signal and agent at which the agent's controller states it",
        (
            *_ROW,
            Column("signal", "text", "", "", "its name, as in Intent.signals"),
            Column("value", "number", "", "", "what it states, in a unit of its own"),
        ),
    ),
    "packets": Layout(
        "a row for each tick at which the radio's counters are known; counts from the start on",
        (
            _TIME,
            _TICK,
            _count("sent", "frames sent, once for each"),
            _count("addressed", "frames, once for each other agent"),
            _count("delivered", "received"),
            _count("dropped_range", "receiver out of range, or not there"),
            _count("dropped_loss", "lost at random"),
            _count("dropped_partition", "cut by a partition, jam or flap"),
            _count("dropped_queue", "no room in a rate-limited queue"),
            _count(
                "dropped_medium",
                "in flight to an agent that is gone, or in a radio that was killed",
            ),
            _count("duplicated", "copies made on the way"),
            _count("corrupted", "delivered with a wrong bit"),
            _count("in_flight", "on their way"),
        ),
    ),
}


class RunRows(NamedTuple):
    """What the tables of a run are made of."""

    scenario: Scenario
    ticks: Sequence[Tick]
    events: Sequence[RunEvent]


def agents(rows: RunRows) -> Table:
    """Return the table of agents."""
    vehicles, first = rows.scenario.vehicles, rows.scenario.fleet.agents
    ids = range(len(vehicles))
    return _table(
        "agents",
        ids,
        [agent_name(agent) for agent in ids],
        [agent < first for agent in ids],
        [vehicle.kind for vehicle in vehicles],
        [vehicle.radius_m for vehicle in vehicles],
        [vehicle.max_speed_mps for vehicle in vehicles],
        [vehicle.max_turn_deg for vehicle in vehicles],
    )


def poses(rows: RunRows) -> Table:
    """Return the table of poses."""
    position = _stacked(rows, [tick.position for tick in rows.ticks], 3)
    attitude = _stacked(rows, [tick.attitude for tick in rows.ticks], 3)
    running = _stacked(rows, [tick.alive for tick in rows.ticks])
    return _table("poses", *_keys(rows), *position.T, *attitude.T, running)


def targets(rows: RunRows) -> Table:
    """Return the table of targets."""
    target = _stacked(rows, [tick.target for tick in rows.ticks], 3)
    return _table("targets", *_keys(rows), *target.T)


def places(rows: RunRows) -> Table:
    """Return the table of places and roles."""
    place = _stacked(rows, [tick.place for tick in rows.ticks], 2)
    mission = _stacked(rows, [tick.mission for tick in rows.ticks])
    names = _queue_names(rows)
    named = [
        _queue_name(names, key, queue)
        for key, queue in zip(mission.tolist(), place[:, 0].tolist(), strict=True)
    ]
    return _table("places", *_keys(rows), place[:, 0], named, place[:, 1], mission, _roles(rows))


def links(rows: RunRows) -> Table:
    """Return the table of links."""
    agents, begun, spans = rows.scenario.rows, dict[int, Tick](), list[tuple[Tick, Tick, int]]()
    before: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    last: Tick | None = None
    for tick in rows.ticks:
        now = np.unique(tick.links[:, 0].astype(np.int64) * agents + tick.links[:, 1])
        if last is not None:
            ended = np.setdiff1d(before, now, assume_unique=True).tolist()
            spans += [(begun.pop(code), last, code) for code in ended]
        begun |= dict.fromkeys(np.setdiff1d(now, before, assume_unique=True).tolist(), tick)
        before, last = now, tick
    if last is not None:
        spans += [(first, last, code) for code, first in begun.items()]
    spans.sort(key=lambda span: (span[0].index, span[2]))
    return _table(
        "links",
        [first.time_s for first, _, _ in spans],
        [end.time_s for _, end, _ in spans],
        [first.index for first, _, _ in spans],
        [end.index for _, end, _ in spans],
        [code // agents for _, _, code in spans],
        [code % agents for _, _, code in spans],
    )


def events(rows: RunRows) -> Table:
    """Return the table of events."""
    found, names = [], [queue.name for queue in rows.scenario.formation.queue]
    for event in rows.events:
        if isinstance(event, FormationGiven | FrameGiven):
            names = [queue.name for queue in event.tables.queue]
        row = as_row(event)
        t_s, kind, agent = (row.pop(key) for key in ("t_s", "kind", "agent"))
        details = json.dumps(row, sort_keys=True)
        found.append((t_s, kind, -1 if agent is None else agent, sentence(event, names), details))
    return _table("events", *zip(*found, strict=True) if found else [()] * 5)


def metrics(rows: RunRows, figures: Sequence[Figures]) -> Table:
    """Return the table of what the judge measured at each tick."""
    nothing = np.full(rows.scenario.rows, np.nan)
    slot_error = _stacked(rows, [each.slot_error for each in figures])
    distances = [each.obstacle_distance for each in figures]
    return _table(
        "metrics",
        *_keys(rows),
        _stacked(rows, [each.separation for each in figures]),
        np.where(np.isfinite(slot_error), slot_error, np.nan),
        _stacked(rows, [tick.force for tick in rows.ticks]),
        _stacked(rows, [tick.turn_deg for tick in rows.ticks]),
        _stacked(rows, [nothing if each is None else each for each in distances]),
    )


def signals(rows: RunRows) -> Table:
    """Return the table of what controllers state of themselves."""
    found = [
        (tick.time_s, tick.index, agent, name, value)
        for tick in rows.ticks
        for name, series in sorted(tick.signals.items())
        for agent, value in enumerate(series.tolist())
        if not isnan(value)
    ]
    return _table("signals", *zip(*found, strict=True) if found else [()] * 5)


def packets(rows: RunRows) -> Table:
    """Return the table of the radio's counters."""
    counters = [column.name for column in LAYOUTS["packets"].columns[2:]]
    known = [tick for tick in rows.ticks if tick.packets]
    counts = [[tick.packets.get(name, 0) for tick in known] for name in counters]
    return _table(
        "packets", [tick.time_s for tick in known], [tick.index for tick in known], *counts
    )


def _table(name: str, *values: Any) -> Table:
    return Table(name, LAYOUTS[name], values)


def _keys(rows: RunRows) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return time, tick and agent of each row of a table by tick and agent."""
    agents, ticks = rows.scenario.rows, len(rows.ticks)
    times_s = np.array([tick.time_s for tick in rows.ticks])
    indices = np.array([tick.index for tick in rows.ticks], dtype=np.int64)
    return times_s.repeat(agents), indices.repeat(agents), np.tile(np.arange(agents), ticks)


def _stacked(rows: RunRows, each: Sequence[NDArray[Any]], width: int = 0) -> NDArray[Any]:
    """Return rows of all ticks below each other: (T * N,), or (T * N, width)."""
    shape = (len(each) * rows.scenario.rows, *([width] if width else []))
    return np.concatenate(each).reshape(shape) if each else np.zeros(shape)


def _queue_names(rows: RunRows) -> dict[int, list[str]]:
    """Return the names of the queues of each mission, by its key."""
    names = {0: [queue.name for queue in rows.scenario.formation.queue]}
    for event in rows.events:
        if isinstance(event, FormationGiven | FrameGiven):
            names[event.mission] = [queue.name for queue in event.tables.queue]
    return names


def _queue_name(names: dict[int, list[str]], mission: int, queue: int) -> str:
    known = names.get(mission, [])
    return known[queue] if 0 <= queue < len(known) else ""


def _roles(rows: RunRows) -> list[str]:
    """Return each agent's latest reported role at each tick."""
    changes = sorted(_role_changes(rows.events), key=lambda change: change.t_s)
    role, noted, found = [""] * rows.scenario.rows, 0, list[str]()
    for tick in rows.ticks:
        while noted < len(changes) and changes[noted].t_s <= tick.time_s + TIME_SLACK_S:
            role[changes[noted].agent or 0] = changes[noted].role
            noted += 1
        found += role
    return found


def _role_changes(events: Iterable[RunEvent]) -> Iterable[RoleChanged]:
    return (event for event in events if isinstance(event, RoleChanged))
