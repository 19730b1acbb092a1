"""Deeds carried out on real processes in lockstep: each has happened before anybody goes on."""

from collections.abc import Callable, Iterable, Sequence

from netem.messages import RadioOrder
from netem.wire.barrier import ANSWER_WITHIN_S, LockstepError, UnwantedError
from worldsim.engine.meaning import Deed
from worldsim.engine.membership import Begin, Hold, Stop
from worldsim.fleet.launcher_link import Outside
from worldsim.fleet.progress import Standstill
from worldsim.fleet.startup import Muster
from worldsim.scenario.timeline import Change, Flapping, Heal, Jamming, Partition

LOOK_EVERY_S = 0.02


class Grip:
    """What lockstep reaches the other processes with, and waits for them.

    watch: raises LockstepError when somebody is lost who should not be; unwanted: whether the run
    is over.
    """

    def __init__(
        self,
        muster: Muster,
        outside: Outside,
        watch: Callable[[], None],
        unwanted: Callable[[], bool],
    ) -> None:
        self._muster = muster
        self._outside = outside
        self._watch = watch
        self._unwanted = unwanted
        self._orders: list[RadioOrder] = []

    def do(self, deed: Deed, incarnations: Sequence[int]) -> None:
        """Carry out a deed; what is ordered of the medium waits for ``orders``.

        A process starts when its agent has booted: until then there is nothing for it to do.
        incarnations: everybody's, as they were before the deed. Raises LockstepError when it does
        not come to pass, UnwantedError when the run ends meanwhile.
        """
        match deed:
            case Stop(agents=agents):
                self._act("kill", agents, incarnations)
                self._until(lambda: not self._muster.present(agents), f"the end of {agents}")
            case Hold(kind=kind, agents=agents):
                self._act(kind, agents, incarnations)
            case Begin(agents=agents):
                self._begin(agents, incarnations)
            case Change() | Partition() | Heal() | Jamming() | Flapping():
                self._orders.append(deed.order)

    def orders(self) -> tuple[RadioOrder, ...]:
        """Return, and forget, what the medium is to do before the next slot."""
        orders = tuple(self._orders)
        self._orders.clear()
        return orders

    def _begin(self, agents: tuple[int, ...], incarnations: Sequence[int]) -> None:
        self._muster.expect({agent: incarnations[agent] for agent in agents})
        self._act("start", agents, incarnations)
        self._until(lambda: self._up(agents), f"a sign of life of {agents}")

    def _up(self, agents: tuple[int, ...]) -> bool:
        self._muster.instruct_agents()
        self._watch()
        return not self._muster.absent(agents)

    def _act(self, kind: str, agents: Iterable[int], incarnations: Sequence[int]) -> None:
        whom = [(agent, incarnations[agent]) for agent in agents]
        if whom:
            self._outside.act(kind, whom)
            self._until(lambda: self._outside.has_done(kind, whom), f"a {kind} of {whom}")

    def _until(self, there: Callable[[], bool], what: str) -> None:
        waited_s, standstill = 0.0, Standstill(what, self._outside)
        while not there():
            if self._unwanted():
                raise UnwantedError
            if waited_s > ANSWER_WITHIN_S:
                raise LockstepError(f"{what} has not come within {ANSWER_WITHIN_S:g} s")
            self._outside.wait(LOOK_EVERY_S)
            waited_s += LOOK_EVERY_S
            standstill.lasts(LOOK_EVERY_S)
