"""What a recording's 3D views show at a time, read as the viewer does it.

For each component the latest row at or before the time counts, a null row leaves what was before,
and static data wins. Transforms of an entity move everything below it.
"""

from bisect import bisect_right
from collections.abc import Iterator
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rerun.chunk import RrdReader

from worldsim.recording import layout

TRANSLATION, SCALE = "Transform3D:translation", "Transform3D:scale"
TURN = "Transform3D:quaternion"
CLEAR = "Clear:is_recursive"
PLACES = ("Points3D:positions", "Boxes3D:centers", "Ellipsoids3D:centers", "Arrows3D:origins")
STRIPS = "LineStrips3D:strips"

Values = list[Any]


class Row(NamedTuple):
    """A row of a component: when it was logged [s], and where it is."""

    time_s: float
    column: Any
    number: int
    """Its index in the column."""

    def values(self) -> Values:
        """Return what was logged; slow, so done only for what is looked at."""
        values: Values = self.column[self.number].as_py()
        return values


class Scenes:
    """All times of a recording."""

    def __init__(self, recording: Path) -> None:
        self._rows: dict[tuple[str, str], list[Row]] = {}
        self._static: dict[tuple[str, str], Values] = {}
        for chunk in RrdReader(recording).stream():
            self._read(chunk)
        for rows in self._rows.values():
            rows.sort(key=lambda row: row.time_s)

    def at(self, time_s: float) -> "Scene":
        """Return what is shown at a time [s]."""
        found = {key: _latest(rows, time_s) for key, rows in self._rows.items()}
        latest = {key: row for key, row in found.items() if row is not None}
        cleared = {entity: row.time_s for (entity, name), row in latest.items() if name == CLEAR}
        shown = {
            (entity, name): row.values()
            for (entity, name), row in latest.items()
            if not any(
                row.time_s < cleared[above] for above in cleared if f"{entity}/".startswith(above)
            )
        }
        return Scene(shown | self._static)

    def _read(self, chunk: Any) -> None:
        batch = chunk.to_record_batch()
        for name in (name for name in batch.schema.names if ":" in name):
            key, column = (chunk.entity_path, name), batch.column(name)
            if chunk.is_static:
                self._static[key] = column[-1].as_py()
            else:
                times = [at.total_seconds() for at in batch.column(layout.SIM_TIME).to_pylist()]
                there = enumerate(zip(times, column.is_valid().to_pylist(), strict=True))
                self._rows.setdefault(key, []).extend(
                    Row(at, column, number) for number, (at, valid) in there if valid
                )


class Scene:
    """What is shown at one time; shown: values by entity and component."""

    def __init__(self, shown: dict[tuple[str, str], Values]) -> None:
        self._shown = shown

    def entities(self) -> Iterator[str]:
        """Yield the entities of the world that show anything."""
        for entity in sorted({entity for entity, _ in self._shown}):
            if entity.startswith(f"{layout.WORLD}/") and len(self.points(entity)):
                yield entity

    def values(self, entity: str, component: str) -> Values:
        """Return the values of a component; none where there are none."""
        return self._shown.get((entity, component), [])

    def points(self, entity: str) -> np.ndarray:
        """Return where everything of an entity is drawn (K, 3) [m; world frame]."""
        places = [at for component in PLACES for at in self.values(entity, component)]
        places += [at for strip in self.values(entity, STRIPS) for at in strip]
        points = np.array(places, dtype=np.float64).reshape(-1, 3)
        return self._in_world(entity, points[np.isfinite(points).all(axis=1)])

    def rows(self, entity: str, component: str) -> np.ndarray:
        """Return a component of places (K, 3) [m; world frame], NaN where a row is not shown."""
        own = np.array(self.values(entity, component), dtype=np.float64).reshape(-1, 3)
        return self._in_world(entity, own)

    def view(self) -> tuple[np.ndarray, float]:
        """Return the centre (3,) and the radius of the ball that the camera shows [m]."""
        centre = np.array(self.values(layout.TEAM, TRANSLATION)[0])
        return centre, float(self.values(layout.TEAM, SCALE)[0][0])

    def text(self, entity: str) -> str:
        """Return the text of a document."""
        (text,) = self.values(entity, "TextDocument:text")
        return str(text)

    def _in_world(self, entity: str, points: np.ndarray) -> np.ndarray:
        parts = entity.split("/")
        for end in range(len(parts), 1, -1):
            path = "/".join(parts[:end])
            for scale in self.values(path, SCALE):
                points = points * np.array(scale)
            for quaternion in self.values(path, TURN):
                points = points @ _matrix(*quaternion).T
            for translation in self.values(path, TRANSLATION):
                points = points + np.array(translation)
        return points


def _latest(rows: list[Row], time_s: float) -> Row | None:
    """Return the last row at or before a time [s]."""
    before = bisect_right(rows, time_s + 1e-6, key=attrgetter("time_s"))
    return rows[before - 1] if before else None


def _matrix(x: float, y: float, z: float, w: float) -> np.ndarray:
    """Return the rotation of a quaternion (3, 3)."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
