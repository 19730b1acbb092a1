"""Run events as sentences, for the viewer's event list.

Slots and queues are counted from 1, as in the names of the queues' series.
"""

from collections.abc import Sequence
from typing import assert_never

import msgspec

from netem.faults import Jam
from netem.link_keys import Conditions
from worldsim.judge.run_events import (
    ConditionsChanged,
    Flapped,
    FlapWindow,
    FormationGiven,
    FrameGiven,
    Healed,
    Jammed,
    Joined,
    Killed,
    LateStart,
    Left,
    MissionRunEvent,
    Partitioned,
    Paused,
    PlannedEvent,
    QueueChanged,
    RadioRunEvent,
    Restarted,
    Resumed,
    RoleChanged,
    RunEvent,
    SensorChanged,
    SlotChanged,
)
from worldsim.recording.layout import agent_name

NO_AGENT = "no agent"
NOT_GIVEN = Conditions()
WARNINGS = (Killed, Left, Paused, Partitioned, Jammed, LateStart)
"""Events that the list shows as warnings."""


def event_text(event: RunEvent) -> str:
    """Return an event as a sentence, and its origin in parentheses."""
    origin = _origin(event)
    return _sentence(event) + (f" ({origin})" if origin else "")


def _sentence(event: RunEvent) -> str:
    match event:
        case Killed() | Left() | Paused() | Resumed():
            return _process_text(event)
        case Restarted() | Joined():
            return _start_text(event)
        case Partitioned() | Healed() | Jammed() | Flapped() | ConditionsChanged():
            return _radio_text(event)
        case SensorChanged():
            sensors = "all sensors" if event.sensor == "all" else f"{event.sensor} sensor"
            return f"{_agent(event.agent)}: {sensors}: {event.mode}"
        case FormationGiven() | FrameGiven():
            return _mission_text(event)
        case SlotChanged() | QueueChanged() | RoleChanged() | LateStart():
            return f"{_agent(event.agent)} {_agent_text(event)}"
        case _:
            assert_never(event)


def _process_text(event: Killed | Left | Paused | Resumed) -> str:
    if event.nobody is not None:
        selectors = ", ".join(map(str, event.nobody))
        return f"{event.kind}: no agent matches {selectors or 'the selection'}"
    agent = _agent(event.agent)
    match event:
        case Killed():
            return f"{agent} killed"
        case Left():
            return f"{agent} left"
        case Paused():
            return f"{agent} paused"
        case Resumed():
            return f"{agent} resumed"
        case _:
            assert_never(event)


def _start_text(event: Restarted | Joined) -> str:
    if event.refused is not None:
        return f"{event.kind} refused: {event.refused}"
    match event:
        case Restarted():
            return f"{_agent(event.agent)} restarted"
        case Joined():
            return f"{_agent(event.agent)} joined"
        case _:
            assert_never(event)


def _radio_text(event: RadioRunEvent) -> str:
    match event:
        case Partitioned():
            return _partition_text(event)
        case Healed():
            return "partition healed"
        case Jammed():
            return _jam_text(event.jam)
        case Flapped():
            return _flap_text(event.flap)
        case ConditionsChanged():
            return _conditions_text(event)
        case _:
            assert_never(event)


def _partition_text(event: Partitioned) -> str:
    groups = " | ".join(_agents(group) for group in event.groups)
    bridge = f", bridge: {_agents(event.bridge)}" if event.bridge else ""
    return f"radio partitioned ({event.parted}): {groups}{bridge}"


def _jam_text(jam: Jam | None) -> str:
    if jam is None:
        return "jamming ended"
    return f"radio jammed within {jam.radius_m:g} m of {_point(jam.centre_m)}"


def _flap_text(flap: FlapWindow | None) -> str:
    if flap is None:
        return "flapping ended"
    links = [f"{_agent(source)} to {_agent(to)}" for source, to in flap.links]
    return f"links flap every {flap.period_s:g} s: {', '.join(links) or 'all'}"


def _conditions_text(event: ConditionsChanged) -> str:
    if event.undone is not None:
        return f"radio change ended: {_link_keys(event.undone)}"
    return f"radio changed: {_link_keys(event)}"


def _mission_text(event: MissionRunEvent) -> str:
    to = _agent(event.agent)
    match event:
        case FormationGiven():
            return f"new formation {event.formation}: mission {event.mission} given to {to}"
        case FrameGiven():
            return f"new frame of {event.formation}: mission {event.mission} given to {to}"
        case _:
            assert_never(event)


def _agent_text(event: SlotChanged | QueueChanged | RoleChanged | LateStart) -> str:
    """Return what an agent does; the sentence's subject is left out."""
    match event:
        case SlotChanged():
            return _slot_text(event)
        case QueueChanged():
            return "leaves its queue" if event.queue is None else f"enters queue {event.queue + 1}"
        case RoleChanged():
            return f"becomes {event.role}"
        case LateStart():
            return f"is late: {event.detail}"
        case _:
            assert_never(event)


def _slot_text(event: SlotChanged) -> str:
    before = None if event.before is None else _place(event.before)
    if event.place is None:
        return f"gives up {before or 'its slot'}"
    return f"takes {_place(event.place)}" + (f", was in {before}" if before else "")


def _origin(event: RunEvent) -> str:
    """Return where an event comes from; empty for what agents do by themselves."""
    if not isinstance(event, PlannedEvent | ConditionsChanged):
        return ""
    if event.by is not None:
        return f"by {event.by}"
    return "scheduled" if event.planned else f"unplanned{_exit_text(event)}"


def _exit_text(event: PlannedEvent | ConditionsChanged) -> str:
    if not isinstance(event, Killed):
        return ""
    codes = (("status", event.status), ("signal", event.signal))
    known = [f"{name} {code}" for name, code in codes if code is not None]
    return f": {', '.join(known)}" if known else ""


def _link_keys(conditions: Conditions) -> str:
    """Return the link keys that are given, with their values."""
    given = {
        name: getattr(conditions, name)
        for name in Conditions.__struct_fields__
        if getattr(conditions, name) != getattr(NOT_GIVEN, name)
    }
    return ", ".join(f"{name} {msgspec.to_builtins(value)}" for name, value in given.items())


def _agent(agent: int | None) -> str:
    return NO_AGENT if agent is None else agent_name(agent)


def _agents(agents: Sequence[int]) -> str:
    return " ".join(map(agent_name, agents))


def _place(place: tuple[int, int]) -> str:
    queue, rank = place
    return f"slot {rank + 1} of queue {queue + 1}"


def _point(point: Sequence[float]) -> str:
    return f"[{', '.join(f'{metres:g}' for metres in point)}] m"
