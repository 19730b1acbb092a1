"""Trials: scenarios that first hurt a team, and then leave it alone.

In the first part of a trial, faults of all kinds come and go. Then every fault that can end has
ended; agents that were killed or left stay away. From there on the team has a limited time to
form its formation, and must then stay in it. The radio itself stays mild, so that this is fair.
"""

from collections import Counter
from collections.abc import Iterable
from itertools import product
from math import ceil, cos, dist, radians, sin
from typing import Any, NamedTuple

import msgspec

from agent.messages import Place
from agent.qstructure.formation import Formation, FormationSpec, formation_of
from worldsim.scenario.file import formation_tables
from worldsim.scenario.library import FORMATIONS
from worldsim.search.drafts import Objection, accepted
from worldsim.search.draws import GeneDraw, Genes, Tables
from worldsim.search.fleets import KINDS, agents_that_differ, carried, sensor, start
from worldsim.search.formations import formation
from worldsim.search.surroundings import cylinder, sphere
from worldsim.search.timelines import ONCE, Timeline

LEAST_S = 60.0
"""No trial is shorter [s; simulated time]."""
MOST_AGENTS = 12
DRAFTS = 40
SETTLES_S = 30.0
"""Time for news to spread and a team to settle, beside the time to fly [s]."""
HURT_S = (15.0, 30.0)
BLIND_SHARE = 0.25
"""Share of its speed at which a vehicle flies among others that it knows by their reports alone."""
DETOUR = 1.5
"""How much longer than the straight way an agent's way may be."""
WIDER = 1.7
"""How much wider a start is than a random flight's."""
AROUND_SLOT_M = 1.5
"""An obstacle's surface keeps this distance from every slot [m]."""
SPARED = {"intruder", "disk_full"}
"""Actions that do nothing in virtual time without a recording."""
MOVES = {"formation", "frame", "join"}
"""Actions by which a slot could come to be in an obstacle."""
VARIED = frozenset({"event", "netem", "seed", "duration_s", "expect", "name"})
"""What a trial of a given scenario changes; all else of it stays as it is."""
SENSORS = (*[["proximity"]] * 6, [], ["sonar"], ["laser"])
MOST_SCANNING = 4
"""So many agents scan at most: a scan costs as much as all else that an agent does."""
TICK_HZ = (20.0, 20.0, 20.0, 10.0, 40.0)


class Trial(NamedTuple):
    """A scenario to fly, and the numbers that it was drawn from."""

    text: str
    genes: Genes


class Terms(NamedTuple):
    """What all trials of a search have in common."""

    controller: str | None = None
    """None: the default, or that of the base."""
    base: Tables | None = None
    """The resolved tables of a scenario that is varied; None: everything is drawn."""
    allowed: frozenset[str] = frozenset()
    """The keys of the base that `qswarm check` warns of: the user has been told."""
    safety_only: bool = False
    """Whether nothing is expected but safety and conservation."""


def trial(
    name: str, words: tuple[object, ...], terms: Terms, check: Objection, given: Genes
) -> Trial:
    """Return a trial whose numbers are ``given``, and drawn where they are not.

    words: the seed of those that are drawn. check: objects to drafts. Raises LookupError where it
    objects to every draft.
    """
    objections = Counter[str]()
    for attempt in range(DRAFTS):
        draw = GeneDraw(*words, attempt, given=given)
        tables = _of_base(draw, terms, terms.base) if terms.base else _drawn(draw, terms)
        kept = frozenset(terms.base or ()) - VARIED
        text = accepted({"name": name, **tables}, objections, check, kept)
        if text is not None:
            return Trial(text, draw.used)
        given = {}
    raise LookupError(f"{name}: no draft is accepted; objections to {objections.most_common(3)}")


def _drawn(draw: GeneDraw, terms: Terms) -> Tables:
    """Return the tables of a trial of which everything is drawn."""
    team = draw.part("team")
    agents = team.among((2, 3, 4, 5, team.whole(2, MOST_AGENTS), team.whole(4, MOST_AGENTS)))
    separation = team.among((0.25, 0.25, team.number(0.15, 0.4)))
    spacing = team.among((1.0, 1.0, team.number(max(0.8, separation + 0.5), 1.6)))
    tick_hz = team.among(TICK_HZ)
    place = draw.part("start")
    made: Tables = {
        "seed": team.whole(0, 2**31),
        "control": {"separation_m": separation, "spacing_m": spacing},
        "fleet": {"agents": agents, "tick_hz": tick_hz},
    }
    made["fleet"]["start"] = _near(start(place, agents, separation))
    made["formation"] = formation(draw.part("formation"), agents, spacing, separation + 0.25)
    vehicle = draw.part("vehicle")
    made["vehicle"] = {
        "kind": vehicle.among(KINDS),
        "sensors": vehicle.among(SENSORS),
        "max_speed_mps": vehicle.among((0.5, 0.5, vehicle.number(0.4, min(1.0, 0.05 * tick_hz)))),
    }
    if agents > MOST_SCANNING and made["vehicle"]["sensors"]:
        made["vehicle"]["sensors"] = ["proximity"]
    made["agent"] = _alike(agents_that_differ(vehicle, agents, tick_hz))
    made["sensor"] = sensor(draw.part("sensor"), carried(made["vehicle"], made["agent"]))
    made["netem"] = _mild_radio(draw.part("radio"))
    made["frame"] = _frame(draw.part("frame"))
    if terms.controller is not None:
        made["control"]["controller"] = terms.controller
    reach_m = _team(made).reach_m(agents)
    if draw.part("obstacles").chance(0.3) and len(made["frame"]["waypoints_m"]) == 1:
        made["obstacle"] = _obstacles(draw.part("obstacle"), _slots(made))
    return _timed(draw, made, terms, 0.0, DETOUR * (reach_m + spacing * agents))


def _of_base(draw: GeneDraw, terms: Terms, base: Tables) -> Tables:
    """Return the tables of a scenario with another seed, another radio and more faults."""
    made: Tables = msgspec.json.decode(msgspec.json.encode(base))
    made["seed"] = draw.part("team").whole(0, 2**31)
    if terms.controller is not None:
        made["control"]["controller"] = terms.controller
    radio = draw.part("radio")
    if radio.chance(0.5):
        made["netem"] |= _mild_radio(radio)
    ends_s = [each["at_s"] + (each.get("for_s") or 0.0) for each in made.get("event") or ()]
    agents, spacing = made["fleet"]["agents"], made["control"]["spacing_m"]
    reach_m = DETOUR * (8.0 + spacing * agents)
    return _timed(draw, made, terms, max(ends_s, default=0.0), reach_m)


def _timed(draw: GeneDraw, made: Tables, terms: Terms, busy_s: float, way_m: float) -> Tables:
    """Add the timeline, the duration and what is expected.

    busy_s: until when the scenario's own events last [s]; way_m: the longest way to a slot.
    """
    hurt_s = max(draw.part("hurt").number(*HURT_S, 0), ceil(busy_s))
    slowest = _slowest(made)
    expect = made.get("expect") or {}
    alone_s = float(ceil(SETTLES_S + way_m / _pace(made)))
    alone_s = max(alone_s, expect.get("converge_within_s") or 0.0, LEAST_S - hurt_s)
    made["event"] = [*(made.get("event") or ()), *_faults(draw, made, hurt_s, slowest)]
    made["event"].sort(key=lambda each: float(each["at_s"]))
    forms = expect.get("converge", True) and not terms.safety_only
    made["expect"] = {**expect, "converge": forms, "idle_faults": True}
    if forms:
        made["expect"] |= {"converge_within_s": alone_s, "reform_within_s": alone_s}
    else:
        for key in ("converge_within_s", "reform_within_s", "in_formation_fraction"):
            made["expect"].pop(key, None)
    # Three seconds more: to be in place is to be there for two of them.
    made["duration_s"] = max(hurt_s, _over_s(made["event"])) + alone_s + 3.0
    return made


def _over_s(events: Iterable[Tables]) -> float:
    """Return when the last step is over that a slow agent has begun in its fault [s]."""
    slow = (each for each in events if "slow" in each)
    over_s = (each["at_s"] + (each.get("for_s") or 0.0) + each["slow"]["delay_s"] for each in slow)
    return float(ceil(max(over_s, default=0.0)))


def fair_s(made: Tables) -> float:
    """Return a fair time for a team to form its formation, after all faults have ended [s]."""
    agents, spacing = made["fleet"]["agents"], (made.get("control") or {}).get("spacing_m", 1.0)
    way_m = DETOUR * (_team(made).reach_m(agents) + spacing * agents)
    return float(ceil(SETTLES_S + way_m / _pace(made)))


def _faults(draw: GeneDraw, made: Tables, hurt_s: float, slowest: float) -> list[Tables]:
    """Return events of which every one that can end has ended at a time [s]."""
    first = draw.part("faults")
    count = first.among((0, 1, 2, 3, 5, 8))
    timeline = Timeline(first, {"agent": [], **made, "duration_s": hurt_s}, slowest)
    events: list[Tables] = []
    for number in range(count):
        event = timeline.next_event(draw.part("event", number))
        if event.keys() & (SPARED if not made.get("obstacle") else {*SPARED, *MOVES}):
            continue
        at_s = event["at_s"] = min(event["at_s"], hurt_s - 1.0)
        if _can_end(event) or "for_s" in event:
            left_s = round(hurt_s - at_s, 1)
            event["for_s"] = max(0.1, min(event.get("for_s", left_s), left_s))
        if leaves_a_team({**made, "event": [*events, event]}):
            events.append(event)
    return events


def leaves_a_team(tables: Tables) -> bool:
    """Return whether two agents stay in any case, or one of two, and one never stops.

    Only agents know the mission: it is lost with the last process that was given it.
    """
    agents: int = tables["fleet"]["agents"]
    stopped = lost = 0
    for event in tables.get("event") or ():
        for kind in ("kill", "leave", "restart"):
            count = sum(_most(each, agents) for each in event.get(kind, ()))
            stopped += count
            lost += count if kind != "restart" and "for_s" not in event else 0
    return stopped < agents and agents - lost >= min(agents, 2)


def _most(selector: int | str, agents: int) -> int:
    """Return how many agents a selector selects at most."""
    kind, _, count = str(selector).partition(":")
    if kind in ("netem", "world"):
        return 0
    if kind == "random":
        return int(count)
    return agents if kind in ("queue", "all") else 1


def _can_end(event: Tables) -> bool:
    """Return whether a fault has to end: only agents may stay away."""
    if event.keys() & {"kill", "leave"}:
        struck: list[int | str] = event.get("kill", [])
        return "netem" in struck
    return not event.keys() & ONCE


def _mild_radio(draw: GeneDraw) -> Tables:
    """Return a radio over which a team can settle in time."""
    table: Tables = {}
    if draw.chance(0.6):
        table["loss_percent"] = draw.among((5.0, 10.0, 20.0, draw.number(0.0, 20.0, 0)))
    if draw.chance(0.6):
        table["delay_ms"] = draw.among((20.0, 50.0, draw.number(1.0, 100.0, 0)))
        if draw.chance(0.5):
            table["jitter_ms"] = draw.number(1.0, table["delay_ms"], 0)
    if draw.chance(0.15):
        table["duplicate_percent"] = draw.number(1.0, 10.0, 0)
    return table


def _near(table: Tables) -> Tables:
    """Return a start within 2 m of the origin, and wider: else it would be the nearest moment."""
    if table["kind"] == "box":
        near = [max(-2.0, min(2.0, each)) for each in table["centre_m"]]
        size = [round(WIDER * each, 2) for each in table["size_m"]]
        spacing = round(WIDER * table["spacing_m"], 2)
        return {**table, "centre_m": near, "size_m": size, "spacing_m": spacing}
    places = table["positions_m"]
    middle = [sum(axis) / len(places) for axis in zip(*places, strict=True)]
    moved = [
        [round(WIDER * (each - mid), 3) for each, mid in zip(place, middle, strict=True)]
        for place in places
    ]
    return {**table, "positions_m": moved}


def _alike(tables: list[Tables]) -> list[Tables]:
    """Return the tables of agents that differ, none of them too slow to arrive in time."""
    slow = (
        "max_speed_mps",
        "max_climb_mps",
        "max_yaw_rate_dps",
        "max_accel_mps2",
        "max_tilt_deg",
        "sensors",
    )
    kept = [
        {
            **each,
            "vehicle": {key: value for key, value in each["vehicle"].items() if key not in slow},
        }
        for each in tables
    ]
    return [each for each in kept if each["vehicle"]]


def _frame(draw: GeneDraw) -> Tables:
    """Return a frame near the origin, at rest or slow."""
    here = draw.point(1.0, 0.5)
    if draw.chance(0.65):
        return {"waypoints_m": [here], "yaw_deg": draw.number(-180, 180, 0)}
    legs = [draw.point(2.0, 0.5) for _ in range(draw.whole(1, 2))]
    points = [here]
    for leg in legs:
        points.append([round(a + b, 2) for a, b in zip(points[-1], leg, strict=True)])
    return {"waypoints_m": points, "speed_mps": draw.number(0.03, 0.12)}


def _obstacles(draw: GeneDraw, slots: list[list[float]]) -> list[Tables]:
    """Return obstacles at rest of which none is near a slot [m; world frame]."""
    found = []
    for number in range(draw.whole(1, 3)):
        each = draw.part("obstacle", number)
        table = each.among((sphere, cylinder))(each)
        table["radius_m"] = min(table["radius_m"], 0.6)
        centre = each.point(4.0, 0.5)
        axes = 2 if table["shape"] == "cylinder" else 3  # a cylinder may be as high as a slot
        keep_m = table["radius_m"] + AROUND_SLOT_M
        if all(dist(centre[:axes], slot[:axes]) > keep_m for slot in slots):
            found.append({**table, "centre_m": centre})
    return found


def _slots(made: Tables) -> list[list[float]]:
    """Return where slots of the team can be, for any number of agents that is left [m]."""
    team, (x, y, z) = _team(made), made["frame"]["waypoints_m"][0]
    turn, agents = radians(made["frame"].get("yaw_deg", 0.0)), made["fleet"]["agents"]
    found = []
    for queue, rank, left in product(range(len(team.queues)), range(agents), range(1, agents + 1)):
        slot = team.slot(Place(queue, rank), left)
        if slot is not None:
            a, b, c = slot.point
            away = (a * cos(turn) - b * sin(turn), a * sin(turn) + b * cos(turn))
            found.append([x + away[0], y + away[1], z + c])
    return found


def _team(made: Tables) -> Formation:
    tables: Any = made["formation"]
    if "file" in tables:
        tables = formation_tables(FORMATIONS / f"{tables['file']}.toml")
    return formation_of(
        msgspec.convert(tables, FormationSpec), (made.get("control") or {}).get("spacing_m", 1.0)
    )


def _pace(made: Tables) -> float:
    """Return how fast the slowest agent flies to its slot [m/s]."""
    own = made.get("vehicle") or {}
    changed = [{**own, **each["vehicle"]} for each in made.get("agent") or ()]
    sees = all("proximity" in each.get("sensors", ["proximity"]) for each in (own, *changed))
    return _slowest(made) * (1.0 if sees else BLIND_SHARE)


def _slowest(made: Tables) -> float:
    """Return the slowest agent's greatest speed [m/s]."""
    own = (made.get("vehicle") or {}).get("max_speed_mps", 0.5)
    changes = [each["vehicle"].get("max_speed_mps") for each in made.get("agent") or ()]
    return float(min(each for each in (own, *changes) if each))
