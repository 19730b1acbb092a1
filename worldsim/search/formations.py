"""Random formations: of the library, and made of every kind of queue."""

from math import cos, pi, radians, sin

import msgspec

from agent.qstructure.formation import Formation, FormationError, FormationSpec
from agent.qstructure.shape import ShapeError, ShapeSpec, shape_of
from worldsim.scenario.library import FORMATIONS
from worldsim.search.draws import Draw, Tables

TRIES = 30
FALLBACK: Tables = {
    "name": "line",
    "vertices": {"V1": [0.0, 0.0, 0.0]},
    "queue": [
        {"name": "Q1", "vertices": ["V1"], "shape": {"kind": "ray", "direction": [-1.0, 0.0, 0.0]}}
    ],
}
CURVES = (
    ("s", "{a}*sin(s)", "0"),
    ("-s", "{a}*s**0.5", "{b}*s"),
    ("{a}*cos(s)", "{a}*sin(s)", "{b}*s"),
    ("-{a}*s", "tanh(s)", "{b}*cos(2*s)"),
    ("-s", "hypot({a}, s)", "-0.1*s"),
)
ANGLES = ("yaw_deg", "pitch_deg", "roll_deg")


def formation(draw: Draw, agents: int, spacing: float, least: float) -> Tables:
    """Return the tables of a formation that a team of ``agents`` can form, or a library's name.

    spacing: d_ir [m]; least: the least distance between two slots [m].
    """
    if draw.chance(0.25):
        return {"file": draw.among(library())}
    for _ in range(TRIES):
        tables = drawn(draw, agents, spacing)
        if fits(tables, agents, spacing, least):
            return tables
    return FALLBACK


def library() -> list[str]:
    """Return the names of the formations of the library."""
    return sorted(file.stem for file in FORMATIONS.glob("*.toml"))


def fits(tables: Tables, agents: int, spacing: float, least: float) -> bool:
    """Return whether a team of ``agents`` can form a formation without slots too near."""
    if len(tables["vertices"]) > agents:
        return False
    try:
        made = Formation(msgspec.convert(tables, FormationSpec), spacing)
        made.check(agents, least)
    except (FormationError, msgspec.ValidationError):
        return False
    return True


def drawn(draw: Draw, agents: int, spacing: float) -> Tables:
    """Return queues at vertices of their own, at one vertex, or in a chain of vertices."""
    count = draw.whole(1, min(5, agents))
    names = [f"V{k + 1}" for k in range(draw.among((1, count)))]
    vertices = {name: draw.point(3.0, 1.5) for name in names}
    queues = []
    for k in range(count):
        head = names[k % len(names)]
        table: Tables = {"name": f"Q{k + 1}", "vertices": [head], "shape": shape(draw)}
        if draw.chance(0.3):
            close(draw, table, vertices, spacing)
        if draw.chance(0.2):
            table["orientation"] = orientation(draw)
        queues.append(table)
    if draw.chance(0.25):
        share(draw, queues)
    return {"name": "drawn", "vertices": vertices, "queue": queues}


def shape(draw: Draw) -> Tables:
    """Return a queue's shape of any kind."""
    match draw.among(("ray", "ray", "polyline", "arc", "helix", "spline", "curve")):
        case "ray":
            turn = draw.number(-pi, pi)
            level = [round(cos(turn), 3), round(sin(turn), 3), draw.among((0.0, 0.5, -0.3))]
            return {"kind": "ray", "direction": level}
        case "polyline" | "spline" as kind:
            return {"kind": kind, "points_m": corners(draw)}
        case "arc":
            return arc(draw)
        case "helix":
            pitch = draw.among((1.0, -1.0)) * draw.scale(0.3, 4.0)
            return {"kind": "helix", "radius_m": draw.scale(0.4, 4.0), "pitch_m": pitch}
        case _:
            a, b = draw.scale(0.5, 3.0), draw.number(-0.5, 0.5)
            x, y, z = (text.format(a=a, b=b) for text in draw.among(CURVES))
            return {"kind": "curve", "x": x, "y": y, "z": z}


def arc(draw: Draw) -> Tables:
    """Return an arc or a circle."""
    sweep = draw.among((360.0, draw.number(-300, -20, 0), draw.number(20, 300, 0)))
    heading = draw.number(-180, 180, 0)
    return {
        "kind": "arc",
        "radius_m": draw.scale(0.3, 6.0),
        "sweep_deg": sweep,
        "heading_deg": heading,
    }


def corners(draw: Draw) -> list[list[float]]:
    """Return points along a way that turns by up to 70 degrees at each."""
    x, y, z, heading = 0.0, 0.0, 0.0, draw.number(-180, 180, 0)
    points = [[x, y, z]]
    for _ in range(draw.whole(1, 6)):
        heading += draw.number(-70, 70, 0)
        leg = draw.scale(0.4, 3.0)
        x, y = x + leg * cos(radians(heading)), y + leg * sin(radians(heading))
        z += draw.number(-0.5, 0.5)
        points.append([round(x, 3), round(y, 3), round(z, 3)])
    return points


def close(draw: Draw, queue: Tables, vertices: Tables, spacing: float) -> None:
    """End a queue at one or two more vertices, which lie on its shape."""
    try:
        curve = shape_of(msgspec.convert(queue["shape"], ShapeSpec))
    except ShapeError:
        return
    x, y, z = vertices[queue["vertices"][0]]
    along = 0.0
    for _ in range(draw.whole(1, 2)):
        along += spacing * draw.number(1.0, 6.0)
        u, v, w = curve.point(along)
        name = f"V{len(vertices) + 1}"
        vertices[name] = [round(x + u, 4), round(y + v, 4), round(z + w, 4)]
        queue["vertices"].append(name)
    if queue["shape"]["kind"] == "ray" and draw.chance(0.5):
        del queue["shape"]


def share(draw: Draw, queues: list[Tables]) -> None:
    """Give every queue a capacity, or all but the last."""
    parts = [draw.whole(1, 5) for _ in queues]
    for queue, part in zip(queues, parts, strict=True):
        queue["capacity"] = round(part / sum(parts), 4)
    if len(queues) > 1 and draw.chance(0.5):
        del queues[-1]["capacity"]
    else:
        queues[-1]["capacity"] = round(1.0 - sum(each["capacity"] for each in queues[:-1]), 4)


def orientation(draw: Draw) -> Tables:
    """Return the attitude that a queue's slots ask for."""
    keys = draw.some(ANGLES, draw.whole(1, 3))
    choices = (draw.number(-90, 90, 0), "10*d", "20*sin(d)", "45*tanh(d) - 10")
    return {key: draw.among(choices) for key in keys}
