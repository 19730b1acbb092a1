"""A run as scenes for Foxglove's 3D panel: vehicles, names, targets, links and obstacles.

A scene is a message of the schema ``foxglove.SceneUpdate`` in JSON. Each entity replaces the one of
the same id in the scene before.
"""

from collections.abc import Iterable, Iterator
from math import cos, isnan, sin
from typing import Any

from worldsim.judge.tick import Tick
from worldsim.recording import palette
from worldsim.recording.layout import agent_name
from worldsim.scenario.tables import Scenario
from worldsim.truth.obstacles import Obstacles

Json = dict[str, Any]
FRAME = "world"
PRIMITIVES = (
    "arrows",
    "cubes",
    "spheres",
    "cylinders",
    "lines",
    "triangles",
    "texts",
    "models",
)
LINE_LIST = 2
"""foxglove.LinePrimitive's type: points 0 and 1 are a line, 2 and 3 the next."""
UPRIGHT = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
TARGET_M = 0.07
LABEL_PX = 14.0


class Scenes:
    """Makes the scenes of a run."""

    def __init__(self, scenario: Scenario) -> None:
        self._radii_m = [vehicle.radius_m for vehicle in scenario.vehicles]
        self._obstacles = Obstacles(scenario.obstacle)

    def scene(self, tick: Tick) -> Json:
        """Return the scene at a tick."""
        entities = {
            "vehicles": {"cubes": list(self._vehicles(tick))},
            "names": {"texts": list(self._names(tick))},
            "targets": {"spheres": list(_targets(tick))},
            "links": {"lines": _links(tick)},
            "obstacles": dict(self._solids(tick.time_s)),
        }
        at = stamp(tick.time_s)
        return {
            "deletions": [],
            "entities": [_entity(name, at, parts) for name, parts in entities.items()],
        }

    def _vehicles(self, tick: Tick) -> Iterator[Json]:
        for agent, (x, y, z) in _present(tick.position.tolist()):
            radius_m = self._radii_m[agent]
            size = _vector(2.0 * radius_m, 1.24 * radius_m, 0.6 * radius_m)
            pose = {"position": _vector(x, y, z), "orientation": _orientation(tick, agent)}
            yield {"pose": pose, "size": size, "color": _colour(tick, agent)}

    def _names(self, tick: Tick) -> Iterator[Json]:
        for agent, (x, y, z) in _present(tick.position.tolist()):
            above = _vector(x, y, z + 2.0 * self._radii_m[agent])
            yield {
                "pose": {"position": above, "orientation": UPRIGHT},
                "billboard": True,
                "font_size": LABEL_PX,
                "scale_invariant": True,
                "color": _rgba(0x222222FF),
                "text": agent_name(agent),
            }

    def _solids(self, time_s: float) -> Iterator[tuple[str, list[Json]]]:
        if not len(self._obstacles):
            return
        solids, centres = self._obstacles, self._obstacles.centres(time_s).tolist()
        colour = _rgba(int(palette.OBSTACLE))
        for kind, columns in (
            ("spheres", solids.spheres),
            ("cylinders", solids.cylinders),
            ("cubes", solids.boxes),
        ):
            found = []
            for column in columns.tolist():
                half_x, half_y, half_z = solids.half[column].tolist()
                radius = float(solids.radius[column])
                across = (2.0 * radius, 2.0 * radius)
                size = {
                    "spheres": (*across, 2.0 * radius),
                    "cylinders": (*across, 2.0 * half_z),
                    "cubes": (2.0 * half_x, 2.0 * half_y, 2.0 * half_z),
                }[kind]
                turn = _turned(*solids.heading[column].tolist()) if kind == "cubes" else UPRIGHT
                pose = {"position": _vector(*centres[column]), "orientation": turn}
                scale = {"top_scale": 1.0, "bottom_scale": 1.0} if kind == "cylinders" else {}
                found.append({"pose": pose, "size": _vector(*size), "color": colour, **scale})
            yield kind, found


def scene_schema() -> Json:
    """Return the JSON Schema of scenes: the parts of foxglove.SceneUpdate that are used."""
    pose = _object(position=_numbers("x", "y", "z"), orientation=_numbers("x", "y", "z", "w"))
    solid = {
        "pose": pose,
        "size": _numbers("x", "y", "z"),
        "color": _numbers("r", "g", "b", "a"),
    }
    text = {"billboard": _BOOLEAN, "scale_invariant": _BOOLEAN, "font_size": _NUMBER}
    line = {"type": _INTEGER, "scale_invariant": _BOOLEAN, "thickness": _NUMBER}
    points = {"points": _array(_numbers("x", "y", "z")), "indices": _array(_INTEGER)}
    used = {
        "cubes": _object(**solid),
        "spheres": _object(**solid),
        "cylinders": _object(**solid, top_scale=_NUMBER, bottom_scale=_NUMBER),
        "texts": _object(pose=pose, color=solid["color"], text=_STRING, **text),
        "lines": _object(pose=pose, color=solid["color"], **line, **points),
    }
    parts = {name: _array(used.get(name, {"type": "object"})) for name in PRIMITIVES}
    entity = _object(
        timestamp=STAMP_SCHEMA,
        frame_id=_STRING,
        id=_STRING,
        lifetime=STAMP_SCHEMA,
        frame_locked=_BOOLEAN,
        metadata=_array({"type": "object"}),
        **parts,
    )
    deletion = _object(timestamp=STAMP_SCHEMA, type=_INTEGER, id=_STRING)
    update = _object(deletions=_array(deletion), entities=_array(entity))
    return {"title": "foxglove.SceneUpdate", **update}


def stamp(time_s: float) -> Json:
    """Return a simulated time as Foxglove writes times."""
    seconds, nanoseconds = divmod(round(time_s * 1e9), 1_000_000_000)
    return {"sec": seconds, "nsec": nanoseconds}


def _entity(name: str, at: Json, parts: Json) -> Json:
    return {
        "timestamp": at,
        "frame_id": FRAME,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": False,
        "metadata": [],
        **{primitive: parts.get(primitive, []) for primitive in PRIMITIVES},
    }


def _targets(tick: Tick) -> Iterator[Json]:
    for agent, (x, y, z) in _present(tick.target.tolist()):
        pose = {"position": _vector(x, y, z), "orientation": UPRIGHT}
        size = _vector(TARGET_M, TARGET_M, TARGET_M)
        yield {"pose": pose, "size": size, "color": _colour(tick, agent)}


def _links(tick: Tick) -> list[Json]:
    """Return the pairs of agents of which one hears the other, as one list of lines."""
    pairs = sorted({(min(pair), max(pair)) for pair in tick.links.tolist()})
    where = dict(_present(tick.position.tolist()))
    ends = [
        _vector(*where[agent])
        for pair in pairs
        if all(agent in where for agent in pair)
        for agent in pair
    ]
    line = {
        "type": LINE_LIST,
        "pose": {"position": _vector(0.0, 0.0, 0.0), "orientation": UPRIGHT},
        "thickness": 1.0,
        "scale_invariant": True,
        "points": ends,
        "color": _rgba(0x33669940),
        "colors": [],
        "indices": [],
    }
    return [line]


def _present(points: Iterable[list[float]]) -> Iterator[tuple[int, list[float]]]:
    return ((row, point) for row, point in enumerate(points) if not any(map(isnan, point)))


def _orientation(tick: Tick, agent: int) -> Json:
    """Return a vehicle's attitude: yaw, then pitch (nose up), then roll (right side down)."""
    yaw, pitch, roll = tick.attitude[agent].tolist()
    cy, sy, cp, sp = cos(0.5 * yaw), sin(0.5 * yaw), cos(0.5 * pitch), -sin(0.5 * pitch)
    cr, sr = cos(0.5 * roll), sin(0.5 * roll)
    return {
        "x": cy * cp * sr - sy * sp * cr,
        "y": cy * sp * cr + sy * cp * sr,
        "z": sy * cp * cr - cy * sp * sr,
        "w": cy * cp * cr + sy * sp * sr,
    }


def _turned(cosine: float, sine: float) -> Json:
    """Return a turn about the vertical by the angle of this cosine and sine."""
    half_cosine = (0.5 * max(0.0, 1.0 + cosine)) ** 0.5
    half_sine = (0.5 * max(0.0, 1.0 - cosine)) ** 0.5
    return {"x": 0.0, "y": 0.0, "z": half_sine if sine >= 0.0 else -half_sine, "w": half_cosine}


def _colour(tick: Tick, agent: int) -> Json:
    if not tick.alive[agent]:
        return _rgba(int(palette.NOT_RUNNING))
    queue = tick.place[agent, :1]
    known = queue[0] >= 0
    return _rgba(int(palette.queue_colours(queue)[0] if known else palette.UNPLACED))


def _rgba(colour: int) -> Json:
    """Return a colour of 0xRRGGBBAA."""
    shifts = {"r": 24, "g": 16, "b": 8, "a": 0}
    return {name: (colour >> shift & 0xFF) / 255.0 for name, shift in shifts.items()}


def _vector(x: float, y: float, z: float) -> Json:
    return {"x": x, "y": y, "z": z}


_NUMBER: Json = {"type": "number"}
_INTEGER: Json = {"type": "integer"}
_STRING: Json = {"type": "string"}
_BOOLEAN: Json = {"type": "boolean"}


def _object(**properties: Json) -> Json:
    return {"type": "object", "properties": properties}


def _array(items: Json) -> Json:
    return {"type": "array", "items": items}


def _numbers(*names: str) -> Json:
    return _object(**dict.fromkeys(names, _NUMBER))


STAMP_SCHEMA: Json = {"title": "time", **_object(sec=_INTEGER, nsec=_INTEGER)}
