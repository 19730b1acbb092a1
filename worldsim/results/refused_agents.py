"""Agents of which messages are rejected where they arrive: counted, and those that take no part.

An agent of another make may say what nobody understands, or what nobody may believe. Then it takes
no part, however well the others fly. What a saboteur sends by its radio is not counted here.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Final, Literal, TypedDict

from netem.sender_counts import SenderRow
from worldsim.results.fault_rows import FaultRow

LEAST: Final = 10
"""From so many rejected messages on, an agent of which none is accepted takes no part."""
BY_CHANCE: Final = 1
"""So many may be accepted: the first slot is 0, which a wrong one may be too."""
EXCUSES: Final = frozenset({"slow", "starve", "clock", "pose", "intruder"})
"""Kinds of faults that let an agent say what is rejected, or say it in its name."""
UNTIMELY: Final = frozenset({"ahead", "stale", "repeated", "future", "old"})
"""Causes for which a host that is too slow may let messages be rejected: those of most agents."""
Said = Literal["frames", "transmissions", "commands"]
WHO: Final = {"frames": "whoever hears it", "transmissions": "netem", "commands": "the world"}
"""Who rejects what an agent says."""
CAUSE_WORDS: Final = {
    "ahead": "slots to come",
    "corrupt": "wrong checksums",
    "future": "stamps to come",
    "garbage": "no msgpack",
    "incarnation": "another incarnation",
    "invalid": "not the fields of the wire",
    "malformed": "not the fields of the wire",
    "old": "old stamps",
    "oversize": "too long",
    "repeated": "slots that it has told of",
    "replay": "sequences that it has told of",
    "speed": "faster than a vehicle flies",
    "spoofed": "another agent's id",
    "stale": "old slots",
}
"""Causes in words."""


class RefusedRow(TypedDict):
    """Messages of one kind of an agent, some of which were rejected where they arrive."""

    agent: int
    messages: Said
    accepted: int
    rejected: dict[str, int]  # by cause


def refused_rows(
    frames: Iterable[SenderRow],
    transmissions: Iterable[SenderRow],
    commands: Iterable[SenderRow],
) -> list[RefusedRow]:
    """Return a row for each agent and kind of message of which some were rejected."""
    kinds: list[tuple[Said, Iterable[SenderRow]]] = [
        ("frames", frames),
        ("transmissions", transmissions),
        ("commands", commands),
    ]
    rows = [
        RefusedRow(agent=agent, messages=kind, accepted=accepted, rejected=dict(rejected))
        for kind, counted in kinds
        for agent, accepted, rejected in counted
        if rejected
    ]
    return sorted(rows, key=lambda row: row["agent"])


def refused_texts(rows: Sequence[RefusedRow], faults: Sequence[FaultRow], agents: int) -> list[str]:
    """Return a text for each agent that takes no part: what of it is rejected, and why.

    faults: those of the run; an agent that one of them lets say so is not named. agents: how many
    there are; where messages of half of them are untimely, that is no agent's fault.
    """
    excused = {
        agent for fault in faults if fault["kind"] in EXCUSES for agent in fault["agents"] or ()
    }
    found = [row for row in rows if _takes_no_part(row) and row["agent"] not in excused]
    late = Counter(row["messages"] for row in found if _is_untimely(row))
    return [
        _text(row) for row in found if not _is_untimely(row) or 2 * late[row["messages"]] < agents
    ]


def refused_text(rows: Sequence[RefusedRow], faults: Sequence[FaultRow], agents: int) -> str | None:
    """Return the texts in one; None where every agent takes part."""
    return "; ".join(refused_texts(rows, faults, agents)) or None


def _takes_no_part(row: RefusedRow) -> bool:
    """Return whether all messages of one kind were rejected."""
    return row["accepted"] <= BY_CHANCE and sum(row["rejected"].values()) >= LEAST


def _is_untimely(row: RefusedRow) -> bool:
    return row["rejected"].keys() <= UNTIMELY


def _text(row: RefusedRow) -> str:
    causes = sorted(row["rejected"].items(), key=lambda each: (-each[1], each[0]))
    told = ", ".join(f"{count} {_cause(cause)}" for cause, count in causes)
    share = "all" if row["accepted"] == 0 else f"all but {row['accepted']}"
    kind = row["messages"]
    return f"agent {row['agent']} takes no part: {WHO[kind]} rejects {share} of its {kind} ({told})"


def _cause(cause: str) -> str:
    words = CAUSE_WORDS.get(cause)
    return cause if words is None else f"{cause}: {words}"
