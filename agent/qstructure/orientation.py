"""Orientation along a queue: O_j of Definition 4, angles as functions of the arc length."""

from math import radians
from typing import Annotated, NamedTuple

import msgspec
from msgspec import Meta

from agent.qstructure.expression import MAX_EXPRESSION_LENGTH, Expression, ExpressionError

Text = Annotated[str, Meta(min_length=1, max_length=MAX_EXPRESSION_LENGTH)]
Angle = Annotated[float, Meta(ge=-1e4, le=1e4)] | Text
MAX_TILT_DEG = 90.0
ANGLES = ("yaw_deg", "pitch_deg", "roll_deg")


class OrientationSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Angles [deg]: numbers, or expressions in d, the arc length from the first vertex [m].

    An angle that is left out is free. Yaw is counted in the target's frame.
    """

    yaw_deg: Angle | None = None
    pitch_deg: Angle | None = None
    roll_deg: Angle | None = None


class Attitude(NamedTuple):
    """The attitude at a slot; an angle that is None is free."""

    yaw: float | None = None  # [rad; target's frame]
    pitch: float | None = None  # [rad]
    roll: float | None = None  # [rad]


FREE = Attitude()


class OrientationError(ValueError):
    """An angle that cannot be computed; ``key`` is its key."""

    def __init__(self, key: str, detail: str) -> None:
        super().__init__(detail)
        self.key = key


class Orientation:
    """Angles along a queue. Raises OrientationError for an invalid expression."""

    def __init__(self, spec: OrientationSpec) -> None:
        self._angles: list[Expression | None] = []
        for key in ANGLES:
            given = getattr(spec, key)
            try:
                self._angles.append(None if given is None else Expression(str(given), "d"))
            except ExpressionError as error:
                raise OrientationError(key, str(error)) from error

    def at(self, d: float) -> Attitude:
        """Return the attitude at arc length d [m], or raise OrientationError."""
        angles: list[float | None] = []
        for key, angle in zip(ANGLES, self._angles, strict=True):
            try:
                degrees = None if angle is None else angle(d)
            except ExpressionError as error:
                raise OrientationError(key, str(error)) from error
            if degrees is not None and key != "yaw_deg" and abs(degrees) > MAX_TILT_DEG:
                detail = f"{degrees:g} at d = {d:g}; at most {MAX_TILT_DEG:g}"
                raise OrientationError(key, detail)
            angles.append(None if degrees is None else radians(degrees))
        return Attitude(*angles)
