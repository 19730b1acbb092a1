"""The rows: each is a scenario's text for a seed. To add one, add it to ``ROWS``."""

import random
import tomllib
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from math import ceil
from typing import NamedTuple

import msgspec
import numpy as np

from tests.structure_figures.watch import QUIET_S
from worldsim.engine.virtual import fly
from worldsim.scenario.file import parse
from worldsim.scenario.library import SCENARIOS
from worldsim.scenario.tables import Scenario


class Row(NamedTuple):
    """A row of the table."""

    text: Callable[[int], str]
    """The scenario of a seed, as TOML."""
    by_sides: bool = False
    """Whether the partition's first group is replaced by the agents that are then at y > 0."""


RADIOS = {
    "clean": "",
    "lossy": "loss_percent = 50\ndelay_ms = 200\njitter_ms = 40",
    "harsh": "loss_percent = 80\ndelay_ms = 500\njitter_ms = 100",
}
APART_S = {"clean": 25.0, "lossy": 40.0, "harsh": 90.0}
"""Between two changes of a team, by radio [s]."""
WEDGE_S = {9: 60.0, 20: 60.0, 50: 90.0, 100: 140.0}
"""The time in which a wedge has to converge [s]."""
BOX_M = (5.0, 5.0, 3.0)
"""The start of nine agents; larger fleets start at the same density."""
RANGE_M = 6.0
PARTED_FROM_S = 20.0
LINE, LINE_RANGE_M, LINE_NOISE_M = 30, 2.5, 0.12
TURN_FROM_S, TURN_S = 20.0, 92.0
LIBRARY = (
    *("figure-1a-12", "figure-1b-12", "switching-6", "queue-12", "field-6", "split-6"),
    *("part-and-meet-8", "join-leave-12", "crossing-6", "gap-6", "forest-6"),
)


def scenario_of(row: Row, seed: int, settings: Mapping[str, str]) -> Scenario:
    """Return a row's scenario for a seed, with ``settings`` overridden. Raises ScenarioError."""
    overrides = {"seed": str(seed), **settings}
    scenario = parse(row.text(seed), SCENARIOS / "row.toml", overrides)
    return _parted_by_sides(scenario) if row.by_sides else scenario


def _parted_by_sides(scenario: Scenario) -> Scenario:
    """Fly to the partition, and part the team there into the two sides of the plane y = 0."""
    (parting,) = [each for each in scenario.event if each.partition is not None]
    before = msgspec.structs.replace(scenario, duration_s=parting.at_s, event=())
    side = fly(before).loop.world.vehicles.position[:, 1] > 0.0
    if side.all() or not side.any():
        raise ValueError("all agents are on one side")
    group = tuple(np.flatnonzero(side).tolist())
    new = msgspec.structs.replace(parting, partition=(group,))
    events = tuple(new if each is parting else each for each in scenario.event)
    return msgspec.structs.replace(scenario, event=events)


def wedge(
    agents: int, radio: str, range_m: float, lasts_s: float, events: Iterable[str], seed: int
) -> str:
    """Return a wedge that starts in a box at the library's density. lasts_s: less the quiet."""
    scale = (agents / 9) ** (1 / 3)
    size = [ceil(10.0 * side * scale - 1e-6) / 10.0 for side in BOX_M]
    return f"""
name = "wedge-{agents}-{seed}"
duration_s = {lasts_s + QUIET_S}
[fleet]
agents = {agents}
start = {{ kind = "box", size_m = {size} }}
[formation]
file = "pyramidal-wedge"
[netem]
range_m = {range_m}
{RADIOS[radio]}
{"".join(f"[[event]]{chr(10)}{event}{chr(10)}" for event in events)}
"""


def changes(radio: str, *actions: str) -> Row:
    """Return a wedge of nine to which actions happen, each once the last is over."""
    apart_s = APART_S[radio]
    events = [f"at_s = {apart_s * (1 + index)}\n{each}" for index, each in enumerate(actions)]
    return Row(partial(wedge, 9, radio, RANGE_M, apart_s * (2 + len(actions)), events))


def partition(lasts_s: float, radio: str, *, by_sides: bool) -> Row:
    """Return a wedge of nine that is parted in two, at random or by sides, and heals."""

    def text(seed: int) -> str:
        group = sorted(random.Random(f"parted {seed}").sample(range(9), 4))
        event = f"at_s = {PARTED_FROM_S}\nfor_s = {lasts_s}\npartition = [{group}]"
        return wedge(9, radio, RANGE_M, PARTED_FROM_S + lasts_s + 60.0, [event], seed)

    return Row(text, by_sides)


def line_turn(loss_percent: float, seed: int) -> str:
    """Return a line behind one vertex, in order but for noise, whose frame turns by 90 degrees."""
    draw = random.Random(f"line {seed}")
    rank = draw.sample(range(LINE), LINE)
    starts = [[round(draw.gauss(-k, LINE_NOISE_M), 6), *_noise(draw)] for k in rank]
    return f"""
name = "line{LINE}-{seed}"
duration_s = {TURN_FROM_S + TURN_S + 30.0 + QUIET_S}
[fleet]
agents = {LINE}
start = {{ kind = "list", positions_m = {starts} }}
[formation]
name = "line"
vertices = {{ V1 = [0, 0, 0] }}
queue = [{{ name = "Q1", vertices = ["V1"], shape = {{ kind = "ray", direction = [-1, 0, 0] }} }}]
[frame]
waypoints_m = [[0, 0, 0], [0.01, 0, 0], [0.01, 0.01, 0]]
start_s = {TURN_FROM_S}
speed_mps = 0.25
yaw = "path"
turn_dps = {90.0 / TURN_S}
[netem]
range_m = {LINE_RANGE_M}
delay_ms = 20
jitter_ms = 5
loss_percent = {loss_percent}
"""


def _noise(draw: random.Random) -> list[float]:
    return [round(draw.gauss(0.0, LINE_NOISE_M), 6) for _ in range(2)]


def library(name: str, seed: int) -> str:
    """Return a scenario of the library, given QUIET_S more."""
    text = (SCENARIOS / f"{name}.toml").read_text(encoding="utf-8")
    lasts_s = tomllib.loads(text)["duration_s"]
    lines = [line for line in text.splitlines() if not line.startswith("duration_s")]
    return "\n".join([f"duration_s = {lasts_s + QUIET_S}", *lines])


ROWS: dict[str, Row] = {
    **{
        f"wedge-{agents}-{radio}-{range_m}m": Row(
            partial(wedge, agents, radio, float(range_m), lasts_s, ())
        )
        for agents, lasts_s in WEDGE_S.items()
        for radio in ("clean", "lossy")
        for range_m in (6, 3)
    },
    **{f"apex-leaves-{radio}": changes(radio, 'leave = ["vertex:V1"]') for radio in RADIOS},
    **{
        f"join3-leave4-{radio}": changes(radio, "join = 3", 'leave = ["random:4"]')
        for radio in RADIOS
    },
    **{
        f"apex-plus-3-{radio}": changes(radio, 'leave = ["vertex:V1", "random:3"]')
        for radio in RADIOS
    },
    **{
        f"kill-and-hover-{radio}": changes(radio, 'kill = ["vertex:V1"]', 'kill = ["random:1"]')
        for radio in RADIOS
    },
    **{
        f"partition-{how}-{lasts_s}s-{radio}": partition(
            float(lasts_s), radio, by_sides=how == "sides"
        )
        for how in ("sides", "random")
        for lasts_s in (30, 60)
        for radio in ("clean", "lossy")
    },
    **{name: Row(partial(library, name)) for name in LIBRARY},
    **{f"line30-turn-{loss}": Row(partial(line_turn, float(loss))) for loss in (0, 30, 50)},
}
