"""Random obstacles at rest and in motion, and random motion of the target's frame."""

from math import cos, hypot, pi, sin

from worldsim.search.draws import Draw, Tables

NEAR_M = 1.2
FAR_M = 9.0
MAX_SHARE = 0.6
"""Obstacles and frames are slower than the slowest vehicle by this factor at most."""


def obstacles(draw: Draw, slowest: float, about: list[float]) -> list[Tables]:
    """Return obstacles near a point [m; world frame]; a third of them moves."""
    found = []
    for _ in range(draw.among((0, 0, 1, 2, 4, 8))):
        kind = draw.among((sphere, box, cylinder, None))
        if kind is None:
            found.append(wall(draw, about))
            continue
        table = kind(draw)
        place = around(draw, about)
        if draw.chance(0.35):
            table |= path(draw, place, slowest)
        else:
            table["centre_m"] = place
        found.append(table)
    return found


def around(draw: Draw, about: list[float]) -> list[float]:
    """Return a place around a point [m; world frame]."""
    away, turn = draw.scale(NEAR_M, FAR_M), draw.number(-pi, pi)
    x, y, z = about
    height = draw.number(-1.5, 1.5)
    return [round(x + away * cos(turn), 2), round(y + away * sin(turn), 2), round(z + height, 2)]


def sphere(draw: Draw) -> Tables:
    """Return a sphere without its place."""
    return {"shape": "sphere", "radius_m": draw.scale(0.1, 1.5)}


def box(draw: Draw) -> Tables:
    """Return a box without its place."""
    size = [draw.scale(0.1, 3.0) for _ in range(3)]
    return {"shape": "box", "size_m": size, "yaw_deg": draw.number(-180, 180, 0)}


def cylinder(draw: Draw) -> Tables:
    """Return a cylinder without its place."""
    return {"shape": "cylinder", "radius_m": draw.scale(0.05, 1), "height_m": draw.scale(0.2, 8)}


def wall(draw: Draw, about: list[float]) -> Tables:
    """Return a wall near a point [m; world frame]."""
    one, two = around(draw, about), around(draw, about)
    foot = round(about[2] - 1.0, 2)
    return {
        "shape": "wall",
        "from_m": [*one[:2], foot],
        "to_m": [*two[:2], foot],
        "height_m": draw.number(0.5, 4.0),
        "thickness_m": draw.among((0.1, draw.scale(0.02, 1.0))),
    }


def path(draw: Draw, place: list[float], slowest: float) -> Tables:
    """Return the way of an obstacle that moves from a place [m; world frame]."""
    shift = draw.point(5.0, 1.0)
    ends = [round(a + b, 2) for a, b in zip(place, shift, strict=True)]
    table: Tables = {"waypoints_m": [place, ends]}
    table["speed_mps"] = draw.number(0.02, MAX_SHARE * slowest, 3)
    if draw.chance(0.4):
        table["at_end"] = draw.among(("back", "stop"))
    if draw.chance(0.4):
        table["from_s"] = draw.number(0.0, 10.0, 1)
    return table


def field(draw: Draw, about: list[float]) -> Tables:
    """Return a field of obstacles beside the start."""
    x, y, z = about
    table: Tables = {"centre_m": [round(x + 6.0, 2), y, z]}
    table |= draw.among(({"count": draw.whole(1, 8)}, {"density_per_m3": draw.scale(0.01, 0.1)}))
    table["size_m"] = [draw.number(4.0, 9.0), draw.number(4.0, 9.0), draw.number(0.0, 4.0)]
    table["shape"] = draw.among(("sphere", "cylinder"))
    if draw.chance(0.5):
        table |= {"corridor_m": draw.number(1.2, 2.5), "clear_of_start_m": draw.number(0.6, 3.0)}
    return table


def frame(draw: Draw, slowest: float, about: list[float]) -> Tables:
    """Return a frame that rests, or that flies through two to five waypoints."""
    here = [round(each + draw.number(-1.0, 1.0), 2) for each in about]
    if draw.chance(0.5):
        return {"waypoints_m": [here], "yaw_deg": draw.number(-180, 180, 0)}
    table = moving(draw, slowest, here)
    if draw.chance(0.5):
        table["yaw"] = draw.among(("fixed", "path"))
    if draw.chance(0.3):
        table |= {"yaw_deg": draw.number(-180, 180, 0), "turn_dps": draw.scale(0.2, 6.0)}
    return table


def moving(draw: Draw, slowest: float, here: list[float]) -> Tables:
    """Return waypoints that start at a place [m; world frame], with a speed."""
    points = [here]
    for _ in range(draw.whole(1, 4)):
        leg = draw.point(4.0, 1.0)
        if hypot(*leg) > 0.1:
            points.append([round(a + b, 2) for a, b in zip(points[-1], leg, strict=True)])
    table: Tables = {"waypoints_m": points}
    if len(points) > 1:
        table["speed_mps"] = draw.number(0.02, MAX_SHARE * slowest, 3)
        if draw.chance(0.4):
            table["start_s"] = draw.number(0.0, 8.0, 1)
        if draw.chance(0.3):
            table["pauses_s"] = [draw.number(0.0, 3.0, 1) for _ in points]
    return table
