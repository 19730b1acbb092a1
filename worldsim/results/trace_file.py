"""The trace of a run as a file, and the slot at which two of them part.

A line of JSON for each slot: checksums of the agents' poses, of their commands, and of the radio's
verdicts. It is written where a run is flown twice to be verified.
"""

import json
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

from worldsim.engine.trace import TraceLog

TRACE_FILE = "trace.jsonl"


class TraceParting(NamedTuple):
    """The first difference between two traces."""

    slot: int
    what: str  # which message, and of which agent


def write_trace(log: TraceLog, folder: Path) -> None:
    """Write the trace of a run into its folder. Raises OSError."""
    with (folder / TRACE_FILE).open("w", encoding="utf-8") as file:
        for poses, commands, verdicts in zip_longest(log.poses, log.commands, log.verdicts):
            file.write(json.dumps([poses, commands, verdicts]) + "\n")


def trace_parting(first: Path, second: Path) -> TraceParting | None:
    """Return where the traces in two run folders part; None: they are equal. Raises OSError."""
    for slot, (one, other) in enumerate(zip_longest(_slots(first), _slots(second))):
        what = _difference(one, other)
        if what is not None:
            return TraceParting(slot, what)
    return None


def slots_in(folder: Path) -> int:
    """Return the number of slots in a run folder's trace. Raises OSError."""
    return sum(1 for _ in _slots(folder))


def remove_trace(folder: Path) -> None:
    """Remove the trace from a run folder. Raises OSError."""
    (folder / TRACE_FILE).unlink(missing_ok=True)


def _slots(folder: Path) -> Iterator[Any]:
    with (folder / TRACE_FILE).open(encoding="utf-8") as file:
        yield from map(json.loads, file)


def _difference(one: Any, other: Any) -> str | None:
    """Return what differs first in a slot, in the order in which it comes to be."""
    if one is None or other is None:
        return f"the {'first' if one is None else 'second'} run has ended"
    (poses, commands, verdicts), (poses_2, commands_2, verdicts_2) = one, other
    if poses != poses_2:
        agent = next(
            agent for agent, pair in enumerate(zip_longest(poses, poses_2)) if pair[0] != pair[1]
        )
        return f"the pose of agent {agent}"
    if commands != commands_2:
        agents = sorted(commands.keys() | commands_2.keys(), key=int)
        agent = next(each for each in agents if commands.get(each) != commands_2.get(each))
        return f"the command of agent {agent}"
    return "the radio's verdicts on the frames of this slot" if verdicts != verdicts_2 else None
