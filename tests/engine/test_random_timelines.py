"""Random timelines of overlapping faults: what is in force at every tick, against a plain model.

The model below is written from docs/faults.md alone, with times in whole tenths of a second. It
shares no code with the engine. Faults nest, cross, repeat, end by their name, and begin and end at
one time.
"""

from dataclasses import dataclass, field
from random import Random
from typing import Any

import pytest
from msgspec.structs import replace

from netem.conditions import NetworkConditions
from tests.engine.test_timeline_effects import scenario
from worldsim.engine.process_life import ALIVE, ENDED, State
from worldsim.engine.step import SlotLoop, world_of
from worldsim.judge.fault_spans import FaultSpans
from worldsim.judge.radio_events import RadioRunEvent, order_of
from worldsim.results.fault_rows import FaultRow, fault_rows

AGENTS = 4
UNTIL = 80
"""The end of a timeline [0.1 s]."""
BOOT = 10
"""How long an agent boots by default [0.1 s]."""
RADIO = ("partition", "jam", "flap", "netem", "sabotage")
DOWN = ("kill", "leave")
OF_AGENTS = {
    "sensor": "mode = 'silent'",
    "sabotage": "kind = 'spoof'",
    "intruder": "per_s = 9",
}
"""Kinds with a table of agents, and the table's other key."""
KINDS = (*DOWN, "pause", "sensor", "intruder", *RADIO)


@dataclass
class Fault:
    """An event of a timeline; times in 0.1 s, ``at`` and ``lasts`` of each of its repetitions."""

    kind: str
    at: int
    agents: tuple[int, ...] = ()
    lasts: int | None = None
    every: int | None = None
    value: int = 0
    name: str = ""

    def toml(self) -> str:
        """Return the event's keys."""
        times = {"at_s": self.at, "for_s": self.lasts, "every_s": self.every}
        keys = [f"{key} = {value / 10}" for key, value in times.items() if value is not None]
        agents = list(self.agents)
        match self.kind:
            case "partition":
                action = f"partition = [{agents}]"
            case "jam":
                action = f"jam = {{ centre_m = [0, 0, {self.value}], radius_m = 1 }}"
            case "flap":
                action = f"flap = {{ period_s = {1 + self.value} }}"
            case "netem":
                action = f"netem = {{ loss_percent = {self.value} }}"
            case kind if kind in OF_AGENTS:
                action = f"{kind} = {{ agents = {agents}, {OF_AGENTS[kind]} }}"
            case "heal":
                action = "heal = true"
            case "end":
                action = f"end = '{self.name}'"
            case _:
                action = f"{self.kind} = {agents}"
        return "\n".join([*keys, action])


@dataclass
class Model:
    """What holds after all that has happened so far: the ten lines of docs/faults.md."""

    radio: dict[int, Fault] = field(default_factory=dict)
    held: dict[int, set[int]] = field(default_factory=dict)
    """The agents that each process or sensor fault in force holds, by its number."""
    kinds: dict[int, str] = field(default_factory=dict)
    struck: dict[int, set[int]] = field(default_factory=dict)
    """Those that it held at first."""
    up_from: dict[int, int] = field(default_factory=dict)
    """When a restarted agent has booted."""

    def holding(self, agent: int, *kinds: str) -> bool:
        return any(agent in held and self.kinds[n] in kinds for n, held in self.held.items())

    def begin(self, number: int, fault: Fault, now: int) -> None:
        agents = set(fault.agents)
        match fault.kind:
            case "heal":
                parts = {n for n, each in self.radio.items() if each.kind == "partition"}
                self.radio = {n: each for n, each in self.radio.items() if n not in parts}
            case "restart":
                self.restart({each for each in agents if self.holding(each, *DOWN)}, now)
            case "resume":
                down = {each for each in agents if self.holding(each, *DOWN)}
                self.free(agents - down, ("pause",))
            case kind if kind in RADIO:
                self.radio[number] = fault
            case kind:
                if kind == "pause":  # it strikes no agent that is down or booting
                    up = {a for a in agents if now > self.up_from.get(a, -1)}
                    agents = {a for a in up if not self.holding(a, *DOWN)}
                self.held[number] = self.struck[number] = agents
                self.kinds[number] = kind

    def end(self, number: int, now: int) -> None:
        self.radio.pop(number, None)
        held, kind = self.held.pop(number, set()), self.kinds.get(number)
        if kind in DOWN:
            self.restart({each for each in held if not self.holding(each, *DOWN)}, now)

    def restart(self, agents: set[int], now: int) -> None:
        """A new process is held by nothing that struck the old one."""
        self.free(agents, (*DOWN, "pause"))
        self.up_from |= dict.fromkeys(agents, now + BOOT)

    def free(self, agents: set[int], kinds: tuple[str, ...]) -> None:
        """Undo what holds some agents; a fault that holds none any more is over."""
        for number, held in list(self.held.items()):
            if self.kinds[number] in kinds and held & agents:
                self.held[number] = held - agents
        freed = [n for n, held in self.held.items() if not held and self.struck[n]]
        for number in freed:
            del self.held[number]

    def state(self, agent: int, now: int) -> str:
        """Return whether an agent is down, booting, paused or up."""
        if self.holding(agent, *DOWN):
            return "down"
        if now < self.up_from.get(agent, -1):
            return "booting"
        return "paused" if self.holding(agent, "pause") else "up"

    @property
    def in_force(self) -> set[int]:
        """The numbers of all faults in force, also of those that struck nobody."""
        return {*self.radio, *self.held}


def drawn(random: Random) -> list[Fault]:
    """Return a timeline: up to eight overlapping faults, what undoes them, and early ends."""
    faults = [_drawn_fault(random, random.choice(KINDS)) for _ in range(random.randint(2, 8))]
    for kind in ("restart", "resume"):
        if random.random() < 0.5:
            faults.append(Fault(kind, random.randrange(UNTIL), _drawn_agents(random)))
    for number, each in enumerate(faults):
        last = each.at + (each.lasts or UNTIL) if each.every is None else UNTIL
        if each.kind in KINDS and random.random() < 0.2 and each.at + 1 < min(last, UNTIL):
            at = random.randrange(each.at + 1, min(last, UNTIL))
            faults.append(Fault("end", at, name=f"{each.kind}-{number}"))
    return _with_heal(random, faults)


def _drawn_fault(random: Random, kind: str) -> Fault:
    lasts = random.choice((None, random.randint(1, 40), 10))
    every = random.choice((None, None, random.randint(11, 40)))
    if every is not None and lasts is not None and every <= lasts:
        every = lasts + 5
    at, value = random.randrange(0, UNTIL, random.choice((1, 10))), random.randint(1, 90)
    return Fault(kind, at, _drawn_agents(random), lasts, every, value)


def _drawn_agents(random: Random) -> tuple[int, ...]:
    return tuple(sorted(random.sample(range(AGENTS), random.randint(1, AGENTS - 1))))


def _with_heal(random: Random, faults: list[Fault]) -> list[Fault]:
    """Add a heal where a partition is in force for sure: after one that has no end."""
    lasting = [each.at for each in faults if each.kind == "partition" and each.lasts is None]
    ended = {each.name for each in faults}
    named = {f"partition-{n}" for n in range(len(faults))}
    if lasting and not ended & named and lasting[0] + 1 < UNTIL:
        faults.append(Fault("heal", random.randrange(lasting[0] + 1, UNTIL)))
    return faults


def happenings(faults: list[Fault]) -> list[tuple[int, bool, int, Fault]]:
    """Return (time, begins, number, fault): at one time, what ends before what begins."""
    stops = {each.name: each.at for each in faults if each.kind == "end"}
    found, number = [], len(faults)
    times = [(n, n, each, each.at) for n, each in enumerate(faults)]
    for index, each in enumerate(faults):
        stop = min(stops.get(f"{each.kind}-{index}", UNTIL), UNTIL)
        for at in range(each.at + (each.every or UNTIL), stop, each.every or UNTIL):
            times.append((number, index, each, at))
            number += 1
    for own, index, each, at in times:
        if each.kind == "end":
            continue
        found.append((at, True, own, each))
        ends = [at + each.lasts] if each.lasts is not None else []
        stop = stops.get(f"{each.kind}-{index}")
        ends += [stop] if stop is not None else []
        if ends:
            found.append((min(ends), False, own, each))
    return sorted(found, key=lambda each: each[:3])


def seen(state: State) -> str:
    """Return a state of the engine as the model names it."""
    if state in ENDED:
        return "down"
    if state in ALIVE:
        return "paused" if state is State.PAUSED else "up"
    return "booting"


def loss_percent(model: Model) -> float:
    """Return the loss in force: that of the change that began last."""
    changes = [each.value for each in model.radio.values() if each.kind == "netem"]
    return changes[-1] if changes else 0


def check(faults: list[Fault]) -> int:
    """Fly a timeline on a world without radio, compare each tick; return how many ticks there were.

    The conditions that the judge derives from the events must be those of the medium.
    """
    parsed = scenario(*(each.toml() for each in faults))
    fleet = replace(parsed.fleet, tick_hz=5.0)
    flown = replace(parsed, duration_s=UNTIL / 10, fleet=fleet)
    loop = SlotLoop(flown, world_of(flown, command_ticks=1))
    model, told, heard, ticks = Model(), NetworkConditions(flown.netem), 0, 0
    waiting = happenings(faults)
    while loop.world.time_s < UNTIL / 10:
        now = round(10 * loop.world.time_s, 6)
        for operation in loop.due():
            loop.apply(operation)
        while waiting and waiting[0][0] <= now:
            at, begins, number, fault = waiting.pop(0)
            if begins:
                model.begin(number, fault, at)
            else:
                model.end(number, at)
        for event in loop.events[heard:]:
            if isinstance(event, RadioRunEvent):
                told.apply(order_of(event))
        heard = len(loop.events)
        where = f"at {now / 10} s of\n" + "\n".join(each.toml() for each in faults)
        assert set(loop.network.in_force) == set(model.radio), where
        assert told.in_force == loop.network.in_force, where
        assert told.conditions == loop.network.conditions, where
        assert (loop.network.conditions.loss_percent or 0) == loss_percent(model), where
        states = [seen(loop.members.state(agent)) for agent in range(AGENTS)]
        assert states == [model.state(agent, now) for agent in range(AGENTS)], where
        silent = {agent for agent in range(AGENTS) if model.holding(agent, "sensor")}
        assert loop.world.sensor_faults.agents == silent, where
        assert set(loop.effects.faults.in_force) == model.in_force, where
        loop.open()
        loop.close(b"")
        ticks += 1
    spans = FaultSpans(flown, operated=False).rows(loop.events)
    assert spans == told_of(fault_rows(loop.effects.faults.all, {}, {}, {}, {})), where
    return ticks


def told_of(rows: list[FaultRow]) -> dict[str, dict[str, Any]]:
    """Return what events and scenario tell of a run's faults, by their numbers."""
    keys = ("number", "kind", "from_s", "to_s", "by", "agents", "process", "settings")
    return {str(row["number"]): {key: row[key] for key in keys} for row in rows}  # type: ignore[literal-required]


@pytest.mark.parametrize("block", range(10))
def test_what_is_in_force_is_what_the_documentation_says(block: int) -> None:
    for seed in range(30 * block, 30 * block + 30):
        assert check(drawn(Random(seed))) > 0
