"""Counters of a run for each agent: direct links, bytes sent, messages rejected by cause.

Direct links are the paper's N_c,i (Sec. 3.4): they need not grow with the team.
"""

from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agent.messages import CAUSES, Command
from netem.messages import MediumCounters
from netem.wire.channels import CHANNELS


class RadioUse:
    """Counts for each row of a fleet; tick_hz: ticks in a second."""

    def __init__(self, rows: int, tick_hz: float) -> None:
        self._tick_hz = tick_hz
        self._awake_ticks = np.zeros(rows, dtype=np.int64)
        self._steps = [0] * rows
        self._links = [0] * rows
        self._most = [0] * rows

    def note(self, agent: int, heard: int) -> None:
        """Take how many neighbours an agent hears at one of its steps."""
        self._steps[agent] += 1
        self._links[agent] += heard
        self._most[agent] = max(self._most[agent], heard)

    def tick(self, awake: NDArray[np.bool_]) -> None:
        """Take who takes part at a tick (N,)."""
        self._awake_ticks += awake

    def links(self) -> dict[str, Any]:
        """Return direct links of each agent, mean over its steps and most; None without a step."""
        stepped = list(zip(self._steps, self._links, self._most, strict=True))
        return {
            "mean": [links / steps if steps else None for steps, links, _ in stepped],
            "most": [most if steps else None for steps, _, most in stepped],
        }

    def bytes_per_s(
        self, medium_counters: MediumCounters | None
    ) -> dict[str, list[float | None]] | None:
        """Return for each channel what each agent sent in a second of its taking part [bytes/s].

        Payloads alone; None where the radio told of nothing.
        """
        if medium_counters is None or not medium_counters.sent_b:
            return None
        seconds = (self._awake_ticks / self._tick_hz).tolist()
        return {
            name: [
                spoken / flown_s if flown_s else None
                for spoken, flown_s in zip(
                    medium_counters.sent_b[channel :: len(CHANNELS)], seconds, strict=True
                )
            ]
            for channel, name in enumerate(CHANNELS)
        }


class RejectionCounters:
    """Counts by cause, as commands tell them; those of processes that are gone stay counted."""

    def __init__(self) -> None:
        self._told: dict[tuple[int, int], tuple[tuple[int, int], ...]] = {}

    def note(self, agent: int, command: Command) -> None:
        """Take what an agent tells of itself."""
        self._told[agent, command.incarnation] = command.telemetry.rejected

    def by_cause(self) -> dict[str, int]:
        """Return how many were refused for which cause, causes in alphabetical order."""
        total: Counter[str] = Counter()
        for told in self._told.values():
            total.update({CAUSES[index]: count for index, count in told})
        return dict(sorted(total.items()))
