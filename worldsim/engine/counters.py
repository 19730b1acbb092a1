"""Counters of a run for each agent: links, bytes sent, messages rejected by cause.

A direct link is an agent that is heard. Those that an agent needs are the paper's N_c,i (Sec. 3.4).
"""

from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.messages import CAUSES, Command
from netem.messages import MediumCounters
from netem.wire.channels import CHANNELS


class Links(NamedTuple):
    """Number of links of each agent; row i = agent i, None without a step that counts."""

    mean: list[float | None]
    """Over the agent's steps."""
    most: list[int | None]


class LinkCounter:
    """Counts each agent's links over its steps."""

    def __init__(self, rows: int) -> None:
        self._steps = [0] * rows
        self._total = [0] * rows
        self._most = [0] * rows

    def count(self, agent: int, links: int) -> None:
        """Count one step of an agent that has so many links."""
        self._steps[agent] += 1
        self._total[agent] += links
        self._most[agent] = max(self._most[agent], links)

    def links(self) -> Links:
        """Return each agent's links so far."""
        rows = list(zip(self._steps, self._total, self._most, strict=True))
        return Links(
            mean=[total / steps if steps else None for steps, total, _ in rows],
            most=[most if steps else None for steps, _, most in rows],
        )


class RadioUse:
    """How each agent uses the radio; row i = agent i. tick_hz: ticks per simulated second."""

    def __init__(self, rows: int, tick_hz: float) -> None:
        self._tick_hz = tick_hz
        self._running_ticks = [0] * rows
        self._heard = LinkCounter(rows)
        self._needed = LinkCounter(rows)

    def count_step(self, agent: int, heard: int, needed: int | None) -> None:
        """Count one step of an agent that hears so many others directly, and needs so many of them.

        needed: None for a step without a place in the formation; it does not count.
        """
        self._heard.count(agent, heard)
        if needed is not None:
            self._needed.count(agent, needed)

    def count_tick(self, running: NDArray[np.bool_]) -> None:
        """Count one tick for the agents that are running (N,)."""
        for agent, runs in enumerate(running.tolist()):
            if runs:
                self._running_ticks[agent] += 1

    def heard(self) -> Links:
        """Return each agent's direct links."""
        return self._heard.links()

    def needed(self) -> Links:
        """Return those of each agent's direct links that it needs, N_c,i."""
        return self._needed.links()

    def bytes_per_s(self, counters: MediumCounters | None) -> dict[str, list[float | None]] | None:
        """Return for each channel the payload that each agent sent [bytes/s] while it was running.

        None without counters of the medium.
        """
        if counters is None or not counters.sent_b:
            return None
        running_s = [ticks / self._tick_hz for ticks in self._running_ticks]
        return {
            name: [
                sent_b / time_s if time_s else None
                for sent_b, time_s in zip(
                    counters.sent_b[channel :: len(CHANNELS)], running_s, strict=True
                )
            ]
            for channel, name in enumerate(CHANNELS)
        }


class RejectionCounters:
    """Messages that agents rejected, by cause; those of ended processes stay counted."""

    def __init__(self) -> None:
        self._newest: dict[int, tuple[int, tuple[tuple[int, int], ...]]] = {}
        """By agent: its incarnation, and pairs of an index of CAUSES and a count since then."""
        self._ended: Counter[str] = Counter()
        """Of processes that were replaced, by cause."""

    def update(self, agent: int, command: Command) -> None:
        """Take the counts in an agent's command."""
        incarnation, counts = self._newest.get(agent, (command.incarnation, ()))
        if incarnation != command.incarnation:
            self._ended.update(_named(counts))
        self._newest[agent] = command.incarnation, command.telemetry.rejected

    def by_cause(self) -> dict[str, int]:
        """Return the number of rejected messages by cause, causes in alphabetical order."""
        total = Counter(self._ended)
        for _, counts in self._newest.values():
            total.update(_named(counts))
        return dict(sorted(total.items()))


def _named(counts: Iterable[tuple[int, int]]) -> dict[str, int]:
    return {CAUSES[index]: count for index, count in counts}
