"""Laws of who hears whom, on whole flights in virtual time: Lemma 7 (E20), and E14."""

from collections import Counter
from collections.abc import Iterator
from itertools import combinations
from math import dist

from worldsim.engine.virtual import VirtualFleet
from worldsim.scenario.file import parse

ROUNDING_M = 1e-9
SCATTERED = """
seed = {seed}
[fleet]
agents = 6
start = {{ kind = "box", size_m = [7, 7, 2], spacing_m = 0.6 }}
[netem]
range_m = 3.0
loss_percent = 30
delay_ms = 80
[formation]
name = "line"
vertices = {{ V1 = [0, 0, 0] }}
queue = [{{ name = "Q1", vertices = ["V1"], shape = {{ kind = "ray", direction = [1, 0, 0] }} }}]
"""
UNDER_WAY = """
seed = {seed}
[fleet]
agents = 6
start = {{ kind = "box", size_m = [4, 4, 2], spacing_m = 0.6 }}
[vehicle]
kind = "{kind}"
[netem]
range_m = 2.5
loss_percent = 30
delay_ms = 80
[formation]
name = "line"
vertices = {{ V1 = [0, 0, 0] }}
queue = [{{ name = "Q1", vertices = ["V1"], shape = {{ kind = "ray", direction = [-1, 0, 0] }} }}]
[frame]
waypoints_m = [[0, 0, 0], [1.5, 0, 0], [1.5, 3, 0]]
speed_mps = 0.4
yaw = "path"
turn_dps = 20
[[obstacle]]
shape = "sphere"
waypoints_m = [[3, -3, 0], [0, 4, 0]]
speed_mps = 0.4
radius_m = 0.4
"""
CHAIN = """
control = { allocation = "$allocation" }
[fleet]
agents = 5
[fleet.start]
kind = "list"
positions_m = [[0, 0.3, 0], [1, 0.3, 0], [2, 0.3, 0], [3, 0.3, 0], [4, 0.3, 0]]
[netem]
range_m = 2.2
[formation]
name = "line"
vertices = { V1 = [0, 0, 0] }
queue = [{ name = "Q1", vertices = ["V1"], shape = { kind = "ray", direction = [1, 0, 0] } }]
"""


KINDS = ("kinematic", "accelerating", "forward")
FLIGHTS = [SCATTERED.format(seed=seed) for seed in range(3)]
FLIGHTS += [UNDER_WAY.format(seed=seed, kind=kind) for seed, kind in enumerate(KINDS)]
"""Flights to form up, and flights with a frame that moves and turns, past a ball that moves too."""


def flown(text: str, duration_s: float) -> Iterator[tuple[VirtualFleet, list]]:
    """Fly a scenario; yield the fleet after every slot, and where all stood in each slot so far."""
    scenario = parse(text)
    fleet = VirtualFleet(scenario)
    track = [fleet.loop.world.vehicles.position.tolist()]
    for _ in range(round(duration_s * scenario.slot_hz)):
        fleet.slot()
        track.append(fleet.loop.world.vehicles.position.tolist())
        yield fleet, track


def who_is_out_of_range_stays_off() -> None:
    """Lemma 7, E20: out of range at t0, a pair is still d_c - 2 v_max (t - t0) apart at t."""
    speed, ago, pairs = 0.5, 80, 0
    for text in FLIGHTS:
        range_m = parse(text).netem.range_m
        for fleet, track in flown(text, 6.0):
            slot_hz = fleet.loop.world.clock.slot_hz
            now = track[-1]
            for back in range(1, min(ago, len(track)), 7):
                before, room = track[-1 - back], 2.0 * speed * back / slot_hz
                for i, j in combinations(range(len(now)), 2):
                    if dist(before[i], before[j]) >= range_m:
                        pairs += 1
                        assert dist(now[i], now[j]) >= range_m - room - ROUNDING_M, (i, j, back)
    assert pairs > 1000


def what_was_heard_bounds_what_is() -> None:
    """Lemma 7, E20: a pair last heard at distance r_h stays r_h - 2 v_max age apart."""
    speed, heard = 0.5, 0
    for text in FLIGHTS:
        for fleet, track in flown(text, 6.0):
            clock, now = fleet.loop.world.clock, track[-1]
            if (len(track) - 1) % clock.slots_per_tick:
                continue
            for i, agent in fleet._agents.items():
                for beacon in agent._neighbours.beacons():
                    then = track[round(beacon.stamp_s * clock.slot_hz)]
                    age_s = clock.time_s(len(track) - 1) - beacon.stamp_s
                    assert dist(then[beacon.id], beacon.position) < ROUNDING_M
                    least = dist(then[i], beacon.position) - 2.0 * speed * age_s
                    assert dist(now[i], now[beacon.id]) >= least - ROUNDING_M, (i, beacon.id)
                    heard += 1
    assert heard > 1000


def only_one_takes_the_vertex() -> None:
    """E14: who hears no vertex agent stands first in its own list, and does not take V_j."""
    for allocation in ("structure", "assignment"):
        for fleet, _ in flown(CHAIN.replace("$allocation", allocation), 6.0):
            places = [command.telemetry.place for command in fleet.loop.world.latest if command]
        assert Counter(places) == Counter((0, rank) for rank in range(5)), allocation


LAWS = {
    "Lemma 7 range": who_is_out_of_range_stays_off,
    "Lemma 7 heard": what_was_heard_bounds_what_is,
    "E14": only_one_takes_the_vertex,
}
