"""The team: who takes part, who is still booting, who is gone; and whom an action strikes.

A row belongs to one agent for the whole run. Rows of those who have not joined yet are the last.
"""

from math import inf
from typing import Literal, NamedTuple

import numpy as np

from agent.messages import Place, Vector
from agent.qstructure.formation import Formation, FormationSpec
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.tables import Scenario
from worldsim.scenario.timeline import (
    Action,
    Failing,
    Holding,
    Joining,
    Order,
    Revival,
    Strike,
    UponRadio,
)
from worldsim.truth.obstacles import Obstacles
from worldsim.truth.start_positions import StartError, room_of, starts
from worldsim.truth.vehicle import Floats
from worldsim.truth.world import World

RANDOM_KEY = 0xFA17


class Stop(NamedTuple):
    """These agents' processes end now; kind kill or leave says what becomes of their vehicles."""

    number: int
    kind: str
    agents: tuple[int, ...]
    selectors: tuple[int | str, ...]


class Fail(NamedTuple):
    """Agents whose sensors, of a kind or all, fail in a mode; with none they work again."""

    agents: tuple[int, ...]
    sensor: str | None
    mode: Literal["stuck", "silent", "wrong"] | None


class Hold(NamedTuple):
    """These agents' processes are stopped now (kind pause), or go on (resume)."""

    number: int
    kind: str
    agents: tuple[int, ...]
    selectors: tuple[int | str, ...]


class Start(NamedTuple):
    """These agents' processes start now, each with its incarnation; kind: restart or join.

    stands: for those whose vehicle is not in the world where it is put, position [m; world frame]
    and yaw [rad]. refused: why nobody starts, else None.
    """

    number: int
    kind: str
    incarnations: dict[int, int]
    stands: dict[int, tuple[Vector, float]]
    refused: str | None = None


class Begin(NamedTuple):
    """These agents have booted: they take part from now on."""

    agents: tuple[int, ...]


class Team:
    """Everybody's part in a run, by row.

    alive (N,): whose process takes part; awake (N,): who steps, too, for it is not paused.
    """

    def __init__(self, scenario: Scenario) -> None:
        agents, rows = scenario.fleet.agents, scenario.rows
        self._scenario = scenario
        self._obstacles = Obstacles(scenario.obstacle)
        self.alive = np.arange(rows) < agents
        self.awake = self.alive.copy()
        self.incarnations = [0] * rows
        self.known = agents
        self.whole = agents == rows
        self._boots: dict[int, float] = {}
        self._struck: dict[int, tuple[int, ...]] = {}
        start = scenario.fleet.start
        self._origin: list[tuple[BoxStart | ListStart, int]] = [(start, i) for i in range(agents)]

    @property
    def next_boot_s(self) -> float:
        """When the next agent has booted [s]; infinite when none is booting."""
        return min(self._boots.values()) if self._boots else inf

    @property
    def first(self) -> int | None:
        """The lowest id that steps."""
        return int(np.argmax(self.awake)) if self.awake.any() else None

    def has(self, agent: int, incarnation: int | None) -> bool:
        """Whether an agent takes part or boots, in its incarnation; None: in whichever."""
        there = bool(self.alive[agent]) or agent in self._boots
        return there and incarnation in {None, self.incarnations[agent]}

    def booted(self, time_s: float) -> Begin:
        """Return those who have booted by a time [s]."""
        return Begin(tuple(a for a, at_s in sorted(self._boots.items()) if at_s <= time_s + 1e-9))

    def struck(
        self, action: Strike, places: list[tuple[int, int] | None], formation: FormationSpec
    ) -> Stop:
        """Find whom a strike means; places: what each last claimed, in a formation."""
        among = [a for a in range(self.known) if self.alive[a] or a in self._boots]
        agents = self._selected(action.number, action.selectors, among, places, formation)
        return Stop(action.number, action.kind, agents, action.selectors)

    def held(
        self, action: Holding, places: list[tuple[int, int] | None], formation: FormationSpec
    ) -> Hold:
        """Find whose processes are to be stopped, or to go on."""
        if action.kind == "pause":
            among = np.flatnonzero(self.awake).tolist()
        else:
            among = np.flatnonzero(self.alive & ~self.awake).tolist()
        agents = tuple(a for a in self._struck.get(action.number, ()) if a in among)
        if action.selectors:
            agents = self._selected(action.number, action.selectors, among, places, formation)
        return Hold(action.number, action.kind, agents, action.selectors)

    def failed(
        self, action: Failing, places: list[tuple[int, int] | None], formation: FormationSpec
    ) -> Fail:
        """Find whose sensors fail, or work again."""
        among = list(range(self.known))
        agents = self._struck.get(action.number, ())
        if action.selectors:
            agents = self._selected(action.number, action.selectors, among, places, formation)
        self._struck[action.number] = agents
        return Fail(agents, action.sensor, action.mode)

    def revived(self, action: Revival, position: Floats, time_s: float = 0.0) -> Start:
        """Find who comes back at a time [s], and where.

        position (N, 3): of all vehicles [m; world frame].
        """
        among = [a for a in range(self.known) if not self.alive[a] and a not in self._boots]
        agents: tuple[int, ...] = tuple(
            a for a in self._struck.get(action.number, ()) if a in among
        )
        if action.selectors:
            agents = self._selected(action.number, action.selectors, among, [], None)
        incarnations = {agent: self.incarnations[agent] + 1 for agent in agents}
        away = [agent for agent in agents if np.isnan(position[agent, 0])]
        try:
            stands = self._stands_again(action.number, away, position, time_s)
        except StartError as error:
            return Start(action.number, "restart", {}, {}, str(error))
        return Start(action.number, "restart", incarnations, stands)

    def joined(self, action: Joining, position: Floats, time_s: float = 0.0) -> Start:
        """Return the next ids, and where they are put at a time [s]."""
        agents = range(self.known, self.known + action.joiners)
        try:
            where = self._drawn(action.number, action.start, action.joiners, position, time_s)
        except StartError as error:
            return Start(action.number, "join", {}, {}, str(error))
        self._origin += [(action.start, index) for index in range(action.joiners)]
        return Start(
            action.number, "join", dict.fromkeys(agents, 0), dict(zip(agents, where, strict=True))
        )

    def take(self, deed: Stop | Hold | Start | Begin, time_s: float) -> None:
        """Let a deed that was done count from a time [s] on."""
        match deed:
            case Stop(number=number, agents=agents):
                self._struck[number] = agents
                for agent in agents:
                    self.strike_out(agent)
            case Hold(number=number, kind=kind, agents=agents):
                if kind == "pause":
                    self._struck[number] = agents
                self.awake[list(agents)] = kind == "resume"
            case Start(incarnations=incarnations):
                for agent, incarnation in incarnations.items():
                    self.incarnations[agent] = incarnation
                    self._boots[agent] = time_s + self._scenario.fleet.boot_s
                    self.known = max(self.known, agent + 1)
            case Begin(agents=agents):
                for agent in agents:
                    del self._boots[agent]
                    self.alive[agent] = self.awake[agent] = True
        self.whole = bool(self.alive.all())

    def strike_out(self, agent: int) -> None:
        """Let an agent take part no more."""
        self.alive[agent] = self.awake[agent] = self.whole = False
        self._boots.pop(agent, None)

    def _selected(
        self,
        number: int,
        selectors: tuple[int | str, ...],
        among: list[int],
        places: list[tuple[int, int] | None],
        spec: FormationSpec | None,
    ) -> tuple[int, ...]:
        chosen: set[int] = set()
        for selector in selectors:
            if isinstance(selector, int):
                chosen.add(selector)
            elif selector == "all":
                chosen.update(among)
            elif selector.startswith("random:"):
                chosen.update(self._random(number, int(selector.partition(":")[2]), among))
            elif spec is not None:
                awake = [agent for agent in among if self.awake[agent]]
                chosen.update(_placed(selector, awake, places, self._formation(spec)))
        return tuple(agent for agent in among if agent in chosen)

    def _formation(self, spec: FormationSpec) -> Formation:
        return Formation(spec, self._scenario.control.spacing_m)

    def _random(self, number: int, count: int, among: list[int]) -> list[int]:
        key = [self._scenario.seed, number << 20 | RANDOM_KEY]
        generator = np.random.Generator(np.random.Philox(key=key))
        drawn: list[int] = generator.permutation(among)[:count].tolist()
        return drawn

    def _stands_again(
        self, number: int, away: list[int], position: Floats, time_s: float
    ) -> dict[int, tuple[Vector, float]]:
        """Put those who had left where they came from: their listed place, or a new draw."""
        stands: dict[int, tuple[Vector, float]] = {}
        for agent in away:
            start, index = self._origin[agent]
            if isinstance(start, ListStart):
                yaws = start.yaws_deg[index : index + 1] if start.yaws_deg is not None else None
                start = ListStart(positions_m=start.positions_m[index : index + 1], yaws_deg=yaws)
            taken = np.array([where for where, _ in stands.values()]).reshape(-1, 3)
            there = np.concatenate((position, taken))
            stands[agent] = self._drawn((number << 10) + agent, start, 1, there, time_s)[0]
        return stands

    def _drawn(
        self,
        number: int,
        start: BoxStart | ListStart,
        count: int,
        position: Floats,
        time_s: float,
    ) -> list[tuple[Vector, float]]:
        present = position[~np.isnan(position[:, 0])]
        apart_m = self._scenario.control.separation_m
        where, yaws = starts(
            start,
            count,
            self._scenario.seed,
            event=number + 1,
            present=present,
            apart_m=apart_m,
            room=room_of(self._scenario, self._obstacles, time_s),
        )
        return [
            ((x, y, z), yaw) for (x, y, z), yaw in zip(where.tolist(), yaws.tolist(), strict=True)
        ]


def _placed(
    selector: str,
    among: list[int],
    places: list[tuple[int, int] | None],
    formation: Formation,
) -> list[int]:
    """Return those who claim a vertex, or a place of a queue, by its name."""
    word, _, name = selector.partition(":")
    claims = [(agent, Place(*place)) for agent in among if (place := places[agent]) is not None]
    if word == "vertex":
        return [agent for agent, place in claims if place == formation.vertex_places[name]]
    index = [queue.name for queue in formation.queues].index(name)
    return [agent for agent, place in claims if index in formation.queues_of(place)]


Deed = Stop | Hold | Fail | Start | Begin | UponRadio | Order
"""What a clock carries out between slots."""
Places = list[tuple[int, int] | None]


def deed_of(
    action: Action, team: Team, world: World, places: Places, formation: FormationSpec
) -> Deed:
    """Find out whom an action means now; places: what each last claimed, in a formation."""
    match action:
        case Strike():
            return team.struck(action, places, formation)
        case Holding():
            return team.held(action, places, formation)
        case Failing():
            return team.failed(action, places, formation)
        case Revival() | Joining():
            return _come(action, team, world)
    return action


def _come(action: Revival | Joining, team: Team, world: World) -> Start:
    position, time_s = world.fleet.position, world.time_s
    if isinstance(action, Revival):
        return team.revived(action, position, time_s)
    return team.joined(action, position, time_s)
