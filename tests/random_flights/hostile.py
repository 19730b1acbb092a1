"""Fly the safety filter under hostile controllers, for every kind of vehicle and set of sensors.

    python -m tests.random_flights.hostile --base 3 --count 2000 --jobs 2

The scenarios are those that ``check`` accepts without a warning: dense fleets, noise, loss, kills,
pauses, obstacles at rest and some that move more slowly than the vehicles. Prints the violations of
I1 by vehicle, sensors and controller; exit 1 if there is any, or any other failure.
"""

import sys
from collections import Counter, defaultdict
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from tests.random_flights.__main__ import arguments
from tests.random_flights.campaign import ROUNDING_M, Campaign, report
from tests.random_flights.controllers import KINDS as HOSTILES
from tests.random_flights.controllers import Mixed
from tests.random_flights.generate import DRAFTS, Generated, centre, duration, objection
from worldsim.search.drafts import accepted
from worldsim.search.draws import Draw, Tables
from worldsim.search.fleets import (
    COMMAND_TICKS,
    KINDS,
    MAX_STEP_M,
    SENSORS,
    fleet,
    sensor,
)
from worldsim.search.formations import FALLBACK
from worldsim.search.radios import conditions, flap, partition
from worldsim.search.surroundings import obstacles

STEPS = 4_000
STRIDE = 37
"""Without a common factor with the number of cases: numbers in a row differ in every respect."""
MAX_AGENTS = 16
CONTROLLERS = (*(kind.__name__ for kind in HOSTILES), Mixed.__name__)
MODULE = HOSTILES[0].__module__


class Case(NamedTuple):
    """What a number flies."""

    kind: str
    sensors: tuple[str, ...]
    controller: str

    @property
    def row(self) -> str:
        """The row of the table: the vehicle's kind and what it senses."""
        return f"{self.kind}, {' + '.join(self.sensors) or 'no sensor'}"


CASES = tuple(
    Case(kind, tuple(sensors), controller)
    for controller, sensors, kind in product(CONTROLLERS, SENSORS, KINDS)
)


def case_of(number: int) -> Case:
    """Return a number's case; so many numbers as there are cases fly each of them once."""
    return CASES[STRIDE * number % len(CASES)]


def scenario(
    base: int, number: int, steps: int = STEPS, controller: str | None = None
) -> Generated:
    """Return the hostile scenario of a base and a number. Raises LookupError where none is."""
    case = case_of(number)
    if controller is not None:
        case = case._replace(controller=controller)
    objections = Counter[str]()
    for attempt in range(DRAFTS):
        tables = draft(Draw("hostile", base, number, attempt), case, steps)
        tables["name"] = f"hostile-{base}-{number}"
        text = accepted(tables, objections, objection)
        if text is not None:
            return Generated(text, attempt + 1, objections)
    raise LookupError(f"no draft of {base}/{number} gets through: {objections.most_common(5)}")


def draft(draw: Draw, case: Case, steps: int) -> Tables:
    agents = draw.whole(2, MAX_AGENTS)
    separation = draw.among((0.25, 0.25, draw.number(0.15, 0.5)))
    made: Tables = {"seed": draw.whole(0, 2**31)}
    made["control"] = {
        "controller": f"{MODULE}:{case.controller}",
        "separation_m": separation,
        "spacing_m": max(1.0, separation + 0.5),
        "clearance_m": draw.among((0.5, 0.5, draw.number(0.2, 0.7))),
    }
    made["fleet"] = fleet(draw, agents, separation)
    tick_hz = made["fleet"]["tick_hz"]
    made["duration_s"] = duration(draw, steps / (agents * tick_hz))
    made["formation"] = FALLBACK
    made["vehicle"] = vehicle(draw, case, tick_hz)
    made["agent"] = [others_speed(draw, agents, tick_hz)] if draw.chance(0.2) else []
    made["sensor"] = sensor(draw, set(case.sensors))
    made["comms"] = {"local_hz": min(20.0, tick_hz)}
    slowest = min([made["vehicle"]["max_speed_mps"], *speeds_of(made["agent"])])
    about = centre(made["fleet"]["start"])
    made["obstacle"] = obstacles(draw, slowest, about) if draw.chance(0.7) else []
    made["netem"] = conditions(draw, agents, 1.0) if draw.chance(0.6) else {}
    made["event"] = [event(draw, agents, made["duration_s"]) for _ in range(draw.whole(0, 4))]
    made["expect"] = {"converge": False}
    return made


def vehicle(draw: Draw, case: Case, tick_hz: float) -> Tables:
    fastest = MAX_STEP_M * tick_hz / COMMAND_TICKS
    table: Tables = {"kind": case.kind, "sensors": list(case.sensors)}
    table["max_speed_mps"] = draw.among((min(0.5, fastest), fastest, draw.number(0.2, fastest)))
    if draw.chance(0.4):
        table["max_climb_mps"] = draw.scale(0.1, 2.0)
    if draw.chance(0.5):
        table["max_accel_mps2"] = draw.scale(0.3, 8.0)
    if draw.chance(0.4):
        table["max_yaw_rate_dps"] = draw.scale(20.0, 720.0)
    return table


def others_speed(draw: Draw, agents: int, tick_hz: float) -> Tables:
    """Return a table that gives some agents another speed."""
    fastest = MAX_STEP_M * tick_hz / COMMAND_TICKS
    ids = sorted(draw.some(range(agents), draw.whole(1, 4)))
    return {"ids": ids, "vehicle": {"max_speed_mps": draw.number(0.2, fastest)}}


def speeds_of(agents: list[Tables]) -> list[float]:
    return [each["vehicle"]["max_speed_mps"] for each in agents]


def event(draw: Draw, agents: int, duration_s: float) -> Tables:
    """Return one event that makes others silent, still or unheard for a while."""
    some = [*draw.some(range(agents), draw.whole(1, max(1, agents // 2)))]
    kinds: list[Callable[[], Tables]] = [
        lambda: {"kill": some},
        lambda: {"pause": some},
        lambda: {"kill": [f"random:{draw.whole(1, agents)}"]},
        lambda: {"netem": {"loss_percent": draw.among((100.0, 80.0))}},
        lambda: {"partition": partition(draw, agents)},
        lambda: {"jam": {"centre_m": [0.0, 0.0, 0.0], "radius_m": draw.scale(0.5, 50.0)}},
        lambda: {"flap": flap(draw, agents)},
    ]
    made: Tables = {"at_s": draw.number(0.0, 0.9 * duration_s, 1), **draw.among(kinds)()}
    if draw.chance(0.6):
        made["for_s"] = draw.among((0.2, 0.5, draw.number(0.1, 6.0, 1)))
    return made


def table(rows: dict[int, dict[str, Any]], key: Callable[[int], str]) -> str:
    """Return how many flights violate I1, and the least margins, in one row for each key."""
    groups: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for number, row in rows.items():
        groups[key(number)].append(row)
    lines = [
        "| flown | flights | too near to each other | least margin [mm] | too near to obstacles"
        " | least margin [mm] |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {name} | {len(found)} | {_margins(found, 'separation')} |"
        f" {_margins(found, 'clearance')} |"
        for name, found in groups.items()
    ]
    return "\n".join(lines)


def _margins(rows: list[dict[str, Any]], name: str) -> str:
    """Return the number of violations, and the least margin [mm], as two cells."""
    margins = [
        1000.0 * (row[f"{name}_m"] - row[f"{name}_bound_m"])
        for row in rows
        if row.get(f"{name}_m") is not None
    ]
    broken = sum(margin < -1000.0 * ROUNDING_M for margin in margins)
    return f"{broken} | {min(margins):.2f}" if margins else "- | -"


def main() -> int:
    parser = arguments(__doc__, STEPS)
    parser.set_defaults(twice_every=10)
    parser.add_argument("--controller", choices=CONTROLLERS, help="this one only")
    given = parser.parse_args()
    campaign = Campaign(
        partial(scenario, given.base, steps=given.steps, controller=given.controller),
        given.out or Path("runs") / f"hostile-flights-{given.base}",
        given.jobs,
        given.deadline,
        given.twice_every,
    )
    rows = campaign.fly(range(given.first, given.first + given.count))
    print(report(rows))
    print(f"\n{table(rows, lambda number: case_of(number).row)}")
    print(f"\n{table(rows, lambda number: given.controller or case_of(number).controller)}")
    return 1 if any("failure" in row for row in rows.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
