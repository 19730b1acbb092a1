"""The radio faults in force that keep running agents from hearing each other, by true positions.

A partition, jam or flap counts where it cuts a link between two running agents. A change of the
conditions counts where with it news does not reach all in a bounded time, and would without it.
"""

from itertools import permutations

from netem.conditions import NetworkConditions
from netem.faults import Flap
from netem.link_parameters import Conditions
from worldsim.judge.connectivity import Connectivity
from worldsim.judge.radio_events import (
    ConditionsChanged,
    Flapped,
    Healed,
    Jammed,
    LinkRunEvent,
    Partitioned,
    order_of,
)
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import Scenario


class _Cut:
    """A partition, jam or flap in force. network: with this fault alone."""

    def __init__(self, network: NetworkConditions, flap: Flap | None, partitions: bool) -> None:
        self.network, self.flap, self.partitions = network, flap, partitions
        self.struck = False
        """Whether it has cut a link since it began."""

    def cuts(self, running: list[int], tick: Tick | None) -> bool:
        """Return whether it cuts a link between two running agents now.

        tick: the newest one; None before the first, where nobody counts as jammed.
        """
        if len(running) < 2:
            return False
        if self.flap is not None:
            links, team = self.flap.links, set(running)
            return not links or any(team.issuperset(link) for link in links)
        if self.partitions:
            return any(self.network.partitions(a, b) for a, b in permutations(running, 2))
        if tick is None:
            return False
        return any(self.network.jammed((x, y, z)) for x, y, z in tick.position[running].tolist())


class CuttingFaults:
    """Tells whether partitions, jams, flaps and changed conditions in force part the team."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._cuts: dict[int, _Cut] = {}
        self._changes: set[int] = set()
        """The changes of the conditions in force."""
        self._usual: Connectivity | None = None
        """Without any fault; None as long as no conditions have changed."""
        self._changed: Connectivity | None = None
        """With the changes of conditions alone."""
        self._tick: Tick | None = None
        self._parted = False

    def __bool__(self) -> bool:
        return self._parted

    def see(self, tick: Tick) -> None:
        """Take a tick, before it is judged."""
        self._tick = tick
        if self._cuts or self._changes:
            self._find()

    def handle_event(self, event: LinkRunEvent) -> bool:
        """Take an event; return whether it disturbs the team.

        A fault that has cut no link does not. Before the first tick all agents of the start count
        as running.
        """
        disturbs = True
        match event:
            case ConditionsChanged():
                self._change(event)
            case Healed(number=None):
                healed = [number for number, cut in self._cuts.items() if cut.partitions]
                disturbs = sum(self._end(number) for number in healed) > 0
            case Healed(number=int(number)) | Jammed(jam=None, number=number):
                disturbs = self._end(number)
            case Flapped(flap=None, number=number):
                disturbs = self._end(number)
            case Partitioned() | Jammed() | Flapped():
                disturbs = self._begin(event)
        self._find()
        return disturbs

    def _begin(self, event: Partitioned | Jammed | Flapped) -> bool:
        network = NetworkConditions(Conditions())
        network.apply(order_of(event))
        flap = event.flap if isinstance(event, Flapped) else None
        self._cuts[event.number] = cut = _Cut(network, flap, isinstance(event, Partitioned))
        self._find()
        return cut.struck

    def _end(self, number: int) -> bool:
        ended = self._cuts.pop(number, None)
        return ended is not None and ended.struck

    def _change(self, event: ConditionsChanged) -> None:
        if self._usual is None or self._changed is None:
            self._usual, self._changed = Connectivity(self._scenario), Connectivity(self._scenario)
        self._changed.handle_event(event)
        if event.undone is None:
            self._changes.add(event.number)
        else:
            self._changes.discard(event.number)

    def _find(self) -> None:
        """Find whether the team is parted now."""
        tick = self._tick
        rows = range(self._scenario.fleet.agents)
        running = list(rows) if tick is None else tick.alive.nonzero()[0].tolist()
        cutting = [cut for cut in self._cuts.values() if cut.cuts(running, tick)]
        for cut in cutting:
            cut.struck = True
        self._parted = bool(cutting) or self._severed()

    def _severed(self) -> bool:
        """Return whether changed conditions keep news from reaching all in a bounded time."""
        tick, usual, changed = self._tick, self._usual, self._changed
        if not self._changes or tick is None or usual is None or changed is None:
            return False
        within = zip(usual.spreads(tick), changed.spreads(tick), strict=True)
        return any(without and not with_ for without, with_ in within)
