"""What the colours of a run mean, in words: a panel that changes with the formation."""

from collections.abc import Sequence

from worldsim.recording import palette

MAX_ROWS = 16
"""Of more queues, the first are listed."""
STATES = (
    ("red", "in distress: without a place in a queue"),
    ("grey, a wire box", "paused"),
    ("black, a white cross", "its process is dead; it hovers"),
    ("pale", "without a place yet"),
)


def queue_legend(formation: str, queues: Sequence[str]) -> str:
    """Return the legend of a formation by its name and the names of its queues, as Markdown."""
    rows = [f"| {_colour(index)} | queue {name} |" for index, name in enumerate(queues)]
    more = [f"| ... | {len(rows) - MAX_ROWS} queues more |"] if len(rows) > MAX_ROWS else []
    head = f"**Formation {formation}.** A vehicle has the colour of its queue."
    shared = "| gold | the vertex that queues share |"
    return "\n".join([head, "", *_table([*rows[:MAX_ROWS], *more, shared])])


def agent_legend() -> str:
    """Return the legend of agents of which none has claimed a place, as Markdown."""
    head = "**No formation.** Each agent has a colour of its own, in its label and its curves."
    return "\n".join([head, "", *_table([])])


def _table(rows: Sequence[str]) -> list[str]:
    states = [f"| {colour} | {meaning} |" for colour, meaning in STATES]
    return ["| colour | meaning |", "|---|---|", *rows, *states]


def _colour(queue: int) -> str:
    names = palette.QUEUE_COLOUR_NAMES
    return names[queue % len(names)]
