"""Constellation-agents: guiding lines that bend round sensed surfaces (Algorithm 3, Fig. 7).

Eight lines open like a cone about the heading, from a common agent behind the vehicle. Each agent
of a line stands d_cs beyond the one before, in the direction of the last two as they are *bent*, so
that a bend carries all agents after it (lines 4-7, normalised). If the straight way from the
vehicle to an agent is blocked, the agent is drawn in to the free part of the way (lines 3 and 5,
along the unit vector). Blocked is everything within d_s of a sensed point.

As poles of (23) such agents ask for thousands of m/s (E19). Two bounded terms replace their
repulsion in Omega of (27): the sum of the displacements, which holds back and turns aside, and the
sum of the bent lines' directions, weighted by how far they are drawn in, which leads along the
surface.
"""

from collections.abc import Sequence
from math import cos, inf, pi, sin, sqrt
from typing import Final, Protocol, assert_never

from agent.config import AvoidanceKind
from agent.messages import ZERO, Vector
from agent.vectors import turned

LINES: Final = 8
AGENTS: Final = 4
BEHIND_M: Final = 0.3
FIRST_M, FIRST_RAD = 0.3, 69.0 * pi / 180.0
STEP_M: Final = 0.2
"""d_cs [m]."""
ROLL = 0.1 * pi / 180.0
"""Rolls all lines, which breaks the symmetry of an obstacle dead ahead [rad]."""
LEAST_M: Final = 0.1
"""An agent that is drawn in stays at least this far from the vehicle."""
REACH_M: Final = 0.9
"""Every agent stands within this distance of the vehicle."""
DISPLACEMENT_GAIN, TANGENT_GAIN, MAX_OMEGA_M = 0.15, 0.075, 2.0


def _default_lines() -> list[list[Vector]]:
    """Return the agents of each undisturbed line, relative to the vehicle [m; heading along x]."""
    ahead, aside = FIRST_M * cos(FIRST_RAD), FIRST_M * sin(FIRST_RAD)
    length = sqrt((ahead + BEHIND_M) ** 2 + aside**2)
    along, out = STEP_M * (ahead + BEHIND_M) / length, STEP_M * aside / length
    rolls = [2.0 * pi * k / LINES + ROLL for k in range(LINES)]
    return [
        [
            (
                ahead + k * along,
                (aside + k * out) * cos(roll),
                (aside + k * out) * sin(roll),
            )
            for k in range(AGENTS)
        ]
        for roll in rolls
    ]


DEFAULT_LINES = _default_lines()


class Avoidance(Protocol):
    """A term of Omega that leads round surfaces before the safety filter has to act."""

    def omega(self, yaw: float, points: Sequence[Vector]) -> Vector:
        """Return the term that sensed points add to Omega of (27) [m; world axes].

        yaw: heading [rad]; points: relative to the vehicle [m; world axes].
        """


class Constellation:
    """The constellation-agents of one vehicle; safety: d_s [m]."""

    def __init__(self, safety: float) -> None:
        self._safety = safety
        self._near = (REACH_M + safety) ** 2

    def omega(self, yaw: float, points: Sequence[Vector]) -> Vector:
        """Return the term of the lines [m; world axes]; see Avoidance."""
        near = [p for p in points if p[0] * p[0] + p[1] * p[1] + p[2] * p[2] < self._near]
        if not near:
            return ZERO
        common = turned([(-BEHIND_M, 0.0, 0.0)], yaw)[0]
        x = y = z = 0.0
        for line in DEFAULT_LINES:
            dx, dy, dz = self._line_term(turned(line, yaw), common, near)
            x, y, z = x + dx, y + dy, z + dz
        length = sqrt(x * x + y * y + z * z)
        scale = min(1.0, MAX_OMEGA_M / max(length, 1e-9))
        return (-scale * x, -scale * y, -scale * z)

    def bent_lines(self, yaw: float, points: Sequence[Vector]) -> list[list[Vector]]:
        """Return the agents of each line, from the common one on, as sensed points bend them.

        yaw: heading [rad]; points and lines: relative to the vehicle [m; world axes].
        """
        common = turned([(-BEHIND_M, 0.0, 0.0)], yaw)[0]
        near = list(points)
        return [
            [common, *[here for _, here in self._bent(turned(line, yaw), common, near)]]
            for line in DEFAULT_LINES
        ]

    def _line_term(self, default: list[Vector], common: Vector, points: list[Vector]) -> Vector:
        """Return the term of one line [m; world axes].

        default: its undisturbed agents; common: the common agent; both and the points relative to
        the vehicle [m; world axes].
        """
        last, drawn_in = common, 1.0
        x = y = z = 0.0
        for a, (f, here) in enumerate(self._bent(default, common, points)):
            u, v, w = default[a]
            drawn_in = min(drawn_in, f)
            x += DISPLACEMENT_GAIN * (here[0] - u)
            y += DISPLACEMENT_GAIN * (here[1] - v)
            z += DISPLACEMENT_GAIN * (here[2] - w)
            share = 1.0 - f if f < 1.0 else 0.5 * (1.0 - drawn_in)
            if a > 0 and share > 0.0:
                dx, dy, dz = here[0] - last[0], here[1] - last[1], here[2] - last[2]
                weight = TANGENT_GAIN * share / max(sqrt(dx * dx + dy * dy + dz * dz), 1e-9)
                x, y, z = x + weight * dx, y + weight * dy, z + weight * dz
            last = here
        return (x, y, z)

    def _bent(
        self, default: list[Vector], common: Vector, points: list[Vector]
    ) -> list[tuple[float, Vector]]:
        """Return each agent of a line: the free share of the way to it, and where it stands."""
        before, last = common, common
        bent = []
        for a in range(len(default)):
            ahead = default[0] if a == 0 else _beyond(before, last)
            f = self._free_share(ahead, points)
            here = ahead if f == 1.0 else (f * ahead[0], f * ahead[1], f * ahead[2])
            bent.append((f, here))
            before, last = last, here
        return bent

    def _free_share(self, ahead: Vector, points: list[Vector]) -> float:
        """Return the free share of the way from the vehicle to an agent: 1 if all of it is free.

        The way is free where it is farther than d_s from every sensed point.
        """
        far = sqrt(ahead[0] * ahead[0] + ahead[1] * ahead[1] + ahead[2] * ahead[2])
        free, safe = inf, self._safety * self._safety
        for x, y, z in points:
            along = (x * ahead[0] + y * ahead[1] + z * ahead[2]) / far
            half = safe - (x * x + y * y + z * z - along * along)
            if along > 0.0 and half > 0.0:
                free = min(free, along - sqrt(half))
        return 1.0 if free >= far else max(LEAST_M, free) / far


def _beyond(before: Vector, last: Vector) -> Vector:
    """Return the point d_cs beyond the last one, away from the one before it."""
    x, y, z = last[0] - before[0], last[1] - before[1], last[2] - before[2]
    scale = STEP_M / max(sqrt(x * x + y * y + z * z), 1e-9)
    return (last[0] + scale * x, last[1] + scale * y, last[2] + scale * z)


class Repulsion:
    """Direct repulsion from each point, to compare the lines with; safety: d_s [m]."""

    def __init__(self, safety: float) -> None:
        self._safety = safety

    def omega(self, yaw: float, points: Sequence[Vector]) -> Vector:
        """Return the term of the repulsion [m; world axes]; see Avoidance."""
        x = y = z = 0.0
        for p in points:
            r = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
            s = max(r - self._safety, 0.05)
            if s < 1.0 and r > 0.0:
                w = min(2.0, 0.05 * (1.0 / s - 1.0) / s) / r
                x, y, z = x + w * p[0], y + w * p[1], z + w * p[2]
        return (x, y, z)


def avoidance_of(kind: AvoidanceKind, safety: float) -> Avoidance | None:
    """Return the avoidance of a kind; None for "none". safety: d_s [m]."""
    match kind:
        case "constellation":
            return Constellation(safety)
        case "direct":
            return Repulsion(safety)
        case "none":
            return None
        case _:
            assert_never(kind)
