"""Ten bugs to plant in the product, one at a time, for ``qswarm fuzz`` to find.

The product has no switch for any of them: they replace parts of pure Python code in this process
(QSWARM_PURE=1), and the flights that it forks inherit them. Each notes when it first makes a
difference: when the planted code does something else than the code that it replaces would have. A
flight can mend a bug for a while: then it runs the code that the bug replaces.
``python -m tests.planted_figures`` measures what becomes of them.
"""

import json
import os
from collections.abc import Callable
from math import atan2
from pathlib import Path
from typing import Any, Final

import msgspec
import pytest

from agent.comms import whereabouts
from agent.comms.gossip import RecordTable
from agent.comms.whereabouts import VehicleReport
from agent.guidance import q_structure
from agent.guidance.cone import Cone
from agent.guidance.movement import DEAD_BAND_MPS
from agent.guidance.promise_filter import PromiseFilter
from agent.guidance.safety_filter import Bound, RangingFilter
from agent.heard_beacon import HeardBeacon, Version
from agent.messages import Record, Vector
from agent.structure.queue_map import QueueMap
from agent.vectors import across
from netem import link
from netem.faults import Partition
from netem.medium import Medium
from tests.small_scenario import SMALL
from worldsim.campaign.flight_site import LocalSite
from worldsim.engine.virtual import VirtualFleet
from worldsim.fuzz.flights import WORK
from worldsim.fuzz.fuzz import Search, fuzz
from worldsim.scenario.file import as_toml
from worldsim.search.drafts import cautions, loaded
from worldsim.search.trials import Terms
from worldsim.truth.world import World

Plant = Callable[[pytest.MonkeyPatch], None]
SHRINK_FLIGHTS = 60
BESIDE = Path("planted.toml")
BLIND = ("broken_promise", "stale_frame")
"""Bugs of code that keeps vehicles without a ranging sensor apart: fast ones that chase each other,
for the shipped controller keeps farther off than its filter makes it."""
BLIND_CHASE: dict[str, Any] = {
    "vehicle": {"sensors": [], "max_speed_mps": 2.0},
    "control": {"controller": "tests.random_flights.controllers:Chase"},
}
LONGEST_TURN_RAD = 1.0
"""So far ahead of a heading a turn aims that goes the wrong way."""


class Difference:
    """Whether the planted code has made a difference yet, in this process."""

    made = False

    @classmethod
    def note(cls, differs: bool = True) -> None:
        """Note that it has, if it did."""
        cls.made = cls.made or differs


class DifferenceProbe:
    """Notes in a flight when the planted code first makes a difference [s; simulated time]."""

    FILE: Final = "difference.json"

    def __init__(self) -> None:
        self._at_s: float | None = None

    def before_slot(self, fleet: VirtualFleet) -> None:
        """Look at what the slot before did; what was noted before the flight does not count."""
        world = fleet.loop.world
        if world.slot == 0:
            Difference.made = False
        elif Difference.made and self._at_s is None:
            self._at_s = (world.slot - 1) / world.clock.slot_hz

    def write(self, folder: Path) -> None:
        """Write the time, or null."""
        (folder / self.FILE).write_text(json.dumps(self._at_s), encoding="utf-8")


class Window:
    """The slots in which a flight runs the planted code; before and after it, the right one.

    first, end: from the one on, up to the other, in slots; None: to the end of the flight.
    """

    open = True
    """Whether it runs the planted code now, in this process."""

    def __init__(self, first: int, end: int | None) -> None:
        self._first, self._end = first, end

    def before_slot(self, fleet: VirtualFleet) -> None:
        """Choose the code of the next slot."""
        slot = fleet.loop.world.slot
        Window.open = self._first <= slot and (self._end is None or slot < self._end)

    def write(self, folder: Path) -> None:
        """Write nothing: the summary says it all."""


def put(patch: pytest.MonkeyPatch, owner: Any, name: str, planted: Callable[..., Any]) -> None:
    """Plant a function in place of one of a class or a module, where the window is open."""
    right = getattr(owner, name)

    def either(*given: Any) -> Any:
        return planted(*given) if Window.open else right(*given)

    patch.setattr(owner, name, either)


def filter_sign(patch: pytest.MonkeyPatch) -> None:
    """A sign in the filter: it limits the way from a vehicle, not the way to it."""
    right = RangingFilter.bounds

    def bounds(self: Any, points: Any) -> list[Bound]:
        found = right(self, points)
        Difference.note(bool(found))
        x, y, z = range(3)
        return [each._replace(away=(-each.away[x], -each.away[y], -each.away[z])) for each in found]

    put(patch, RangingFilter, "bounds", bounds)


def version_alone(patch: pytest.MonkeyPatch) -> None:
    """Merge by version alone: a process that was restarted counts from zero, and is not heard."""
    right = Version.supersedes

    def supersedes(self: Any, other: Any) -> bool:
        newer = bool(self.sequence > other.sequence)
        Difference.note(newer != right(self, other))
        return newer

    put(patch, Version, "supersedes", supersedes)


def unkeyed_draw(patch: pytest.MonkeyPatch) -> None:
    """An unkeyed draw: fates of frames come from a generator that nobody seeds."""
    right, right_group = link.draw, link.draw_group

    def draw(seed: bytes, *key: Any) -> Any:
        Difference.note()
        return right(os.urandom(32), *key)

    def draw_group(seed: bytes, *key: Any) -> bytes:
        Difference.note()
        return right_group(os.urandom(32), *key)

    put(patch, link, "draw", draw)
    put(patch, link, "draw_group", draw_group)


def forgotten_tombstone(patch: pytest.MonkeyPatch) -> None:
    """A forgotten tombstone: nobody is ever dropped from the table."""
    right = RecordTable.forget_silent

    def forget_silent(self: Any, *given: Any) -> list[Any]:
        newest, lag_s = dict(self._newest), dict(self._lag_s)
        Difference.note(bool(right(self, *given)))
        self._newest.update(newest)
        self._lag_s.update(lag_s)
        return []

    put(patch, RecordTable, "forget_silent", forget_silent)


def held_command(patch: pytest.MonkeyPatch) -> None:
    """A held command: a vehicle flies on when its command has expired."""

    def hover_expired(self: Any) -> None:
        held = zip(self._expires, self._velocity, strict=True)
        Difference.note(any(expires <= self.slot and any(v) for expires, v in held))

    put(patch, World, "_hover_expired", hover_expired)


def broken_promise(patch: pytest.MonkeyPatch) -> None:
    """A promise broken: without a sensor, a vehicle flies at any speed, whatever it promised."""
    right: Any = PromiseFilter.speed_limit

    def speed_limit(self: Any) -> float:
        if not Window.open:
            return float(right.fget(self))
        Difference.note(right.fget(self) < self._max_speed)
        return float(self._max_speed)

    def needs_s(self: Any, speed: float) -> float:
        return float(self._braking.stopping_s(max(speed, right.fget(self))))

    patch.setattr(PromiseFilter, "speed_limit", property(speed_limit))
    put(patch, PromiseFilter, "_needs_s", needs_s)


def stale_frame(patch: pytest.MonkeyPatch) -> None:
    """A stale frame: what a vehicle last said of itself counts as said now, however old it is."""
    right = whereabouts._report

    def report(newest: HeardBeacon | Record, position: Vector, now_s: float) -> VehicleReport:
        found = right(newest, position, now_s)
        Difference.note(found.age_s > 0.0)
        return found._replace(age_s=0.0)

    put(patch, whereabouts, "_report", report)


def lasting_partition(patch: pytest.MonkeyPatch) -> None:
    """A partition that never heals: the medium misses its end."""
    right = Medium.apply

    def apply(self: Any, order: Any) -> None:
        held = self._conditions.in_force.get(order.number)
        if order.fault is None and held is not None and isinstance(held.fault, Partition):
            Difference.note()
        else:
            right(self, order)

    put(patch, Medium, "apply", apply)


def rank_off_by_one(patch: pytest.MonkeyPatch) -> None:
    """A rank off by one: the fourth of a queue takes the place of the fifth."""
    right = QueueMap.slot

    def slot(self: Any, queue: int, number: int, members: int) -> Any:
        Difference.note(number == 4)
        return right(self, queue, number + (number == 4), members)

    put(patch, QueueMap, "slot", slot)


def turn_at_180(patch: pytest.MonkeyPatch) -> None:
    """A turn the wrong way at 180 degrees: the difference of two angles is not wrapped."""
    right = q_structure.steer

    def steer(wanted: Vector, yaw: float, cone: Cone) -> tuple[Vector, float]:
        if across(wanted) <= DEAD_BAND_MPS:
            return wanted, yaw
        turn = atan2(wanted[1], wanted[0]) - yaw
        heading = yaw + max(-LONGEST_TURN_RAD, min(LONGEST_TURN_RAD, turn))
        flown = wanted if cone.holds(turn) else (0.0, 0.0, wanted[2])
        Difference.note(flown != right(wanted, yaw, cone)[0])
        return flown, heading

    put(patch, q_structure, "steer", steer)


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
    """Return what to search for a bug: faults in a team of five, whose flights are short."""
    tables: Any = msgspec.toml.decode(SMALL)
    box = {"kind": "box", "centre_m": [0, 0, 0], "size_m": [4, 4, 1], "spacing_m": 0.7}
    blind = name in BLIND
    tables |= {
        "duration_s": 60.0,
        "fleet": {"agents": 5, "tick_hz": 20.0 if blind else 5.0, "start": box},
        "comms": {"local_hz": 5.0},
        **(BLIND_CHASE if blind else {}),
    }
    scenario = loaded(as_toml(tables), BESIDE)
    return Terms(None, msgspec.to_builtins(scenario), cautions(scenario), safety_only=blind)


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
        beside=BESIDE,
        quiet=True,
        first_only=True,
        budget=budget,
    )
    with pytest.MonkeyPatch.context() as patch:
        plant(patch)
        return fuzz(search)
