"""The line of a queue whose members gather: where it is at a time, and how near it comes to others.

All members displace their slots by one vector of the target's frame. From a time on the vector
shrinks to zero, so that the line moves as a whole: it speeds up, flies evenly, and slows down.
"""

from collections.abc import Sequence
from math import dist, inf
from typing import Final

from agent.messages import Line, Vector
from agent.structure.tree import VERSIONS_PER_S

RAMP_S: Final = 2.0
"""How long a line takes to speed up, and to slow down: meanwhile its members turn [s]."""
SHARES = (0.25, 0.5, 0.75, 1.0)
"""How far a line is moved towards another's displacement, to keep clear of it. With the whole of it
the two are as far apart as their queues."""
CM: Final = 100.0


def displacement_of(line: Line, now_s: float) -> Vector:
    """Return the displacement of a line's places from the queue's [m; target's frame]."""
    left = _left(
        now_s - line.leaves / VERSIONS_PER_S, (line.arrives - line.leaves) / VERSIONS_PER_S
    )
    return (left * line.x / CM, left * line.y / CM, left * line.z / CM)


def has_left(line: Line, now_s: float) -> bool:
    """Whether the line flies to its vertex, or is there."""
    return now_s >= line.leaves / VERSIONS_PER_S


def has_arrived(line: Line, now_s: float) -> bool:
    """Whether the line is displaced no longer."""
    return now_s >= line.arrives / VERSIONS_PER_S


def flight_s(way_m: float, speed_mps: float) -> float:
    """Return how long a line flies that is never faster than a speed [s]."""
    return way_m / speed_mps + RAMP_S


def _left(flown_s: float, flight_s: float) -> float:
    """Return what is left of the displacement, 1 before the flight and 0 after it."""
    if flown_s <= 0.0:
        return 1.0
    if flown_s >= flight_s:
        return 0.0
    ramp_s = min(RAMP_S, 0.5 * flight_s)
    rate = 1.0 / (flight_s - ramp_s)  # of the way, each second between the ramps
    if flown_s < ramp_s:
        return 1.0 - 0.5 * rate * flown_s * flown_s / ramp_s
    left_s = flight_s - flown_s
    if left_s < ramp_s:
        return 0.5 * rate * left_s * left_s / ramp_s
    return 1.0 - rate * (flown_s - 0.5 * ramp_s)


def centimetres(way: Vector) -> tuple[int, int, int]:
    """Return a vector [m] in whole centimetres, as messages hold it."""
    return (round(CM * way[0]), round(CM * way[1]), round(CM * way[2]))


def clear_displacement(
    wanted: Vector,
    places: Sequence[Vector],
    others: Sequence[tuple[Vector, Sequence[Vector]]],
    clear_m: float,
) -> tuple[Vector, float]:
    """Return a displacement with enough room to other lines, near the wanted one, and the room [m].

    places: of the queue; others: displacement and places of each other line [m; target's frame].
    Where nothing is clear, the one with the most room.
    """
    tried = [wanted]
    tried += [_towards(wanted, other, share) for share in SHARES for other, _ in others]
    best, most_m = wanted, -inf
    for each in tried:
        room_m = room_between(each, places, others)
        if room_m > most_m:
            best, most_m = each, room_m
        if room_m >= clear_m:
            break
    return best, most_m


def room_between(
    displacement: Vector,
    places: Sequence[Vector],
    others: Sequence[tuple[Vector, Sequence[Vector]]],
) -> float:
    """Return the least distance of a line's places from those of other lines [m]."""
    least_m = inf
    for other, theirs in others:
        x, y, z = (a - b for a, b in zip(displacement, other, strict=True))
        for u, v, w in places:
            moved = (u + x, v + y, w + z)
            for there in theirs:
                least_m = min(least_m, dist(moved, there))
    return least_m


def _towards(here: Vector, there: Vector, share: float) -> Vector:
    return (
        here[0] + share * (there[0] - here[0]),
        here[1] + share * (there[1] - here[1]),
        here[2] + share * (there[2] - here[2]),
    )
