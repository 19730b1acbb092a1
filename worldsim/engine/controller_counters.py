"""What each agent's controller did in a run: how its filter changed it, and what it said by radio.

Row i is agent i, None for an agent without a step.
"""

from typing import Final, NamedTuple

from agent.messages import Report, Telemetry

ACTS_MPS: Final = 1e-3
"""A filter that changes a velocity by less leaves it as it is [m/s]."""


class FilterUse(NamedTuple):
    """How the safety filter changed what each controller wanted, or would have changed it."""

    acted_fraction: list[float | None]  # of the agent's steps
    mean_mps: list[float | None]  # over the steps in which it acted [m/s]; None for none
    most_mps: list[float | None]  # [m/s]


class DatagramUse(NamedTuple):
    """What the controllers said to each other."""

    sent: list[int]
    sent_b: list[int]  # bytes of their own
    received: list[int]
    received_b: list[int]
    oldest_s: list[float | None]  # age of the oldest one received [s]; None for none


class ControllerCounters:
    """Counts each agent's steps."""

    def __init__(self, rows: int) -> None:
        self._steps = [0] * rows
        self._acted = [0] * rows
        self._total_mps = [0.0] * rows
        self._most_mps = [0.0] * rows
        self._said: dict[int, list[int]] = {}
        """By agent: datagrams sent, their bytes, datagrams received, their bytes."""
        self._oldest_s: dict[int, float] = {}
        self._rows = rows

    def count(self, agent: int, telemetry: Telemetry) -> None:
        """Count one step."""
        self._steps[agent] += 1
        change_mps = telemetry.filter_mps
        if change_mps > ACTS_MPS:
            self._acted[agent] += 1
            self._total_mps[agent] += change_mps
            self._most_mps[agent] = max(self._most_mps[agent], change_mps)
        if telemetry.report is not None:
            self._count_datagrams(agent, telemetry.report)

    def _count_datagrams(self, agent: int, report: Report) -> None:
        said = self._said.setdefault(agent, [0, 0, 0, 0])
        for column, number in enumerate((*report.sent, *report.received)):
            said[column] += number
        if report.received[0]:
            self._oldest_s[agent] = max(self._oldest_s.get(agent, 0.0), report.oldest_s)

    def filter_use(self) -> FilterUse:
        """Return what the safety filters have done so far."""
        rows = list(zip(self._steps, self._acted, self._total_mps, self._most_mps, strict=True))
        return FilterUse(
            acted_fraction=[acted / steps if steps else None for steps, acted, _, _ in rows],
            mean_mps=[total / acted if acted else None for _, acted, total, _ in rows],
            most_mps=[most if steps else None for steps, _, _, most in rows],
        )

    def datagram_use(self) -> DatagramUse | None:
        """Return what the controllers have said so far; None where none said anything."""
        if not any(any(said) for said in self._said.values()):
            return None
        rows = [self._said.get(agent, [0, 0, 0, 0]) for agent in range(self._rows)]
        return DatagramUse(
            sent=[said[0] for said in rows],
            sent_b=[said[1] for said in rows],
            received=[said[2] for said in rows],
            received_b=[said[3] for said in rows],
            oldest_s=[self._oldest_s.get(agent) for agent in range(self._rows)],
        )
