"""What agents told of their reasons, as rows of a tick."""

from math import atan2, degrees, hypot, nan, pi
from typing import NamedTuple

from agent.messages import Telemetry, Vector

MOVING_MPS = 0.02


class Told(NamedTuple):
    """What an agent last told of its reasons, as a row of a tick; see Telemetry and Tick."""

    target: Vector
    place: tuple[int, int]
    force: float
    turn_deg: float
    heard: tuple[int, ...]
    mission: int


UNTOLD = Told((nan, nan, nan), (-1, -1), nan, nan, (), 0)


def told_by(telemetry: Telemetry, heading: float) -> Told:
    """Return an agent's telemetry as its row; heading: what it observed as its own [rad]."""
    return Told(
        telemetry.target or UNTOLD.target,
        telemetry.place or UNTOLD.place,
        telemetry.force,
        _turn_deg(telemetry.wanted, heading),
        telemetry.heard,
        telemetry.mission,
    )


def _turn_deg(wanted: Vector, heading: float) -> float:
    """Return the wanted turn [deg] in (-180, 180]; NaN for a step too slow to have an azimuth."""
    if hypot(wanted[0], wanted[1]) <= MOVING_MPS:
        return float("nan")
    turn = atan2(wanted[1], wanted[0]) - heading
    return degrees(turn - 2.0 * pi * round(turn / (2.0 * pi)))
