"""One flight of a row, and the many that a command asks for."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from netem.wire.channels import CHANNELS
from tests.random_flights.children import answers
from tests.structure_figures.rows import ROWS, Row, scenario_of
from tests.structure_figures.watch import Watcher
from worldsim.engine.virtual import Flight, fly
from worldsim.scenario.tables import Scenario

SeedRow = dict[str, Any]
"""What one seed of a row showed, as plain values; with "failure" where it did not return."""


def measured(scenario: Scenario) -> SeedRow:
    """Fly a scenario in virtual time, until it is quiet or at its end; return its figures."""
    watcher = Watcher(scenario)
    flight = fly(scenario, watcher, should_stop=lambda: watcher.done)
    judge = flight.loop.judge
    return {
        "stages": watcher.stages(),
        "separation_m": judge.min_separation_m,
        "clearance_m": judge.min_obstacle_distance_m,
        "bytes_per_s": _bytes_per_s(flight),
        "broken": {
            name: tally.violations for name, tally in judge.invariants().items() if tally.violations
        },
        "wall_s": round(flight.wall_s, 3),
        "cpu_s": round(flight.cpu_s, 3),
        "simulated_s": flight.loop.world.time_s,
        "trace": flight.loop.trace.sha256,
    }


def flown(row: Row, seed: int, settings: Mapping[str, str]) -> SeedRow:
    """Fly a row with a seed."""
    return {"seed": seed, **measured(scenario_of(row, seed, settings))}


def rows_flown(
    names: list[str],
    seeds: range,
    settings: Mapping[str, str],
    jobs: int,
    deadline_s: float,
    on_progress: Callable[[str], None],
) -> Iterator[tuple[str, list[SeedRow]]]:
    """Fly rows, each seed in a child; yield each row's seeds as soon as all of them are there."""
    work = [(name, seed) for name in names for seed in seeds]
    found: dict[str, list[SeedRow]] = {name: [] for name in names}

    def fly_one(number: int) -> SeedRow:
        name, seed = work[number]
        return flown(ROWS[name], seed, settings)

    for done, answer in enumerate(answers(range(len(work)), fly_one, jobs, deadline_s), 1):
        name, seed = work[answer.number]
        found[name].append({"seed": seed, **answer.row})
        on_progress(f"{done} of {len(work)} flights; {name}: {len(found[name])} of {len(seeds)}")
        if len(found[name]) == len(seeds):
            yield name, sorted(found[name], key=lambda each: each["seed"])


def _bytes_per_s(flight: Flight) -> dict[str, float]:
    """Return the payload that an agent sends in a second, checksum included, by channel."""
    rows = flight.loop.radio_use.bytes_per_s(flight.medium_counters)
    if rows is None:
        return dict.fromkeys(CHANNELS, 0.0)
    known = {name: [each for each in sent if each is not None] for name, sent in rows.items()}
    return {name: round(sum(sent) / max(1, len(sent)), 1) for name, sent in known.items()}
