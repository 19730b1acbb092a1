"""Run events in words: one sentence each, for the operator's terminal and for logs."""

from collections.abc import Sequence
from typing import assert_never

from agent.messages import Role
from worldsim.judge.event import By, PlannedEvent
from worldsim.judge.radio_events import (
    ConditionsChanged,
    Jammed,
    NetemOutage,
    Partitioned,
    RadioRunEvent,
    Sabotaged,
    radio_sentence,
)
from worldsim.judge.run_events import (
    AgentFaultRunEvent,
    ClockChanged,
    ControllerLogged,
    DiskFilled,
    FormationGiven,
    FrameGiven,
    Intruded,
    Joined,
    Killed,
    LateStart,
    Left,
    LossEvent,
    MissionRunEvent,
    Paused,
    PoseChanged,
    QueueChanged,
    Reconnected,
    Restarted,
    Resumed,
    ReturnEvent,
    RoleChanged,
    RunEvent,
    SensorChanged,
    SlotChanged,
    SlowChanged,
    Starved,
    WorldStopped,
)

Queues = Sequence[str]
ROLE_WORDS: dict[Role, str] = {
    "member": "becomes a member",
    "sub-vertex": "becomes a sub-vertex agent",
    "vertex": "becomes a vertex agent",
    "distress": "is in distress",
}
WARNINGS = (
    Killed,
    Left,
    Paused,
    Partitioned,
    Jammed,
    Sabotaged,
    Intruded,
    NetemOutage,
    WorldStopped,
    LateStart,
)
"""Events that a list of them shows as warnings."""


def sentence(event: RunEvent, queues: Queues = ()) -> str:
    """Return an event as a sentence without its time, such as "a3 takes slot 2 of queue Q3".

    queues: the names of the formation's queues, in order. Slots are counted from 1 along a queue.
    """
    return _words(event, queues) + _origin(event)


def origin(by: By) -> str:
    """Return who asked for something, as the end of a sentence, such as " (by the operator)"."""
    return " (scheduled)" if by is None else f" (by the {by})"


def _words(event: RunEvent, queues: Queues) -> str:
    if isinstance(event, RadioRunEvent):
        return radio_sentence(event)
    match event:
        case Killed() | Left() | Paused():
            words = _lost(event)
        case Restarted() | Joined() | Resumed():
            words = _returned(event)
        case SensorChanged(agent=agent, sensor=sensor, mode=mode):
            words = f"sensors of a{agent} ({sensor}): {mode}"
        case ClockChanged() | PoseChanged() | SlowChanged() | Starved() | Intruded():
            words = _agent_fault(event)
        case FormationGiven() | FrameGiven():
            words = _mission(event)
        case SlotChanged() | QueueChanged() | RoleChanged() | ControllerLogged():
            words = _told_by_agent(event, queues)
        case LateStart() | WorldStopped() | Reconnected() | DiskFilled():
            words = _of_processes(event)
        case _:
            assert_never(event)
    return words


def _lost(event: LossEvent) -> str:
    if event.nobody is not None:
        return f"{event.kind}: no agent matches {_list(event.nobody)}"
    match event:
        case Killed(planned=True):
            return f"a{event.agent} is killed; its vehicle hovers"
        case Killed():
            return f"the process of a{event.agent} ended{_end(event)}; its vehicle hovers"
        case Left():
            return f"a{event.agent} leaves; its vehicle is removed"
        case Paused():
            return f"a{event.agent} is paused"
    assert_never(event)


def _end(event: Killed) -> str:
    """Return how a process ended, where that is known."""
    if event.signal is not None:
        return f" by signal {event.signal}"
    return f" with status {event.status}" if event.status is not None else ""


def _returned(event: ReturnEvent) -> str:
    match event:
        case Resumed(nobody=None):
            return f"a{event.agent} resumes"
        case Resumed():
            return f"resume: no agent matches {_list(event.nobody or ())}"
        case Restarted(refused=None):
            return f"a{event.agent} restarts (incarnation {event.incarnation})"
        case Joined(refused=None):
            return f"a{event.agent} joins"
        case Restarted() | Joined():
            return f"{event.kind} refused: {event.refused}"
    assert_never(event)


def _agent_fault(event: AgentFaultRunEvent | Intruded) -> str:
    if isinstance(event, Intruded):
        return _intruded(event)
    agent = f"a{event.agent}"
    match event:
        case ClockChanged():
            begins = f"the clock of {agent} goes wrong by {_error(event)}"
            ends = f"the clock of {agent} is set right: {_error(event)} no more"
        case PoseChanged():
            begins = f"{agent} measures its pose wrong: {_pose_error(event)}"
            ends = f"{agent} measures its pose rightly: {_pose_error(event)} no more"
        case SlowChanged(delay_s=delay_s):
            begins = f"{agent} is slow: each step takes {delay_s:g} s"
            ends = f"{agent} is no longer slow by {delay_s:g} s a step"
        case Starved(cpu_percent=percent, period_s=period_s):
            begins = f"{agent} gets {percent:g} % of the CPU in each {period_s:g} s"
            ends = f"{agent} has the CPU as before, not only {percent:g} % of it"
        case _:
            assert_never(event)
    return ends if event.ends else begins


def _error(event: ClockChanged) -> str:
    offset = [f"{event.offset_s:+g} s"] if event.offset_s else []
    drift = [f"{event.drift_ppm:+g} ppm"] if event.drift_ppm else []
    return ", ".join(offset + drift)


def _pose_error(event: PoseChanged) -> str:
    bias = [f"bias [{_list(event.bias_m)}] m"] if any(event.bias_m) else []
    noise = [f"noise {event.noise_m:g} m"] if event.noise_m else []
    yaw = [f"yaw {event.bias_yaw_deg:+g} deg"] if event.bias_yaw_deg else []
    return ", ".join(bias + noise + yaw)


def _intruded(event: Intruded) -> str:
    if event.nobody is not None:
        return f"intruder: no agent matches {_list(event.nobody)}"
    if event.agents is None:
        return "the intruder ended"
    if not event.agents:
        return f"an intruder without a password opens {event.per_s:g} connections a second"
    agents = ", ".join(f"a{agent}" for agent in event.agents)
    rate = f"{event.per_s:g} messages a second on each key"
    return f"an intruder with the passwords of {agents} puts {rate}"


def _mission(event: MissionRunEvent) -> str:
    to = f", given to a{event.agent}" if event.agent is not None else ""
    match event:
        case FormationGiven():
            return f"new formation {event.formation!r}{to}"
        case FrameGiven():
            return f"new path of the target frame{to}"
    assert_never(event)


def _told_by_agent(
    event: SlotChanged | QueueChanged | RoleChanged | ControllerLogged, queues: Queues
) -> str:
    agent = f"a{event.agent}"
    match event:
        case SlotChanged():
            verb, claim = ("takes", event.place) if event.place else ("gives up", event.before)
            return f"{agent} {verb} {_slot(claim, queues)}"
        case QueueChanged(queue=int(queue)):
            return f"{agent} enters {_queue(queue, queues)}"
        case QueueChanged():
            return f"{agent} leaves its queue"
        case RoleChanged(role=role):
            return f"{agent} {ROLE_WORDS[role]}"
        case ControllerLogged(text=text):
            return f"{agent} says: {text}"
    assert_never(event)


def _slot(claim: tuple[int, int] | None, queues: Queues) -> str:
    if claim is None:
        return "no slot"
    queue, rank = claim
    return f"slot {rank + 1} of {_queue(queue, queues)}"


def _queue(index: int, queues: Queues) -> str:
    """Return a queue by its name; without names, by its number counted from 1."""
    return f"queue {queues[index]}" if index < len(queues) else f"queue number {index + 1}"


def _origin(event: RunEvent) -> str:
    """Return whether the operator or the scenario's timeline asked for an event, if either did."""
    if not isinstance(event, PlannedEvent | ConditionsChanged):
        return ""
    return origin(event.by) if event.planned else " (unplanned)"


def _of_processes(event: LateStart | WorldStopped | Reconnected | DiskFilled) -> str:
    if isinstance(event, DiskFilled):
        return "the disk has room again" if event.over else "the disk is full"
    if isinstance(event, LateStart):
        return f"a{event.agent} starts late: {event.detail}"
    if isinstance(event, WorldStopped):
        return f"the world is {'killed' if event.cause == 'kill' else 'paused'}"
    if event.missing:
        agents = ", ".join(f"a{agent}" for agent in event.missing)
        return f"{agents} not observed again within {event.after_s:g} s"
    return f"every agent is observed again, after {event.after_s:g} s"


def _list(values: Sequence[object]) -> str:
    return ", ".join(map(str, values))
