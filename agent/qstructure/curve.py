"""Curves by arc length: slots stand by metres along a curve, whatever its parameter.

The curve is measured once, in pieces of at most a centimetre, as far as it is asked for. A table
then gives the parameter of an arc length. The step is halved where the curve is fast or bends, so a
jump shows as a step that no halving makes short.
"""

from bisect import bisect_right
from collections.abc import Callable
from math import dist, inf

from agent.messages import Vector

PIECE_M = 0.01
"""Longest piece of the table."""
BEND_M = 1e-5
"""Most by which a piece with its middle point is longer than its chord."""
LEAST_STEP = 1e-10
GREATEST_STEP = 0.5
"""Bounds of a piece's step in the curve's own parameter."""
STANDSTILL_STEPS = 2000
STANDSTILL_M = 1e-6
SAMPLES = 1000
JUMP_M = 0.02


class CurveError(ValueError):
    """A curve that cannot be measured: it jumps, stands still, or ends too soon."""


class ArcLengthCurve:
    """A curve by arc length, measured from parameter 0 on.

    at: the curve by its own parameter [m]; ends: its last parameter.
    """

    def __init__(self, at: Callable[[float], Vector], ends: float = inf) -> None:
        self._at = at
        self._ends = ends
        self._parameters = [0.0]
        self._lengths = [0.0]
        self._here = at(0.0)
        self._step = 1e-3

    def reaches(self, s: float) -> bool:
        """Measure on as needed; return whether the curve is at least ``s`` long [m]."""
        while self._lengths[-1] < s:
            if self._parameters[-1] >= self._ends:
                return False
            self._measure_piece()
        return True

    def length(self) -> float:
        """Return the length of a curve that ends [m]."""
        self.reaches(inf)
        return self._lengths[-1]

    def parameter(self, s: float) -> float:
        """Return the parameter at arc length s [m], or raise CurveError past the curve's end."""
        if not self.reaches(s):
            raise CurveError(f"it is only {self._lengths[-1]:.3f} m long")
        upper = min(max(bisect_right(self._lengths, s), 1), len(self._lengths) - 1)
        if upper == 0:
            return 0.0
        low, high = self._lengths[upper - 1], self._lengths[upper]
        share = (s - low) / (high - low) if high > low else 0.0
        before, after = self._parameters[upper - 1], self._parameters[upper]
        return before + share * (after - before)

    def check(self, s: float) -> None:
        """Raise CurveError if the curve jumps somewhere on the way to arc length s [m].

        Measuring never gets past a pole, since the way there has no end. So the parameters up to s
        are checked too, for the author of a curve in metres expects it to reach that far.
        """
        last = min(max(self.parameter(s), s), self._ends)
        here = self._at(0.0)
        for k in range(SAMPLES):
            start, end = last * k / SAMPLES, last * (k + 1) / SAMPLES
            there = self._at(end)
            if dist(here, there) > JUMP_M:
                self._check_jump(start, end)
            here = there

    def _check_jump(self, start: float, end: float) -> None:
        """Halve an interval towards its longer half: it shrinks unless there is a jump."""
        for _ in range(50):
            middle = 0.5 * (start + end)
            first = dist(self._at(start), self._at(middle))
            if first >= dist(self._at(middle), self._at(end)):
                end = middle
            else:
                start = middle
        if dist(self._at(start), self._at(end)) > JUMP_M:
            raise CurveError(f"it jumps near {start:.6g}: a pole?")

    def point(self, s: float) -> Vector:
        """Return the point at arc length s [m]."""
        return self._at(self.parameter(s))

    def _measure_piece(self) -> None:
        """Add one piece, so short that the table may interpolate linearly within it."""
        start = self._parameters[-1]
        while True:
            step = min(self._step, self._ends - start)
            middle, end = self._at(start + 0.5 * step), self._at(start + step)
            piece = dist(self._here, middle) + dist(middle, end)
            if piece <= PIECE_M and piece - dist(self._here, end) <= BEND_M:
                break
            self._step = 0.5 * step
            if self._step < LEAST_STEP:
                raise CurveError(f"it jumps near {start:.6g}: a pole?")
        self._parameters.append(start + step)
        self._lengths.append(self._lengths[-1] + piece)
        self._here = end
        if piece < 0.4 * PIECE_M:
            self._step = min(2.0 * step, GREATEST_STEP) if step == self._step else self._step
        self._check_progress()

    def _check_progress(self) -> None:
        if len(self._lengths) <= STANDSTILL_STEPS:
            return
        if self._lengths[-1] - self._lengths[-STANDSTILL_STEPS] < STANDSTILL_M:
            raise CurveError(
                f"it stands still from {self._parameters[-STANDSTILL_STEPS]:.6g} on, "
                f"{self._lengths[-1]:.3f} m from its start"
            )
