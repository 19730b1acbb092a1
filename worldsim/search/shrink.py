"""The smallest scenario that still violates a property: one change at a time, kept where it does.

Pure: ``Shrinker.batch`` returns candidates, ``take`` gets which of them violated the property.
"""

import copy
from collections.abc import Callable, Iterable, Iterator
from math import ceil
from typing import Any, NamedTuple

import msgspec

from worldsim.search.draws import Tables
from worldsim.search.formations import FALLBACK
from worldsim.search.trials import fair_s, leaves_a_team

LISTS = ("event", "obstacle", "agent")
TABLES = ("netem", "comms", "sensor", "frame", "obstacle_field", "agent", "event", "obstacle")
KEYS_OF = ("netem", "vehicle", "control", "comms", "sensor", "fleet", "frame", "expect")
SENSORS = ("proximity", "laser", "sonar")
NEEDED = ("agents", "start", "converge", "kind", "controller", "command", "parameters")
LIMITS = ("converge_within_s", "reform_within_s")
AFTER_S = 0.5
"""So long after the violation a flight may end [s]."""
USUAL = (
    (("fleet",), "tick_hz", 20.0),
    (("vehicle",), "max_speed_mps", 0.5),
    (("vehicle",), "kind", "kinematic"),
    (("vehicle",), "sensors", ["proximity"]),
    (("control",), "separation_m", 0.25),
    (("control",), "spacing_m", 1.0),
    ((), "seed", 1),
)
Fails = Callable[[Tables], float | None]
"""Returns when tables violate the property [s; simulated time]; None where they do not."""


class Size(NamedTuple):
    """How large a scenario is."""

    faults: int
    agents: int
    duration_s: float

    @classmethod
    def of(cls, tables: Tables) -> "Size":
        """Return the size of plain tables."""
        return cls(len(tables.get("event") or ()), tables["fleet"]["agents"], tables["duration_s"])


class Shrinker:
    """Makes tables smaller that violate a property.

    violated_s: when they do [s; simulated time]. timed: whether the property is a time limit; then
    that is when it is certain that more time does not help.
    """

    def __init__(self, tables: Tables, violated_s: float, timed: bool) -> None:
        self.smallest = tables
        """The smallest tables so far that violate the property."""
        self._violated_s = violated_s
        self._passes = PASSES_OF_A_LIMIT if timed else PASSES
        self._tried = {_key(tables)}
        self._pass = self._idle = 0
        self._candidates = self._of_pass()

    def batch(self, count: int) -> list[Tables]:
        """Return up to ``count`` candidates, the first to be preferred; none: it is smallest."""
        found: list[Tables] = []
        while len(found) < count and self._idle < len(self._passes):
            candidate = next(self._candidates, None)
            if candidate is None:
                if found:
                    return found
                self._idle += 1
                self._pass += 1
                self._candidates = self._of_pass()
            elif (key := _key(candidate)) not in self._tried:
                self._tried.add(key)
                if leaves_a_team(candidate):
                    found.append(candidate)
        return found

    def take(self, batch: Iterable[tuple[Tables, float | None]]) -> bool:
        """Take when each candidate of a batch violated the property; return whether one did.

        The first that did is the smallest from now on, so that a larger batch changes no result.
        """
        for candidate, violated_s in batch:
            if violated_s is not None:
                self.smallest, self._violated_s = candidate, violated_s
                self._idle, self._candidates = 0, self._of_pass()
                return True
        return False

    def _of_pass(self) -> Iterator[Tables]:
        return self._passes[self._pass % len(self._passes)](self.smallest, self._violated_s)


def shrunk(
    tables: Tables, fails: Fails, budget: int = 10_000, timed: bool = False
) -> Tables | None:
    """Return the smallest tables found that fail; None where the given ones do not.

    budget: how many candidates are tried at most.
    """
    violated_s = fails(tables)
    if violated_s is None:
        return None
    shrinker = Shrinker(tables, violated_s, timed)
    while budget > 0 and (batch := shrinker.batch(1)):
        budget -= 1
        shrinker.take((each, fails(each)) for each in batch)
    return shrinker.smallest


def tidy(tables: Tables) -> Tables:
    """Return tables without empty ones."""
    return {key: value for key, value in tables.items() if value not in ([], {}, None)}


def limit_s(tables: Tables) -> float | None:
    """Return the time in which the team is to form its formation [s]; None for no limit."""
    found: float | None = (tables.get("expect") or {}).get("converge_within_s")
    return found


def _shorter(tables: Tables, violated_s: float) -> Iterator[Tables]:
    """Yield tables that end soon after the violation.

    A violation at the very end may have shown earlier: two flights may part at any time.
    """
    at_end = violated_s >= tables["duration_s"]
    shares = (0.05, 0.1, 0.25, 0.5, 0.9) if at_end else ()
    soon_s = [] if at_end else [violated_s + AFTER_S]
    for after_s in (*soon_s, *(share * violated_s for share in shares)):
        end_s = ceil(10.0 * after_s) / 10.0
        if end_s < tables["duration_s"]:
            yield from _ending(tables, end_s)


def _fair(tables: Tables, _: float) -> Iterator[Tables]:
    """Yield tables with no more time than is fair for the team that is left."""
    given_s = limit_s(tables)
    if given_s is not None:
        yield from _allowing(tables, min(given_s, fair_s(tables)))


def _certain(tables: Tables, certain_s: float) -> Iterator[Tables]:
    """Yield tables with no more time than it takes to be certain that more does not help."""
    given_s, enough_s = limit_s(tables), float(ceil(certain_s - quiet_from_s(tables)))
    if given_s is not None and 1.0 <= enough_s < given_s:
        yield from _allowing(tables, enough_s)


def _allowing(tables: Tables, allowed_s: float) -> Iterator[Tables]:
    """Yield tables with a time limit, and the 3 s for which a team must stay in its places."""
    end_s = quiet_from_s(tables) + allowed_s + 3.0
    if end_s < tables["duration_s"]:
        found = copy.deepcopy(tables) | {"duration_s": end_s}
        found["expect"] |= {key: allowed_s for key in LIMITS if key in found["expect"]}
        yield found


def quiet_from_s(tables: Tables) -> float:
    """Return when the last event begins or ends [s]."""
    ends = [each["at_s"] + (each.get("for_s") or 0.0) for each in tables.get("event") or ()]
    return float(ceil(max(ends, default=0.0)))


def _ending(tables: Tables, end_s: float) -> Iterator[Tables]:
    """Yield tables that end at a time, without the time limits, which are not what is violated.

    One that is longer than the flight would be objected to. Nor need it form anything, except for
    the invariants of the allocation, which are judged only where it does.
    """
    found = copy.deepcopy(tables) | {"duration_s": end_s}
    found["event"] = [each for each in found.get("event") or () if each["at_s"] < end_s]
    for event in found["event"]:
        if event.get("for_s") and event["at_s"] + event["for_s"] > end_s:
            event["for_s"] = round(max(0.1, end_s - event["at_s"]), 1)
    expect = found.get("expect") or {}
    if any(key in expect for key in LIMITS):
        untimed = {key: value for key, value in expect.items() if key not in LIMITS}
        yield {**found, "expect": {**untimed, "converge": False}}
        found["expect"] = untimed
    yield found


def _fewer_events(tables: Tables, _: float) -> Iterator[Tables]:
    """Yield tables without all, half, a quarter of the events, and so on."""
    events = tables.get("event") or []
    size = len(events)
    while size:
        for first in range(0, len(events), size):
            left = events[:first] + events[first + size :]
            yield copy.deepcopy({**tables, "event": left})
        size //= 2


def _without_tables(tables: Tables, _: float) -> Iterator[Tables]:
    for name in TABLES:
        if tables.get(name):
            yield copy.deepcopy({key: value for key, value in tables.items() if key != name})


def _one_line(tables: Tables, _: float) -> Iterator[Tables]:
    """Yield tables with a formation of one queue, which a team of any size can form."""
    if tables.get("formation") != FALLBACK:
        yield copy.deepcopy({**tables, "formation": FALLBACK})


def _fewer_agents(tables: Tables, _: float) -> Iterator[Tables]:
    agents, start = tables["fleet"]["agents"], tables["fleet"].get("start") or {}
    if start.get("kind") != "list":
        for fewer in sorted({2, agents // 2, agents - 1}):
            if 2 <= fewer < agents:
                yield _of_team(copy.deepcopy(tables), range(fewer))
        return
    for kept in (range(2), range(agents // 2), range(agents // 2, agents)):
        if 2 <= len(kept) < agents:
            yield _of_team(copy.deepcopy(tables), kept)
    for index in reversed(range(agents)):
        if agents > 2:
            yield _of_team(copy.deepcopy(tables), [k for k in range(agents) if k != index])


def _of_team(tables: Tables, kept: Iterable[int]) -> Tables:
    """Return tables of which only some agents are left; they are numbered anew."""
    rows = list(kept)
    new = {old: row for row, old in enumerate(rows)}
    start = tables["fleet"].get("start") or {}
    for name in ("positions_m", "yaws_deg"):
        if start.get("kind") == "list" and start.get(name):
            start[name] = [start[name][row] for row in rows]
    tables["fleet"]["agents"] = len(rows)
    events = [_renumbered(event, new) for event in tables.get("event") or ()]
    tables["event"] = [each for each in events if each is not None]
    groups = [_renumbered(each, new) for each in tables.get("agent") or ()]
    tables["agent"] = [each for each in groups if each is not None]
    return tables


def _renumbered(event: Tables, new: dict[int, int]) -> Tables | None:
    """Return an event, or a table of agents, that names agents anew; None where none is left."""
    found = dict(event)
    for key in ("kill", "leave", "pause", "restart", "resume", "ids"):
        if key in found:
            found[key] = _renamed(found[key], new)
            if not found[key]:
                return None
    for key, value in found.items():
        if isinstance(value, dict) and "agents" in value:
            found[key] = {**value, "agents": _renamed(value["agents"], new)}
            if not found[key]["agents"]:
                return None
    if "partition" in found:
        found["partition"] = _regrouped(found["partition"], new)
    return found


def _renamed(selectors: list[Any], new: dict[int, int]) -> list[Any]:
    kept = [each for each in selectors if isinstance(each, str) or each in new]
    return [each if isinstance(each, str) else new[each] for each in kept]


def _regrouped(partition: Any, new: dict[int, int]) -> Any:
    if isinstance(partition, list):
        groups = [_renamed(group, new) for group in partition]
        return [group for group in groups if group]
    groups = [group for group in (_renamed(g, new) for g in partition["groups"]) if group]
    found = {**partition, "groups": groups}
    if "bridge" in found:
        found["bridge"] = _renamed(found["bridge"], new)
    return found


def _fewer_items(tables: Tables, _: float) -> Iterator[Tables]:
    for path in ((name,) for name in LISTS):
        yield from _without_items(tables, path)
    yield from _without_items(tables, ("netem", "link"))


def _fewer_keys(tables: Tables, _: float) -> Iterator[Tables]:
    for name in KEYS_OF:
        yield from _without_keys(tables, (name,))
    for name in SENSORS:
        yield from _without_keys(tables, ("sensor", name))


def _milder(tables: Tables, _: float) -> Iterator[Tables]:
    """Yield tables of which one fault strikes fewer agents, or has a key less."""
    for index, event in enumerate(tables.get("event") or ()):
        for key, value in event.items():
            if isinstance(value, dict):
                for inner in value:
                    yield _changed(tables, index, {key: _without(value, inner)})
                for fewer in _fewer_selected(value.get("agents")):
                    yield _changed(tables, index, {key: {**value, "agents": fewer}})
            if isinstance(value, list) and key in ("kill", "leave", "pause", "restart"):
                for fewer in _fewer_selected(value):
                    yield _changed(tables, index, {key: fewer})


def _fewer_selected(selectors: Any) -> Iterator[list[Any]]:
    """Yield selectors of fewer agents: without one of them, or of fewer at random."""
    kept = selectors if isinstance(selectors, list) else []
    for at, each in enumerate(kept):
        others = kept[:at] + kept[at + 1 :]
        if others:
            yield others
        kind, _, count = str(each).partition(":")
        fewer = {1, int(count) // 2} if kind == "random" else {1} if kind == "all" else set[int]()
        for number in sorted(fewer):
            if number >= 1 and f"random:{number}" != each:
                yield [*others, f"random:{number}"]


def _briefer(tables: Tables, _: float) -> Iterator[Tables]:
    """Yield tables of which one fault is shorter, comes once, or at a whole second."""
    for index, event in enumerate(tables.get("event") or ()):
        for_s = event.get("for_s") or 0.0
        for shorter in (1.0, float(int(for_s / 2.0))):
            if 1.0 <= shorter < for_s:
                yield _changed(tables, index, {"for_s": shorter})
        for key in ("at_s", "for_s"):
            if event.get(key) and event[key] != round(event[key]):
                yield _changed(tables, index, {key: float(max(1, round(event[key])))})
        if "every_s" in event:
            yield _changed(tables, index, {}, without="every_s")


def _earlier(tables: Tables, _: float) -> Iterator[Tables]:
    """Yield tables whose events come earlier, all by as much."""
    events = tables.get("event") or []
    first_s = _first_s(tables)
    for by_s in (float(int(each)) for each in (first_s - 1.0, first_s / 2.0, 1.0)):
        if events and by_s >= 1.0 and first_s - by_s >= 1.0:
            found = copy.deepcopy(tables)
            for event in found["event"]:
                event["at_s"] = round(event["at_s"] - by_s, 1)
            yield found


def _earlier_and_shorter(tables: Tables, violated_s: float) -> Iterator[Tables]:
    """Yield tables whose events come earlier, and that end as much earlier."""
    for found in _earlier(tables, violated_s):
        by_s = _first_s(tables) - _first_s(found)
        yield found | {"duration_s": round(tables["duration_s"] - by_s, 1)}


def _first_s(tables: Tables) -> float:
    """Return when the first event comes [s]; 0 for none."""
    return min((float(each["at_s"]) for each in tables.get("event") or ()), default=0.0)


def _rounder(tables: Tables, _: float) -> Iterator[Tables]:
    """Yield tables with a usual value in place of a drawn one, or with fewer digits."""
    for path, key, usual in USUAL:
        if _inner(tables, path).get(key, usual) != usual:
            found = copy.deepcopy(tables)
            _inner(found, path)[key] = usual
            yield found
    start = tables["fleet"].get("start") or {}
    for digits in (0, 1):
        if start.get("kind") == "list":
            found = copy.deepcopy(tables)
            inner = found["fleet"]["start"]
            inner["positions_m"] = [
                [round(x, digits) for x in each] for each in inner["positions_m"]
            ]
            yield found
    for name in ("netem", "frame"):
        for key, value in _inner(tables, (name,)).items():
            if isinstance(value, float) and value != round(value):
                found = copy.deepcopy(tables)
                found[name][key] = float(round(value)) or value
                yield found


FEWER = (_fewer_events, _without_tables, _one_line, _fewer_agents)
SIMPLER = (_fewer_items, _fewer_keys, _milder, _briefer, _rounder)
PASSES = (_shorter, *FEWER, _earlier, _shorter, *SIMPLER)
PASSES_OF_A_LIMIT = (_fair, *FEWER, _earlier_and_shorter, _fair, *SIMPLER, _certain)
"""A limit becomes shorter than fair last: a team that comes to rest later is then no smaller."""


def _changed(tables: Tables, index: int, change: Tables, without: str = "") -> Tables:
    """Return tables of which one event is changed."""
    found = copy.deepcopy(tables)
    found["event"][index] |= change
    found["event"][index].pop(without, None)
    return found


def _without(table: Tables, key: str) -> Tables:
    return {name: value for name, value in table.items() if name != key}


def _inner(tables: Tables, path: tuple[str, ...]) -> Any:
    for name in path:
        tables = (tables.get(name) or {}) if isinstance(tables, dict) else {}
    return tables


def _without_items(tables: Tables, path: tuple[str, ...]) -> Iterator[Tables]:
    for index in range(len(_inner(tables, path))):
        found = copy.deepcopy(tables)
        del _inner(found, path)[index]
        yield found


def _without_keys(tables: Tables, path: tuple[str, ...]) -> Iterator[Tables]:
    for key in _inner(tables, path):
        if key not in NEEDED and key not in LIMITS:
            found = copy.deepcopy(tables)
            del _inner(found, path)[key]
            yield found


def _key(tables: Tables) -> bytes:
    return msgspec.json.encode(tables, order="sorted")
