"""A random scenario of all kinds, as a pure function of a base seed and a number.

``qswarm check`` judges each draft. Where it refuses or warns, the key or table that it names is
left out, and it judges the rest; a draft that does not get through so is drawn anew.
"""

import tempfile
from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from time import process_time
from typing import NamedTuple

from tests.random_flights.properties import properties
from worldsim.commands.app import command
from worldsim.search.drafts import accepted
from worldsim.search.draws import Draw, Tables
from worldsim.search.fleets import (
    agents_that_differ,
    carried,
    comms,
    control,
    fleet,
    sensor,
    vehicle,
)
from worldsim.search.formations import formation
from worldsim.search.radios import conditions
from worldsim.search.surroundings import field, frame, obstacles
from worldsim.search.timelines import Timeline, repeated_and_ended

STEPS = 5_000
"""Steps of all agents together in a flight: so many take one or two seconds."""
MAX_AGENTS = 24
LONGEST_S = 60.0
DRAFTS = 200


class Generated(NamedTuple):
    """A scenario that ``check`` accepts without a warning, and how it came about."""

    text: str
    drafts: int
    """How many were drawn until one got through."""
    objections: Counter[str]
    """The keys that ``check`` named on the way, without their indices."""
    check_s: float = 0.0
    """CPU time of the check that accepted it [s]."""


def scenario(base: int, number: int, steps: int = STEPS) -> Generated:
    """Return the scenario of a base and a number. Raises LookupError where no draft gets through.

    steps: of all agents together, which bounds the length of the flight.
    """
    objections = Counter[str]()
    for attempt in range(DRAFTS):
        tables = draft(Draw(base, number, attempt), steps)
        tables["name"] = f"random-{base}-{number}"
        text = accepted(tables, objections, objection)
        if text is not None:
            begun = process_time()
            assert objection(text) == "", "check says now one thing, now another"
            return Generated(text, attempt + 1, objections, process_time() - begun)
    raise LookupError(f"no draft of {base}/{number} gets through: {objections.most_common(5)}")


def draft(draw: Draw, steps: int) -> Tables:
    """Return the tables of a scenario which ``check`` may still refuse."""
    agents = draw.among((1, 2, 3, draw.whole(2, 9), draw.whole(4, 16), draw.whole(1, MAX_AGENTS)))
    made: Tables = {"seed": draw.whole(0, 2**31), "control": control(draw)}
    separation, spacing = made["control"]["separation_m"], made["control"]["spacing_m"]
    made["fleet"] = fleet(draw, agents, separation)
    tick_hz = made["fleet"]["tick_hz"]
    made["duration_s"] = duration(draw, steps / (agents * tick_hz))
    made["formation"] = formation(draw, agents, spacing, separation + 0.25)
    made["vehicle"] = vehicle(draw, tick_hz)
    made["agent"] = agents_that_differ(draw, agents, tick_hz)
    made["sensor"] = sensor(draw, carried(made["vehicle"], made["agent"]))
    made["comms"] = comms(draw, tick_hz)
    made["netem"] = conditions(draw, agents, spacing)
    about = centre(made["fleet"]["start"])
    slowest = slowest_speed(made)
    made["frame"] = frame(draw, slowest, about)
    if draw.chance(0.5):
        made["obstacle"] = obstacles(draw, slowest, about)
    if draw.chance(0.15):
        made["obstacle_field"] = field(draw, about)
    made["event"] = Timeline(draw, made, slowest).events()
    made["expect"] = expectations(draw, made)
    if draw.chance(0.25):
        made["fleet"]["briefed"] = briefed(draw, agents)
    if draw.chance(0.25):
        made["control"]["allocation"] = "assignment"
    if draw.chance(0.1):
        made["expect"]["attitude_within_deg"] = draw.number(1.0, 180.0, 0)
    if draw.chance(0.25):
        made["control"]["gather"] = may_gather(made["control"])
    if draw.chance(0.1):
        made["expect"] |= {
            "in_formation_fraction": draw.number(0.0, 1.0),
            "max_slot_error_m": draw.number(0.0, 2.0),
            "idle_faults": draw.chance(0.5),
            "min_lambda2": draw.number(0.0, made["fleet"]["agents"]),
        }
    made["event"] = repeated_and_ended(draw, made["event"], made["duration_s"])
    if draw.chance(0.2):
        made["expect"]["property"] = properties(draw, made)
    return made


def may_gather(control: Tables) -> bool:
    """Return whether queues may gather under a control table."""
    by_leaders = control.get("allocation", "structure") == "structure"
    return by_leaders and control.get("controller", "q_structure") == "q_structure"


def briefed(draw: Draw, agents: int) -> list[int]:
    """Return the agents that know the mission at the start: one, some or none."""
    some = sorted(draw.some(range(agents), draw.whole(1, agents)))
    return draw.among(([0], some, []))


def duration(draw: Draw, longest_s: float) -> float:
    longest = min(LONGEST_S, longest_s)
    return draw.number(0.5 * longest, longest, 1) if longest > 1.0 else round(longest + 0.1, 1)


def centre(start: Tables) -> list[float]:
    if start["kind"] == "box":
        return list(start["centre_m"])
    places = start["positions_m"]
    return [round(sum(axis) / len(places), 2) for axis in zip(*places, strict=True)]


def slowest_speed(made: Tables) -> float:
    changes = [each["vehicle"].get("max_speed_mps") for each in made["agent"]]
    return min(each for each in (made["vehicle"]["max_speed_mps"], *changes) if each is not None)


def expectations(draw: Draw, made: Tables) -> Tables:
    table: Tables = {"converge": made["control"].get("controller") != "flocking"}
    if draw.chance(0.3):
        table["converge_within_s"] = draw.number(1.0, made["duration_s"], 1)
    if draw.chance(0.2):
        table["reform_within_s"] = draw.number(1.0, 30.0, 1)
    if draw.chance(0.1):
        table["min_separation_m"] = draw.number(0.0, made["control"]["separation_m"])
    if draw.chance(0.1):
        table["min_obstacle_distance_m"] = draw.number(0.0, made["control"].get("clearance_m", 0.5))
    return table


def objection(text: str) -> str:
    """Return the errors and warnings of ``qswarm check`` about a scenario; empty: it accepts."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "random.toml"
        file.write_text(text, encoding="utf-8")
        said = StringIO()
        with redirect_stderr(said), redirect_stdout(StringIO()):
            status = command(["check", str(file)])
    return said.getvalue() or ("refused without a word" if status else "")
