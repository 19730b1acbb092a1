"""The table of topics: publisher, subscriber, rate and quality of service of each.

Every key starts with ``qswarm/<run>/``. No other module of the project writes a key.
"""

import re
from dataclasses import dataclass
from typing import NamedTuple

RUN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,119}")


class Topic(NamedTuple):
    """One row of the table."""

    template: str
    """The key after ``qswarm/<run>/``."""
    publisher: str
    """Which process puts; of a query, which one replies."""
    subscriber: str
    """Which process gets; of a query, which one asks."""
    rate: str
    blocking: bool
    """Zenoh's congestion control when free-running: True blocks the publisher of a congested link,
    False drops, which suits what is sent again a tick later. Lockstep always blocks."""
    content: str


TOPICS = {
    "setup": Topic("setup/{id}", "world", "agent", "query, once a start", True, "agent's setup"),
    "medium": Topic("medium", "netem", "world", "query, once a start", True, "seed, conditions"),
    "shard": Topic("medium/{id}", "netem", "world", "query, once a start", True, "of one shard"),
    "orders": Topic("orders", "world", "netem", "at an event", True, "changes, partitions"),
    "control": Topic("control", "world", "operator", "query, at will", True, "missions, faults"),
    "truth": Topic("truth", "world", "netem", "each slot", False, "true positions"),
    "observation": Topic(
        "obs/{id}", "world", "agent", "tick_hz, not in lockstep", False, "own pose and sensors"
    ),
    "command": Topic("cmd/{id}", "agent", "world", "tick_hz", False, "velocity and telemetry"),
    "tx": Topic("radio/tx/{id}", "agent", "netem", "tick_hz", False, "frames to send"),
    "rx": Topic(
        "radio/rx/{id}", "netem", "agent", "tick_hz", False, "frames; observation too in lockstep"
    ),
    "arrivals": Topic("arrivals/{id}", "agent", "world", "1 Hz and at the end", False, "latency"),
    "done": Topic("done/{id}", "netem", "world", "each slot, lockstep", True, "a slot's verdicts"),
    "verdicts": Topic("verdicts", "netem", "world", "1 Hz and at the end", False, "counters"),
    "over": Topic("over", "world", "all", "once", True, "the run has ended"),
    "alive": Topic("alive/{name}", "all", "all", "liveliness", True, "a live process"),
}
PROCESSES = ("world", "netem", "agent", "operator", "all")
"""The kinds of processes in the table; the operator is not part of the fleet."""

EVERY_KEY = "qswarm/**"
"""Matches all keys of all runs."""


def medium_name(shard: int) -> str:
    """Return the process name of one of several mediums; the first is the router."""
    return f"netem-{shard}" if shard else "netem"


def agent_name(agent: int) -> str:
    """Return the process name of an agent."""
    return f"agent-{agent}"


@dataclass(frozen=True, slots=True)
class Keys:
    """The keys of one run. Raises ValueError for a run name that cannot be part of a key."""

    run: str

    def __post_init__(self) -> None:
        if not RUN_NAME.fullmatch(self.run):
            raise ValueError(
                f"run name {self.run!r}: letters, digits, '.', '_' and '-' are allowed, 120 at most"
            )

    def of(self, topic: str, owner: int | str | None = None) -> str:
        """Return the key of a topic; owner: the agent's id, shard or process name in the key."""
        return f"qswarm/{self.run}/" + TOPICS[topic].template.format(id=owner, name=owner)

    def all_of(self, topic: str) -> str:
        """Return the key expression that matches a topic of all owners."""
        return f"qswarm/{self.run}/" + TOPICS[topic].template.format(id="*", name="*")

    @staticmethod
    def any_run(topic: str, owner: int | str | None = None) -> str:
        """Return the key expression that matches a topic in all runs."""
        return "qswarm/*/" + TOPICS[topic].template.format(id=owner)

    @staticmethod
    def run_of(key: str) -> str:
        """Return the run that a key belongs to."""
        return key.split("/", 2)[1]

    @staticmethod
    def owner_of(key: str) -> str:
        """Return the last part of a key: an agent's id or a process name, as text."""
        return key.rsplit("/", 1)[1]
