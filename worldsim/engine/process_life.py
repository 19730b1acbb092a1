"""The life of an agent's process: its states and transitions, in one table.

Every change of a process's state goes through :func:`next_state`. The diagram in
docs/architecture.md is :func:`diagram` of this table.
"""

from enum import Enum
from typing import Literal


class State(Enum):
    """The state of an agent's process."""

    ABSENT = "absent"
    """The agent has not joined yet: it has no process and no vehicle."""
    BOOTING = "booting"
    """The process was started; the agent does not step until boot_s has passed."""
    RUNNING = "running"
    """The agent steps."""
    PAUSED = "paused"
    """The process is stopped; the vehicle hovers when the last command has expired."""
    DEAD = "dead"
    """The process has ended; the vehicle hovers."""
    GONE = "gone"
    """The process has ended, and the vehicle has left the world."""


Cause = Literal["join", "boot", "pause", "resume", "kill", "leave", "restart", "exit"]
"""The cause of a transition; exit: the process ended unplanned."""

ALIVE = frozenset({State.RUNNING, State.PAUSED})
"""States in which the agent has a radio and a place in the team."""
STARTED = ALIVE | {State.BOOTING}
"""States in which the process exists or is being started."""
ENDED = frozenset({State.DEAD, State.GONE})
"""States from which the agent can restart."""
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
    """A transition that is not in the table."""


def next_state(state: State, cause: Cause) -> State:
    """Return the state after a cause. Raises TransitionError where the table has no row."""
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
