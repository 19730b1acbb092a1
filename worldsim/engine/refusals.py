"""What agents refused to believe, by cause: of each process the last word, of all the sum."""

from collections import Counter

from agent.messages import CAUSES, Command


class Refusals:
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
