"""Curves by arc length: slots stand by metres along a curve, whatever its parameter.

A curve is measured lazily, piece by piece, as far as it is asked for. A table then gives the
parameter of an arc length, exact to a millimetre. The step is halved where the curve is fast, bends
or changes its speed, so a jump shows as a step that no halving makes short. The first metres are
measured in pieces of a centimetre; farther on, pieces are as long as the curve allows. The number
of pieces is limited: a curve that needs more of them is refused, so measuring always comes to an
end.
"""

from bisect import bisect_right
from collections.abc import Callable
from math import dist, inf
from typing import NamedTuple

from agent.messages import Vector

PIECE_M = 0.01
"""Longest piece of the first metres."""
BEND_M = 1e-5
"""Most by which such a piece with its middle point is longer than its chord."""
TIGHT_M = 3e-7
"""A piece that bends by more is counted longer than its chords, as an arc through them is."""
LONG_PIECE_M = 0.25
"""Longest piece after the first metres."""
LONG_BEND_M = 5e-5
"""Most by which such a piece with its middle point is longer than its chord."""
UNEVEN_M = 3e-4
"""Most by which the halves of such a piece differ."""
LEAST_STEP = 1e-10
GREATEST_STEP = 0.5
"""Bounds of a piece's step in the curve's own parameter."""
GREATEST_SHARE = 0.01
"""After the first metres, a step may also be so large a share of the parameter."""
STANDSTILL_STEPS = 2000
STANDSTILL_M = 1e-6
JUMP_M = 0.02
HALVINGS = 50


class CurveError(ValueError):
    """A curve that cannot be measured: it jumps, stands still, winds too much or ends too soon."""


class Effort(NamedTuple):
    """How finely a curve is measured and how much work that may be."""

    fine_m: float  # length of the part that is measured in short pieces [m]
    pieces: int  # most pieces
    samples: int  # points at which the way to a slot is searched for jumps


FULL_EFFORT = Effort(fine_m=20.0, pieces=20_000, samples=1000)
"""Of a curve that is alone in its formation."""


class _Piece(NamedTuple):
    """A piece of a curve, measured by two chords."""

    step: float  # in the curve's own parameter
    end: Vector  # [m]
    first_m: float
    second_m: float
    bend_m: float  # by which the two chords are longer than one


class ArcLengthCurve:
    """A curve by arc length, measured from parameter 0 on.

    at: the curve by its own parameter [m]; ends: its last parameter.
    """

    def __init__(
        self, at: Callable[[float], Vector], ends: float = inf, effort: Effort = FULL_EFFORT
    ) -> None:
        self._at = at
        self._ends = ends
        self._effort = effort
        self._parameters = [0.0]
        self._lengths = [0.0]
        self._pieces = 0
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

        Measuring finds the jumps up to there, but it never gets past a pole, since the way there
        has no end. So the parameters up to s are searched too, for the author of a curve in metres
        expects it to reach that far.
        """
        first, last = self.parameter(s), min(s, self._ends)
        samples = self._effort.samples
        here = self._at(first)
        for k in range(samples if first < last else 0):
            start = first + (last - first) * k / samples
            end = first + (last - first) * (k + 1) / samples
            there = self._at(end)
            if dist(here, there) > JUMP_M:
                self._check_jump(start, end)
            here = there

    def _check_jump(self, start: float, end: float) -> None:
        """Halve an interval towards its longer half: it shrinks unless there is a jump."""
        here, there = self._at(start), self._at(end)
        for _ in range(HALVINGS):
            if dist(here, there) <= JUMP_M:
                return
            middle = 0.5 * (start + end)
            between = self._at(middle)
            if dist(here, between) >= dist(between, there):
                end, there = middle, between
            else:
                start, here = middle, between
        raise CurveError(f"it jumps near {start:.6g}: a pole?")

    def point(self, s: float) -> Vector:
        """Return the point at arc length s [m]."""
        return self._at(self.parameter(s))

    def _measure_piece(self) -> None:
        """Add one piece, so short that the table may interpolate linearly within its halves."""
        if self._pieces >= self._effort.pieces:
            raise CurveError(
                f"after {self._pieces} steps only {self._lengths[-1]:.3f} m of it are measured;"
                " it is too long, too slow or too tightly wound"
            )
        start, fine = self._parameters[-1], self._lengths[-1] < self._effort.fine_m
        piece = self._next_piece(start, fine)
        length_m = piece.first_m + piece.second_m
        share = piece.first_m / length_m if length_m > 0.0 else 1.0
        if piece.bend_m > TIGHT_M:
            length_m += piece.bend_m / 3.0
        if not fine and share < 1.0:
            self._append(start + 0.5 * piece.step, share * length_m)
            self._append(start + piece.step, (1.0 - share) * length_m)
        else:
            self._append(start + piece.step, length_m)
        self._pieces += 1
        self._here = piece.end
        if length_m < 0.4 * (PIECE_M if fine else LONG_PIECE_M) and piece.step == self._step:
            greatest = GREATEST_STEP if fine else max(GREATEST_STEP, GREATEST_SHARE * start)
            self._step = min(2.0 * piece.step, greatest)
        self._check_progress()

    def _next_piece(self, start: float, fine: bool) -> _Piece:
        """Return the next piece, from a parameter on; halve the step until it is short enough."""
        longest = PIECE_M if fine else LONG_PIECE_M
        while True:
            step = min(self._step, self._ends - start)
            middle, end = self._at(start + 0.5 * step), self._at(start + step)
            first, second = dist(self._here, middle), dist(middle, end)
            bend = first + second - dist(self._here, end)
            if first + second <= longest and _is_regular(bend, first - second, fine):
                return _Piece(step, end, first, second, bend)
            self._step = 0.5 * step
            if self._step < LEAST_STEP:
                raise CurveError(f"it jumps near {start:.6g}: a pole?")

    def _append(self, parameter: float, length_m: float) -> None:
        self._parameters.append(parameter)
        self._lengths.append(self._lengths[-1] + length_m)

    def _check_progress(self) -> None:
        if len(self._lengths) <= STANDSTILL_STEPS:
            return
        if self._lengths[-1] - self._lengths[-STANDSTILL_STEPS] < STANDSTILL_M:
            raise CurveError(
                f"it stands still from {self._parameters[-STANDSTILL_STEPS]:.6g} on, "
                f"{self._lengths[-1]:.3f} m from its start"
            )


def _is_regular(bend_m: float, uneven_m: float, fine: bool) -> bool:
    """Whether a piece is straight enough, and even enough, for linear interpolation."""
    if fine:
        return bend_m <= BEND_M
    return bend_m <= LONG_BEND_M and abs(uneven_m) <= UNEVEN_M
