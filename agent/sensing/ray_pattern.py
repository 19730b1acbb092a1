"""Ray directions of scanning sensors: the world casts the rays, the agent maps their echoes.

The body frame has x ahead, y to the left and z up.
"""

from math import cos, pi, radians, sin
from typing import Final, NamedTuple, assert_never

from agent.config import SCANNERS, Laser, ScannerKind, Sensors, Sonar
from agent.messages import Vector

IN_BEAM: Final = 6
"""Rays on each of a beam's two rings about its axis."""
SAME_RAY_RAD: Final = 0.03
"""A ray within this angle of a point looks at the point, not past it."""


class Grid(NamedTuple):
    """A laser's rays: ``rows`` rings of ``columns`` rays each."""

    rows: int
    columns: int
    tilt: float  # half the vertical field of view [rad]
    half: float  # half the horizontal field of view [rad]

    def ray_towards(self, azimuth: float, up: float) -> int | None:
        """Return the ray that looks in a direction [rad; body frame]; None if none does."""
        row = _nearest(up, self.tilt, self.rows)
        column = _nearest(azimuth, self.half, self.columns)
        return None if row is None or column is None else row * self.columns + column


class Pattern(NamedTuple):
    """The rays of one scanning sensor."""

    kind: int  # index of SCANNERS
    axes: tuple[Vector, ...]  # unit vectors, one for each range of a scan [body frame]
    beams: tuple[tuple[Vector, ...], ...]  # the rays about each axis, unit vectors [body frame]
    range_m: float  # [m]
    every: int  # period of the scans [ticks]
    half: float = 0.0  # half the angle of each beam [rad]; 0: a single ray
    grid: Grid | None = None  # layout of a laser's rays


def pattern_of(kind: ScannerKind, sensors: Sensors, tick_hz: float) -> Pattern:
    """Return the pattern of a scanning sensor."""
    scanner = sensors.scanner(kind)
    match scanner:
        case Laser():
            return _laser_pattern(scanner, tick_hz)
        case Sonar():
            return _sonar_pattern(scanner, tick_hz)
        case _:
            assert_never(scanner)


def _sonar_pattern(sonar: Sonar, tick_hz: float) -> Pattern:
    axes = _sonar_axes(sonar)
    half = 0.5 * radians(sonar.beam_deg)
    return Pattern(
        kind=SCANNERS.index("sonar"),
        axes=axes,
        beams=tuple(_beam(axis, half) for axis in axes),
        range_m=sonar.range_m,
        every=_every(sonar.rate_hz, tick_hz),
        half=half,
    )


def _laser_pattern(laser: Laser, tick_hz: float) -> Pattern:
    half, tilt = 0.5 * radians(laser.field_deg), radians(laser.elevation_deg)
    rays = tuple(
        (cos(up) * cos(azimuth), cos(up) * sin(azimuth), sin(up))
        for up in _spread(-tilt, tilt, laser.rings)
        for azimuth in _spread(-half, half, laser.rays)
    )
    return Pattern(
        kind=SCANNERS.index("laser"),
        axes=rays,
        beams=tuple((ray,) for ray in rays),
        range_m=laser.range_m,
        every=_every(laser.rate_hz, tick_hz),
        grid=Grid(rows=laser.rings, columns=laser.rays, tilt=tilt, half=half),
    )


def _nearest(angle: float, half: float, count: int) -> int | None:
    """Return which of ``count`` rays spread over +-half looks at an angle [rad]; None if none."""
    if count == 1:
        return 0 if abs(angle) <= SAME_RAY_RAD else None
    step = 2.0 * half / (count - 1)
    index = round((angle + half) / step)
    if not 0 <= index < count or abs(angle + half - index * step) > SAME_RAY_RAD:
        return None
    return index


def _every(rate_hz: float, tick_hz: float) -> int:
    return max(1, round(tick_hz / rate_hz))


def _spread(first: float, last: float, count: int) -> list[float]:
    if count == 1:
        return [0.5 * (first + last)]
    return [first + (last - first) * k / (count - 1) for k in range(count)]


def _sonar_axes(sonar: Sonar) -> tuple[Vector, ...]:
    ring = [(cos(a), sin(a), 0.0) for a in (2.0 * pi * k / sonar.ring for k in range(sonar.ring))]
    return (*ring, (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)) if sonar.up_down else tuple(ring)


def _beam(axis: Vector, half: float) -> tuple[Vector, ...]:
    """Return the axis, and two rings of rays about it within the half angle [rad]."""
    x, y, z = axis
    side = (-y, x, 0.0) if z == 0.0 else (1.0, 0.0, 0.0)
    over = (y * side[2] - z * side[1], z * side[0] - x * side[2], x * side[1] - y * side[0])
    rays = [axis]
    for angle in (0.5 * half, half):
        for k in range(IN_BEAM):
            turn = 2.0 * pi * k / IN_BEAM
            a, b, c = cos(angle), sin(angle) * cos(turn), sin(angle) * sin(turn)
            rays.append(
                (
                    a * x + b * side[0] + c * over[0],
                    a * y + b * side[1] + c * over[1],
                    a * z + b * side[2] + c * over[2],
                )
            )
    return tuple(rays)
