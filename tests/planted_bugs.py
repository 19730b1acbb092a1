"""Ten bugs planted in the product, one at a time, and what ``qswarm fuzz`` makes of each.

    QSWARM_PURE=1 python -m tests.planted_bugs --seeds 0:64 --out runs/planted
    QSWARM_PURE=1 python -m tests.planted_bugs --only held_command --random

For each bug it prints the seed that finds it, the runs up to there, and the size of the scenario as
drawn and shrunk. The product has no switch for any of them: they replace parts of pure Python code
in this process, and the flights that it forks inherit them.
"""

import argparse
import sys
from collections.abc import Callable
from math import atan2
from pathlib import Path
from random import Random
from time import monotonic
from typing import Any

import msgspec
import pytest

from agent.comms.gossip import RecordTable
from agent.guidance import movement
from agent.guidance.promise_filter import PromiseFilter
from agent.guidance.safety_filter import Bound, RangingFilter
from agent.heard_beacon import Version
from agent.structure.queue_map import QueueMap
from netem import link
from netem.faults import Partition
from netem.medium import Medium
from worldsim.campaign.flight_site import LocalSite
from worldsim.fuzz.flights import WORK
from worldsim.fuzz.folder import SearchFolder, findings_in, read_finding
from worldsim.fuzz.fuzz import Search, fuzz
from worldsim.results.exit_status import INTERRUPTED, PASS
from worldsim.search.drafts import loaded
from worldsim.search.trials import Terms
from worldsim.truth.world import World

Plant = Callable[[pytest.MonkeyPatch], None]
SHRINK_FLIGHTS = 60
SMALL = """
name = "small"
duration_s = 60.0
[fleet]
agents = 5
tick_hz = 10.0
start = {{ kind = "box", centre_m = [0, 0, 0], size_m = [4, 4, 1], spacing_m = 0.7 }}
[formation]
name = "line"
[formation.vertices]
V1 = [0, 0, 0]
[[formation.queue]]
name = "Q1"
vertices = ["V1"]
shape = {{ kind = "ray", direction = [-1, 0, 0] }}
[comms]
local_hz = 10.0
[vehicle]
sensors = {sensors}
"""
"""A small team, whose flights are short, with the vehicle's sensors to fill in."""
BLIND = ("broken_promise",)
"""Bugs of code that runs without a ranging sensor only."""


def filter_sign(patch: pytest.MonkeyPatch) -> None:
    """A sign in the filter: it limits the way from a vehicle, not the way to it."""
    right = RangingFilter.bounds

    def bounds(self: Any, points: Any) -> list[Bound]:
        turned = [tuple(-each for each in bound.away) for bound in right(self, points)]
        return [
            bound._replace(away=away)
            for bound, away in zip(right(self, points), turned, strict=True)
        ]

    patch.setattr(RangingFilter, "bounds", bounds)


def version_alone(patch: pytest.MonkeyPatch) -> None:
    """Merge by version alone: a process that was restarted counts from zero, and is not heard."""

    def supersedes(self: Any, other: Any) -> bool:
        return bool(self.sequence > other.sequence)

    patch.setattr(Version, "supersedes", supersedes)


def unkeyed_draw(patch: pytest.MonkeyPatch) -> None:
    """An unkeyed draw: fates of frames come from a generator that nobody seeds."""
    right, random = link.draw, Random()

    def draw(seed: bytes, *key: Any) -> Any:
        return right(random.randbytes(32), *key)

    patch.setattr(link, "draw", draw)
    right_group = link.draw_group

    def draw_group(seed: bytes, *key: Any) -> bytes:
        return right_group(random.randbytes(32), *key)

    patch.setattr(link, "draw_group", draw_group)


def forgotten_tombstone(patch: pytest.MonkeyPatch) -> None:
    """A forgotten tombstone: nobody is ever dropped from the table."""
    patch.setattr(RecordTable, "forget_silent", lambda self, *_: [])


def held_command(patch: pytest.MonkeyPatch) -> None:
    """A held command: a vehicle flies on when its command has expired."""
    patch.setattr(World, "_hover_expired", lambda self: None)


def broken_promise(patch: pytest.MonkeyPatch) -> None:
    """A promise broken: without a sensor, a vehicle flies faster than it said it would."""
    patch.setattr(PromiseFilter, "speed_limit", property(lambda self: self._max_speed))


def stale_frame(patch: pytest.MonkeyPatch) -> None:
    """A stale frame: whatever comes last is the newest."""
    patch.setattr(Version, "supersedes", lambda self, other: True)


def lasting_partition(patch: pytest.MonkeyPatch) -> None:
    """A partition that never heals: the medium misses its end."""
    right = Medium.apply

    def apply(self: Any, order: Any) -> None:
        held = self._conditions.in_force.get(order.number)
        if order.fault is not None or held is None or not isinstance(held.fault, Partition):
            right(self, order)

    patch.setattr(Medium, "apply", apply)


def rank_off_by_one(patch: pytest.MonkeyPatch) -> None:
    """A rank off by one: the fourth of a queue takes the place of the fifth."""
    right = QueueMap.slot

    def slot(self: Any, queue: int, number: int, members: int) -> Any:
        return right(self, queue, number + (number == 4), members)

    patch.setattr(QueueMap, "slot", slot)


def turn_at_180(patch: pytest.MonkeyPatch) -> None:
    """A turn the wrong way at 180 degrees: the difference of two angles is not wrapped."""

    def error(x: float, y: float, yaw: float) -> float:
        return atan2(y, x) - yaw

    patch.setattr(movement, "azimuth_error", error)


PLANTS: dict[str, Plant] = {
    plant.__name__: plant
    for plant in (
        filter_sign,
        version_alone,
        unkeyed_draw,
        forgotten_tombstone,
        held_command,
        broken_promise,
        stale_frame,
        lasting_partition,
        rank_off_by_one,
        turn_at_180,
    )
}


def small_terms(name: str) -> Terms:
    """Return what to search in a small team."""
    text = SMALL.format(sensors=[] if name in BLIND else ["proximity"])
    return Terms(base=msgspec.to_builtins(loaded(text, Path("planted.toml"))))


def searched(
    plant: Plant,
    terms: Terms,
    seeds: range,
    folder: Path,
    guided: bool,
    budget: int = SHRINK_FLIGHTS,
) -> int:
    """Search with one bug planted, until it is found; return the exit status of the search.

    budget: flights that shrink the finding at most.
    """
    search = Search(
        terms=terms,
        seeds=seeds,
        folder=folder,
        site=LocalSite(1, folder / WORK),
        guided=guided,
        shrinks=1,
        corpus=None,
        described={"plant": plant.__name__, "guided": guided, "first seed": seeds.start},
        beside=Path("planted.toml"),
        quiet=True,
        first_only=True,
        budget=budget,
    )
    with pytest.MonkeyPatch.context() as patch:
        plant(patch)
        return fuzz(search)


def row(name: str, folder: Path, began_s: float) -> str:
    """Return the line of one bug in the table."""
    rows = SearchFolder(folder).rows()
    order = sorted(rows.values(), key=lambda each: each["seed"])
    bad = [each for each in order if each["violated"]]
    if not bad:
        return f"| {name} | not found in {len(order)} | - | - | - | {monotonic() - began_s:.0f} s |"
    runs = order.index(bad[0]) + 1
    found = [read_finding(each) for each in findings_in(folder / "findings")]
    small = min((each for each in found if each["shrunk"]), key=lambda each: int(each["seed"]))
    sizes = [
        f"{size['faults']} faults, {size['agents']} agents, {size['duration_s']:g} s"
        for size in (small["original_size"], small["size"])
    ]
    first = f"{bad[0]['seed']} ({bad[0]['how']}): {', '.join(bad[0]['violated'])}"
    return f"| {name} | {first} | {runs} | {' | '.join(sizes)} | {monotonic() - began_s:.0f} s |"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="0:64")
    parser.add_argument("--out", type=Path, default=Path("runs/planted"))
    parser.add_argument("--only", action="append", choices=sorted(PLANTS))
    parser.add_argument("--random", action="store_true", help="draw all seeds at random")
    parser.add_argument("--budget", type=int, default=SHRINK_FLIGHTS, help="flights that shrink")
    parser.add_argument("--small", action="store_true", help="vary one small team, not all teams")
    given = parser.parse_args()
    first, last = map(int, given.seeds.split(":"))
    missed = 0
    print("| bug | found by seed | runs | as drawn | shrunk | time |\n|---|---|---|---|---|---|")
    for name in given.only or PLANTS:
        folder = given.out / f"{name}-{'random' if given.random else 'half'}-{first}"
        terms = small_terms(name) if given.small else Terms()
        began_s, out = monotonic(), sys.stdout
        sys.stdout = (given.out.parent / "planted.log").open("a", encoding="utf-8")
        try:
            seeds, guided = range(first, last), not given.random
            status = searched(PLANTS[name], terms, seeds, folder, guided, given.budget)
        finally:
            sys.stdout.close()
            sys.stdout = out
        if status == INTERRUPTED:
            return status
        missed += status == PASS
        print(row(name, folder, began_s), flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
