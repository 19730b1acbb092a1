"""The schemes that the paper compares itself with, measured beside the adaptive Q-structure.

``python -m tests.scheme_figures --seeds 0:20`` flies each scheme in each situation in virtual time,
and prints a row of the table in docs/schemes.md for each: how many seeds converged, and when; the
least separation, with the safety filter on, and in a second flight of the same time in which it
only watches; the share of the steps in which the filter that is on acts; the links that a member
hears, needs, and uses (needs and hears); N_c,i, the members of its queues that it hears; and the
bytes that an agent sends. A flight ends SETTLED_S after its last change has converged.

``--flights FILE`` keeps the figures of each flight, and flies none of those that it has: a run that
was stopped goes on, and more seeds are added to it. It is to be a new file for each commit.
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from agent.messages import Place
from agent.qstructure.formation import formation_of
from agent.schemes import (
    former_q_structure,
    leader_follower,
    printed_q_structure,
    virtual_structure,
)
from agent.schemes.links import NOBODY, Situation
from tests.random_flights.children import answers
from tests.structure_figures.watch import Watcher
from worldsim.engine.virtual import fly
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures
from worldsim.scenario.file import load
from worldsim.scenario.library import find_scenario
from worldsim.scenario.tables import Scenario

LISTENED_S = 1.0
"""Links are counted from then on [s]."""
SETTLED_S = 4.0
DEADLINE_S = 900.0
LinksNeeded = Callable[[Situation], frozenset[int]]


class Scheme(NamedTuple):
    """A row of schemes: a controller, with what it needs."""

    controller: str
    links_needed: LinksNeeded
    keys: tuple[tuple[str, str], ...] = ()


def of_queue_and_parent(situation: Situation) -> frozenset[int]:
    """Return whom a member of the adaptive Q-structure must hear: see docs/method.md."""
    return situation.same_queue | ({situation.leader} - {NOBODY})


RELAYED = (("control.allocation", "assignment"),)
SCHEMES = {
    "q_structure": Scheme("q_structure", of_queue_and_parent),
    "printed_q_structure": Scheme("printed_q_structure", printed_q_structure.links_needed),
    "former_q_structure": Scheme("former_q_structure", former_q_structure.links_needed),
    "leader_follower": Scheme("leader_follower", leader_follower.links_needed),
    "virtual_structure": Scheme("virtual_structure", virtual_structure.links_needed),
    "virtual_structure, relayed": Scheme(
        "virtual_structure", virtual_structure.links_needed, RELAYED
    ),
}


class Fleet(NamedTuple):
    """A fleet's scenario and its times."""

    scenario: str
    lasts_s: float
    leaves_s: float
    """When the apex agent leaves, where it does."""
    keys: tuple[tuple[str, str], ...] = ()


LINES = (
    ("formation.file", "'../formations/three-horizontal-lines.toml'"),
    ("fleet.agents", "6"),
)
FLEETS = {
    "wedge-9": Fleet("wedge-9", 45.0, 30.0),
    "wedge-20": Fleet("wedge-20", 60.0, 45.0),
    "lines-6": Fleet("wedge-9", 45.0, 30.0, LINES),
}
SITUATIONS: dict[str, tuple[tuple[str, str], ...]] = {
    "clean": (),
    "50 % loss, 200 ms": (
        ("netem.loss_percent", "50"),
        ("netem.delay_ms", "200"),
        ("netem.jitter_ms", "40"),
    ),
    "range 3 m": (("netem.range_m", "3"),),
    "apex leaves": (),
}


class LinkWatcher(Watcher):
    """Watches a flight's stages, and counts each member's links."""

    def __init__(self, scenario: Scenario, links_needed: LinksNeeded) -> None:
        super().__init__(scenario)
        self._links_needed = links_needed
        self._formation = formation_of(scenario.formation, scenario.control.spacing_m)
        self._layout = self._formation.layout(scenario.fleet.agents)
        self._follows_graph = scenario.control.controller == "leader_follower"
        self.counts: list[tuple[int, int, int, int]] = []
        """Heard, needed, used and N_c,i, of each member at each tick."""
        self.filtered = False
        """Whether a safety filter has changed a velocity, by however little."""

    def tick(self, tick: Tick, figures: Figures) -> None:
        """Take a tick, in order."""
        super().tick(tick, figures)
        assert tick.filtered_mps is not None, "ticks are recorded"
        self.filtered = self.filtered or bool((tick.filtered_mps > 0.0).any())
        if tick.time_s >= LISTENED_S:
            self._count(tick)

    @property
    def settled(self) -> bool:
        """Whether the last stage has converged some time ago, and nothing more is planned."""
        stage, _ = self._stages[-1]
        at_s = stage.timer.converged_s
        planned = self._time_s <= self._planned_s
        return not planned and at_s is not None and self._time_s >= at_s + SETTLED_S

    def _bound_s(self, tick: Tick, from_s: float) -> None:
        """The bound on convergence is not looked at, and a team may be empty."""

    def _count(self, tick: Tick) -> None:
        team = frozenset(np.flatnonzero(tick.alive).tolist())
        heard: dict[int, set[int]] = {agent: set() for agent in team}
        for hearer, other in tick.links.tolist():
            if hearer in team and other in team:
                heard[hearer].add(other)
        queues = {}
        main = self._layout.places[0]
        holder = NOBODY
        for agent in sorted(team):
            place = Place(*tick.place[agent].tolist())
            claims = place.queue >= 0
            queues[agent] = self._formation.queues_of(place) if claims else frozenset()
            holder = agent if place == main and holder == NOBODY else holder
        for agent in team:
            same = frozenset(
                other for other in heard[agent] if not queues[agent].isdisjoint(queues[other])
            )
            at = Situation(agent, team, same, self._leader(tick, agent), holder)
            needed = self._links_needed(at)
            used = len(needed & heard[agent])
            self.counts.append((len(heard[agent]), len(needed), used, len(same)))

    def _leader(self, tick: Tick, agent: int) -> int:
        if self._follows_graph:
            return leader_follower.leader_of(self._layout, agent)
        return int(tick.hierarchy.parent[agent]) if tick.hierarchy is not None else NOBODY


def scenario_of(
    scheme: str, fleet: str, situation: str, seed: int, lasts_s: float | None = None
) -> Scenario:
    """Return the scenario of a flight. lasts_s: other than the fleet's."""
    flown = FLEETS[fleet]
    keys = {
        "seed": str(seed),
        "duration_s": str(flown.lasts_s if lasts_s is None else lasts_s),
        "control.controller": SCHEMES[scheme].controller,
        **dict((*SCHEMES[scheme].keys, *flown.keys, *SITUATIONS[situation])),
    }
    if situation == "apex leaves":
        # By the printed algorithm many agents hold the apex at a time.
        who = "0" if scheme == "printed_q_structure" else "'vertex:V1'"
        keys["event"] = f"[{{ at_s = {flown.leaves_s}, leave = [{who}] }}]"
        keys["duration_s"] = str(flown.leaves_s + flown.lasts_s)
    return load(find_scenario(flown.scenario), keys)


def measured(scheme: str, fleet: str, situation: str, seed: int) -> dict[str, Any]:
    """Fly once; return the flight's figures."""
    scenario = scenario_of(scheme, fleet, situation, seed)
    watcher = LinkWatcher(scenario, SCHEMES[scheme].links_needed)
    flight = fly(scenario, watcher, should_stop=lambda: watcher.settled)
    acted = [
        each for each in flight.loop.controllers.filter_use().acted_fraction if each is not None
    ]
    counts = np.array(watcher.counts)
    rows = flight.loop.radio_use.bytes_per_s(flight.medium_counters)
    sent = [float(np.mean([each for each in row if each is not None])) for row in rows.values()]
    least_m, slots = flight.loop.judge.min_separation_m, flight.loop.world.slot
    return {
        "converge_s": [each["converge_s"] for each in watcher.stages()],
        "separation_m": least_m,
        # Where the filter changed nothing, the second flight would be the same.
        "watched_m": watched_m(scenario, slots) if watcher.filtered else least_m,
        "acted": float(np.mean(acted)),
        "mean": counts.mean(axis=0).tolist(),
        "most": counts.max(axis=0).tolist(),
        "bytes_per_s": sum(sent),
    }


def watched_m(scenario: Scenario, slots: int) -> float:
    """Fly again for so many slots with the filter only watching; return the least separation."""
    watching = replace(scenario, control=replace(scenario.control, safety_filter="watch"))
    flown = iter(range(slots))
    flight = fly(watching, should_stop=lambda: next(flown, None) is None)
    return flight.loop.judge.min_separation_m


def line_of(names: Sequence[str], flown: list[dict[str, Any]]) -> str:
    """Return a row of the table from the flights of a scheme in a situation."""
    failed = [each for each in flown if "failure" in each]
    if failed:
        return f"| {' | '.join(names)} | {len(failed)} failed: {failed[0]}"
    last = [each["converge_s"][-1] for each in flown]
    times = [each for each in last if each is not None]
    took = f"{median(times):.1f}, {max(times):.1f}" if times else "-"
    least = min(each["separation_m"] for each in flown)
    mean = np.mean([each["mean"] for each in flown], axis=0)
    most = np.max([each["most"] for each in flown], axis=0)
    heard, needed, used, of_queue = (
        f"{a:.1f}, {b}" for a, b in zip(mean.tolist(), most.tolist(), strict=True)
    )
    sent = np.mean([each["bytes_per_s"] for each in flown])
    cells = (
        *names,
        f"{len(times)} of {len(flown)}",
        took,
        f"{least:.2f}",
        f"{min(each['watched_m'] for each in flown):.2f}",
        f"{100 * np.mean([each['acted'] for each in flown]):.1f}",
        heard,
        needed,
        used,
        of_queue,
        f"{sent:.0f}",
    )
    return f"| {' | '.join(cells)} |"


HEADINGS = (
    "fleet | situation | scheme | converged | median, worst [s] | separation [m] | watched [m]"
    " | filter [%] | heard | needed | used | N_c,i | B/s"
)


class Kept:
    """The figures of flights by fleet, situation, scheme and seed, in a file of JSON lines."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        lines = path.read_text("utf-8").splitlines() if path and path.exists() else []
        self._rows = {tuple(name): row for name, row in map(json.loads, lines)}

    def flown(self, row: tuple[str, str, str], seeds: range, jobs: int) -> list[dict[str, Any]]:
        """Return the figures of a scheme's flights, those that are missing flown now."""
        fleet, situation, scheme = row
        missing = [seed for seed in seeds if (*row, seed) not in self._rows]

        def fly_one(seed: int) -> dict[str, Any]:
            return measured(scheme, fleet, situation, seed)

        for seed, figures in answers(missing, fly_one, jobs, DEADLINE_S):
            self._rows[(*row, seed)] = figures
            if self._path is not None:
                with self._path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps([(*row, seed), figures]) + "\n")
        return [self._rows[(*row, seed)] for seed in seeds]


def rows_like(given: argparse.Namespace) -> Iterator[tuple[str, str, str]]:
    """Yield the fleet, situation and scheme of the rows that are asked for."""
    for fleet in [each for each in FLEETS if fnmatch(each, given.fleet)]:
        for situation in [each for each in SITUATIONS if fnmatch(each, given.situation)]:
            for scheme in SCHEMES:
                if any(fnmatch(scheme, name) for name in given.schemes):
                    yield fleet, situation, scheme


def main() -> int:
    """Fly all rows, or those that match, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("schemes", nargs="*", default=["*"], help="names; * stands for any text")
    parser.add_argument("--fleet", default="wedge-*")
    parser.add_argument("--situation", default="*")
    parser.add_argument("--seeds", default="0:20", help="first and last + 1")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--flights", type=Path, help="a file that keeps each flight's figures")
    given = parser.parse_args()
    seeds = range(*map(int, given.seeds.split(":")))
    print(f"| {HEADINGS} |\n" + "|---" * len(HEADINGS.split(" | ")) + "|")
    kept, good = Kept(given.flights), True
    for row in rows_like(given):
        flown = kept.flown(row, seeds, given.jobs)
        print(line_of(row, flown), flush=True)
        good = good and not any("failure" in each for each in flown)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
