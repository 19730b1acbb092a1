"""Which labels of the census an agent tells as news, and how often.

An event is told again where statements are lost, until enough tellings of it were heard or made. An
agent counts the tellings of its neighbours like its own, but for the one from which it has the news
(Trickle's redundancy, RFC 6206). So each agent of a dense team tells it once, and each agent of a
line as often as its next neighbour needs. A question is asked again by itself, and so is told once.
"""

from __future__ import annotations

from typing import Final

OWN: Final = -1
"""Source of news that came from no summary."""


class LabelNews:
    """The news that one agent has for its neighbours, by member.

    enough: how many tellings of an event are enough; tellings: how many there were of each event
    that others are still to be told of, by member.
    """

    def __init__(self) -> None:
        self.enough = 1
        self._untold: set[int] = set()
        self.tellings: dict[int, int] = {}
        self._source: dict[int, int] = {}

    @property
    def has_untold(self) -> bool:
        """Whether there is news that was never told."""
        return bool(self._untold)

    def __len__(self) -> int:
        return len(self._untold | self.tellings.keys())

    def add_event(self, member: int, source: int) -> None:
        """Note that a member's code changed. source: who told it."""
        self._untold.add(member)
        self.tellings[member] = 0
        self._source[member] = source

    def add(self, member: int) -> None:
        """Note that a member is asked for, or that a neighbour knows less of it."""
        self._untold.add(member)

    def hear(self, member: int, sender: int) -> None:
        """Note that a neighbour tells what the own agent knows as well."""
        if member in self.tellings and self._source[member] != sender:
            self._count(member)

    def take(self, most: int) -> list[int]:
        """Return the members of one frame: first those never told, then those told least."""
        first = sorted(self._untold)[:most]
        again = sorted(
            self.tellings.keys() - self._untold, key=lambda each: (self.tellings[each], each)
        )
        self._untold.difference_update(first)
        told = first + again[: most - len(first)]
        for member in told:
            self._count(member)
        return sorted(told)

    def _count(self, member: int) -> None:
        """Count a telling of an event."""
        if member in self.tellings:
            self.tellings[member] += 1
            if self.tellings[member] >= self.enough and member not in self._untold:
                del self.tellings[member], self._source[member]
