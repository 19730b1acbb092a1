"""Late ticks while intruders attack: who, beside a slow host, may have made them late."""

from collections.abc import Sequence

from worldsim.fleet.overload import percent


class LateUnderAttack:
    """Counts the late ticks of a run, and those of them while each intruder attacked."""

    def __init__(self) -> None:
        self._late = 0
        self._under: dict[int, int] = {}

    def note(self, late: int, intruders: Sequence[int]) -> None:
        """Take new late ticks. intruders: the numbers of the faults that attack now."""
        self._late += late
        for number in intruders if late else ():
            self._under[number] = self._under.get(number, 0) + late

    def __str__(self) -> str:
        """Return the intruders, with the share of the late ticks in their time; or nothing."""
        told = (
            f"{percent(late / self._late)} of them while {name(number)} attacked the router"
            for number, late in self._under.items()
        )
        return ", ".join(told)


def attackers(intruders: Sequence[int]) -> str:
    """Return the intruders that attack now, for a notice; empty without any."""
    if not intruders:
        return ""
    verb = "attacks" if len(intruders) == 1 else "attack"
    return f"{', '.join(map(name, intruders))} {verb} the router"


def name(number: int) -> str:
    """Return the name of an intruder's process, as `qswarm ps` shows it, by its fault's number."""
    return f"intruder-{number}"
