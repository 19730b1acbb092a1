"""The table of keys: who puts what, for whom, how often and with which quality of service.

Every key starts with ``qswarm/<run>/``. Nothing else in the project spells a key.
"""

import re
from dataclasses import dataclass
from typing import NamedTuple

RUN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,119}")


class Topic(NamedTuple):
    """One row of the table.

    ``reliable`` is Zenoh's congestion control in the free-running clock: False drops when a link
    is congested, which is right for everything that is sent again a tick later.
    """

    template: str
    writer: str
    reader: str
    rate: str
    reliable: bool
    what: str


TOPICS = {
    "setup": Topic("setup/{id}", "world", "agent", "query, once a start", True, "agent's setup"),
    "medium": Topic("medium", "netem", "world", "query, once a start", True, "seed, conditions"),
    "shard": Topic("medium/{id}", "netem", "world", "query, once a start", True, "one of several"),
    "orders": Topic("orders", "world", "netem", "at an event", True, "changes, partitions"),
    "control": Topic("control", "world", "operator", "query, at will", True, "missions, faults"),
    "truth": Topic("truth", "world", "netem", "each slot", False, "true positions"),
    "observation": Topic("obs/{id}", "world", "agent", "tick_hz", False, "own pose and sensors"),
    "command": Topic("cmd/{id}", "agent", "world", "tick_hz", False, "velocity and telemetry"),
    "tx": Topic("radio/tx/{id}", "agent", "netem", "tick_hz", False, "frames to send"),
    "rx": Topic("radio/rx/{id}", "netem", "agent", "tick_hz", False, "a batch of frames heard"),
    "arrivals": Topic("arrivals/{id}", "agent", "world", "1 Hz and at the end", False, "delays"),
    "done": Topic("done/{id}", "netem", "world", "each slot, lockstep", True, "a slot's fates"),
    "verdicts": Topic("verdicts", "netem", "world", "1 Hz and at the end", False, "counters"),
    "over": Topic("over", "world", "everybody", "once", True, "the run has ended"),
    "alive": Topic("alive/{name}", "everybody", "everybody", "liveliness", True, "a process lives"),
}


EVERY_KEY = "qswarm/**"
"""Matches all keys of all runs; a medium asks for questions of whichever run."""


def medium_name(shard: int) -> str:
    """Return the name of one of several mediums; the first is the router."""
    return f"netem-{shard}" if shard else "netem"


def agent_name(agent: int) -> str:
    """Return the name of an agent's process."""
    return f"agent-{agent}"


@dataclass(frozen=True, slots=True)
class Keys:
    """The keys of one run. Raises ValueError on a run name that a key cannot carry."""

    run: str

    def __post_init__(self) -> None:
        if not RUN_NAME.fullmatch(self.run):
            raise ValueError(
                f"run name {self.run!r}: letters, digits, '.', '_' and '-' are allowed, 120 at most"
            )

    def of(self, topic: str, who: int | str | None = None) -> str:
        """Return the key of a topic; ``who`` is an agent's id or a process's name where needed."""
        return f"qswarm/{self.run}/" + TOPICS[topic].template.format(id=who, name=who)

    def every(self, topic: str) -> str:
        """Return the key expression that matches a topic of all agents or processes."""
        return f"qswarm/{self.run}/" + TOPICS[topic].template.format(id="*", name="*")

    @staticmethod
    def any_run(topic: str, who: int | str | None = None) -> str:
        """Return the key expression of a topic, of whichever run."""
        return "qswarm/*/" + TOPICS[topic].template.format(id=who)

    @staticmethod
    def run_of(key: str) -> str:
        """Return the run that a key belongs to."""
        return key.split("/", 2)[1]

    @staticmethod
    def who(key: str) -> str:
        """Return the last part of a key: an agent's id or a process's name, as text."""
        return key.rsplit("/", 1)[1]
