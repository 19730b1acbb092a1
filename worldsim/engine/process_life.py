"""The life of an agent's process: every state, every transition, in one table.

Everything that changes a process's state goes through :func:`next_state`. The diagram in
docs/architecture.md is :func:`diagram` of this table.
"""

from enum import Enum
from typing import Literal


class State(Enum):
    """What an agent's process is, and with it the agent's vehicle."""

    ABSENT = "absent"
    """It has not joined yet: there is no process and no vehicle."""
    BOOTING = "booting"
    """It was started, and does not step until boot_s has passed."""
    RUNNING = "running"
    """It steps."""
    PAUSED = "paused"
    """It is stopped; its vehicle hovers once the last command has expired."""
    DEAD = "dead"
    """It has ended; its vehicle hovers."""
    GONE = "gone"
    """It has ended, and its vehicle has left the world."""


Cause = Literal["join", "boot", "pause", "resume", "kill", "leave", "restart", "exit"]
"""What changes a state; exit: the process ended unplanned."""

ALIVE = frozenset({State.RUNNING, State.PAUSED})
"""States in which the process can be signalled and holds its place in the team."""
STARTED = ALIVE | {State.BOOTING}
"""States in which a process exists, or is about to."""
ENDED = frozenset({State.DEAD, State.GONE})
"""States from which an agent can come back."""
KNOWN = STARTED | ENDED
"""States of agents that have an id."""

TRANSITIONS: dict[tuple[State, Cause], State] = {
    (State.ABSENT, "join"): State.BOOTING,
    (State.BOOTING, "boot"): State.RUNNING,
    (State.RUNNING, "pause"): State.PAUSED,
    (State.PAUSED, "resume"): State.RUNNING,
    **{(state, "kill"): State.DEAD for state in (State.BOOTING, State.RUNNING, State.PAUSED)},
    **{(state, "exit"): State.DEAD for state in (State.BOOTING, State.RUNNING, State.PAUSED)},
    **{(state, "leave"): State.GONE for state in (State.BOOTING, State.RUNNING, State.PAUSED)},
    (State.DEAD, "restart"): State.BOOTING,
    (State.GONE, "restart"): State.BOOTING,
}


class TransitionError(RuntimeError):
    """A change of a process's state that the table does not have."""


def next_state(state: State, cause: Cause) -> State:
    """Return the state after a cause. Raises TransitionError where the table has none."""
    try:
        return TRANSITIONS[state, cause]
    except KeyError:
        raise TransitionError(f"a process that is {state.value} cannot {cause}") from None


def diagram() -> str:
    """Return the table as a Mermaid state diagram."""
    lines = ["stateDiagram-v2", "    [*] --> absent", "    [*] --> running"]
    lines += [
        f"    {state.value} --> {after.value}: {cause}"
        for (state, cause), after in TRANSITIONS.items()
    ]
    return "\n".join(lines)
