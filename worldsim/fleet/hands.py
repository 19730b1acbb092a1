"""Deeds carried out on real processes: orders to the medium, starts and signals by the launcher.

Nothing is waited for: what was asked for is done within milliseconds, or said to be late.
"""

from collections.abc import Iterable, Sequence

import msgspec

from netem.messages import Orders
from netem.wire.bus import Post
from worldsim.engine.meaning import Deed
from worldsim.engine.membership import Begin, Hold, Start, Stop
from worldsim.fleet.launcher_link import Outside
from worldsim.fleet.startup import Muster
from worldsim.scenario.timeline import Change, Flapping, Heal, Jamming, Partition

START_WITHIN_S = 5.0
"""So long before the end of a long boot a process begins, which waits 30 s for word and no more."""


class Hands:
    """What a flight reaches the other processes with; boot_s: on the wall clock."""

    def __init__(self, post: Post, muster: Muster, outside: Outside, boot_s: float) -> None:
        self._orders = post.putter("orders")
        self._muster = muster
        self._outside = outside
        self._after_s = max(0.0, boot_s - START_WITHIN_S)

    def do(self, deed: Deed, slot: int, incarnations: Sequence[int]) -> list[int]:
        """Carry out a deed before a slot; return the agents that should be there, and are not.

        incarnations: everybody's, as they were before the deed.
        """
        match deed:
            case Stop(agents=agents):
                self._outside.act("kill", _named(agents, incarnations))
            case Hold(kind=kind, agents=agents):
                self._outside.act(kind, _named(agents, incarnations))
            case Start(incarnations=started):
                self._muster.expect(started)
                self._outside.act("start", list(started.items()), self._after_s)
            case Begin(agents=agents):
                return self._muster.absent(agents)
            case Change() | Partition() | Heal() | Jamming() | Flapping():
                self._orders(msgspec.json.encode(Orders(slot, (deed.order,))))
        return []


def _named(agents: Iterable[int], incarnations: Sequence[int]) -> list[tuple[int, int]]:
    return [(agent, incarnations[agent]) for agent in agents]
