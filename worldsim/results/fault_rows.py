"""Proof of effect: what each fault of a run struck, for summary.json and in words."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, TypedDict

from worldsim.engine.fault_reports import FaultReport

MAX_AGENTS_NAMED = 8
"""More agents are told by their number."""
MAX_IDLE_NAMED = 3
"""So many idle faults are named in the reason of an outcome."""
READ = {
    "sensor": "reading",
    "clock": "clock reading",
    "pose": "measured pose",
}
"""What the faults change that strike what agents read, by kind."""
STEPS = {
    "slow": "slowed",
    "starve": "suppressed",
}
"""What the faults do that strike agents' steps, by kind."""
MAX_KEYS_TOLD = 3
"""So many keys of a change of the radio's conditions are told with it."""
MAX_TOLD = 20
"""So many faults have a line of their own in the verdict."""


class FaultRow(TypedDict):
    """A fault of the run and what it struck; None for what a fault of its kind does not strike."""

    number: int  # as in events.jsonl
    kind: str  # the event's key
    from_s: float
    to_s: float | None  # None: in force to the end
    by: str | None  # "operator", or None for the timeline
    agents: list[int] | None  # those that it struck; of sabotage, with a saboteur
    frames: int | None  # times the links on which the fault cut, altered or sent them
    steps: int | None  # that took long, or did not take place
    readings: int | None  # of sensors or clocks, that differ from the true ones
    messages: int | None  # of an intruder; None where there is no router, too
    process: str | None  # "netem" or "world", of a fault that strikes no agent
    observations: int | None  # that no agent got while netem was down
    stopped_s: float | None  # wall time that the world stood still; None in virtual time, too
    writes: int | None  # of events and recording, that failed on a full disk
    settings: dict[str, Any] | None
    """The keys of a fault of the radio; of netem each as {"from": before, "to": after}, where null
    is no limit, or no such loss."""


def fault_rows(
    faults: Sequence[FaultReport],
    frames: Mapping[int, int] | None,
    readings: Mapping[int, int],
    steps: Mapping[int, int],
    messages: Mapping[int, int],
) -> list[FaultRow]:
    """Return the faults with what they struck.

    frames, readings, steps, messages: of each fault, by its number; frames None: nobody counted
    them.
    """
    return [
        {
            "number": each.number,
            "kind": each.kind,
            "from_s": each.from_s,
            "to_s": each.to_s,
            "by": each.by,
            "agents": each.agents if _strikes_agents(each) else None,
            "frames": frames.get(each.number, 0) if each.on_radio and frames is not None else None,
            "steps": steps.get(each.number, 0) if each.kind in STEPS else None,
            "readings": readings.get(each.number, 0) if each.kind in READ else None,
            "messages": messages.get(each.number),
            "process": each.process,
            "observations": each.observations if each.process == "netem" else None,
            "stopped_s": None if each.stopped_s is None else round(each.stopped_s, 3),
            "writes": each.writes if each.kind == "disk_full" else None,
            "settings": dict(each.settings) if each.on_radio else None,
        }
        for each in faults
    ]


def _strikes_agents(fault: FaultReport) -> bool:
    return (
        fault.process is None
        and fault.kind != "disk_full"
        and (not fault.on_radio or fault.kind == "sabotage")
    )


def idle_text(rows: Sequence[FaultRow]) -> str | None:
    """Return which faults struck nothing, in words; None where each struck something."""
    idle = [_idle(row) for row in rows if _is_idle(row)]
    left = len(idle) - MAX_IDLE_NAMED
    named = idle if left <= 0 else [*idle[:MAX_IDLE_NAMED], f"{left} more"]
    return f"{' and '.join(named)} struck nothing" if idle else None


def _idle(row: FaultRow) -> str:
    """Return a fault that struck nothing, with the reason where it is known."""
    reasons = "".join(f" ({why})" for why in _why_idle(row))
    return f"the {_what(row)} at {_rounded(row['from_s'])} s{reasons}"


def _why_idle(row: FaultRow) -> tuple[str, ...]:
    """Return why a fault struck nothing: none or one reason."""
    return ("nothing was to be written meanwhile",) if row["writes"] is not None else ()


def _is_idle(row: FaultRow) -> bool:
    keys = ("frames", "readings", "steps", "messages", "observations", "stopped_s", "writes")
    counts: list[float | None] = [row[key] for key in keys]  # type: ignore[literal-required]
    counted = row["readings"] is not None or row["steps"] is not None or row["kind"] == "intruder"
    if not counted and row["agents"] is not None:
        counts.append(len(row["agents"]))
    return any(count == 0 for count in counts)


def fault_texts(rows: Sequence[FaultRow]) -> list[str]:
    """Return a line for each of the first faults: what it was, when, and what it struck."""
    left = len(rows) - MAX_TOLD
    more = [f"{_counted(left, 'more fault')}: see summary.json"] if left > 0 else []
    return [f"{_when(row)}: {_struck(row)}" for row in rows[:MAX_TOLD]] + more


def _when(row: FaultRow) -> str:
    by = f" by the {row['by']}" if row["by"] is not None else ""
    begins = _rounded(row["from_s"])
    until = "the end" if row["to_s"] is None else f"{_rounded(row['to_s'])} s"
    span = f"at {begins} s" if until == f"{begins} s" else f"{begins} s to {until}"
    return f"{_what(row)}{_changed(row)}{by}, {span}"


def _changed(row: FaultRow) -> str:
    """Return what a change of the radio's conditions set, in brackets; nothing of other faults."""
    if row["kind"] != "netem" or not row["settings"]:
        return ""
    told = [
        f"{key} {_value(each['from'])} to {_value(each['to'])}"
        for key, each in row["settings"].items()
    ]
    left = len(told) - MAX_KEYS_TOLD
    more = [f"{left} more"] if left > 0 else []
    return f" ({', '.join(told[:MAX_KEYS_TOLD] + more)})"


def _value(value: Any) -> str:
    if value is None or value == inf:
        return "none"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {_value(each)}' for key, each in value.items())}}}"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _what(row: FaultRow) -> str:
    return row["kind"] if row["process"] is None else f"{row['kind']} of {row['process']}"


def _struck(row: FaultRow) -> str:
    if _is_idle(row):
        return ": ".join(("struck nothing", *_why_idle(row)))
    if row["process"] is not None or row["writes"] is not None:
        return _stop(row)
    agents = _named(row["agents"] or [])
    if row["steps"] is not None or row["readings"] is not None:
        return f"{_of_agents(row)} of {agents}"
    if row["kind"] == "intruder":
        return _put(row["messages"])
    if row["frames"] is not None:
        return _frames(row["kind"], _counted(row["frames"], "frame"), agents)
    return f"struck {agents}" if row["agents"] else "not counted"


def _of_agents(row: FaultRow) -> str:
    """Return what a fault of agents did to what they read, or to their steps."""
    if row["steps"] is not None:
        return f"{STEPS[row['kind']]} {_counted(row['steps'], 'step')}"
    return f"changed {_counted(row['readings'] or 0, READ[row['kind']])}"


def _put(messages: int | None) -> str:
    if messages is None:
        return "left out: it needs processes that run freely"
    return f"put {_counted(messages, 'message')}"


def _frames(kind: str, frames: str, agents: str) -> str:
    if kind == "sabotage":
        return f"sent others {frames} by the radio of {agents}"
    return f"{'changed the links of' if kind == 'netem' else 'cut'} {frames}"


def _stop(row: FaultRow) -> str:
    """Return what a fault of netem, the world or its disk did."""
    if row["writes"] is not None:
        return f"let {_counted(row['writes'], 'write')} fail"
    if row["observations"] is not None:
        return f"kept {_counted(row['observations'], 'observation')} from agents"
    if row["stopped_s"] is not None:
        return f"the world stood still for {row['stopped_s']:.3g} s of wall time"
    if row["kind"] == "pause":
        return "left out: virtual time has no process of the world to stop"
    return "ended the run"


def _named(agents: Sequence[int]) -> str:
    names = ", ".join(f"a{agent}" for agent in agents)
    return names if len(agents) <= MAX_AGENTS_NAMED else f"{len(agents)} agents"


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _rounded(time_s: float) -> str:
    return f"{round(time_s, 2):g}"
