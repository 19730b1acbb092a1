"""Where the share of passes falls to one half as a number grows: a logistic curve, fitted.

Pure. The share of passes at x is 1 / (1 + exp(-s (x - m))); m is the break. The interval of m
holds what the likelihood ratio does not rule out at 95 %. Where flights say nothing about a curve,
the reason is told instead.
"""

from collections.abc import Callable, Sequence
from math import inf
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

CHI_SQUARE = 3.841459
"""The 95 % quantile of the chi-square distribution with one degree of freedom."""
STEPS = 60
BISECTIONS = 50
Floats = NDArray[np.float64]
Kind = Literal["break", "separated", "all pass", "all fail", "no trend", "outside", "too few"]


class Point(NamedTuple):
    """The flights at one value of the number."""

    x: float
    passed: int
    flown: int


class Break(NamedTuple):
    """Where a team breaks, or why this cannot be said.

    kind: "break": at ``at``, within ``low`` to ``high`` (infinite where no tested value bounds
    it), with ``slope`` of the log odds; "separated": every flight up to one value passes and every
    one beyond fails, or the other way round: between ``low`` and ``high``; "all pass" and "all
    fail"; "no trend": the curve is no better than a constant share; "outside": the curve reaches
    one half outside the tested values; "too few": fewer than two values were flown. falls: whether
    the share of passes falls as the number grows; None where it does neither.
    """

    kind: Kind
    at: float | None = None
    low: float | None = None
    high: float | None = None
    slope: float | None = None
    falls: bool | None = None


def break_of(points: Sequence[Point]) -> Break:
    """Return where the share of passes crosses one half."""
    flown = sorted(point for point in points if point.flown)
    if len(flown) < 2:
        return Break("too few")
    plain = _without_fit(flown)
    if plain is not None:
        return plain
    data = _Data(flown)
    constant, slope = data.fitted()
    best = data.likelihood(constant + slope * data.x)
    if 2.0 * (best - data.constant_likelihood()) < CHI_SQUARE or slope == 0.0:
        return Break("no trend")
    middle = -constant / slope
    at = data.unscaled(middle)
    if not flown[0].x <= at <= flown[-1].x:
        return Break("outside", at, slope=slope / data.scale, falls=slope < 0.0)

    def allowed(candidate: float) -> bool:
        return 2.0 * (best - data.profile(candidate)) <= CHI_SQUARE

    low, high = (_bound(allowed, middle, float(end)) for end in (data.x[0], data.x[-1]))
    bounds = data.unscaled(low), data.unscaled(high)
    return Break("break", at, *bounds, slope / data.scale, falls=slope < 0.0)


def curve(at: float, slope: float, x: Floats) -> Floats:
    """Return the fitted share of passes at some values (R,)."""
    shares: Floats = 1.0 / (1.0 + np.exp(-np.clip(slope * (x - at), -500.0, 500.0)))
    return shares


def _without_fit(points: list[Point]) -> Break | None:
    """Return what flights show that no curve fits; None: there is something to fit."""
    shares = [point.passed / point.flown for point in points]
    if all(share == 1.0 for share in shares):
        return Break("all pass")
    if all(share == 0.0 for share in shares):
        return Break("all fail")
    for before in range(1, len(points)):
        lower, upper = set(shares[:before]), set(shares[before:])
        if (lower, upper) in (({1.0}, {0.0}), ({0.0}, {1.0})):
            low, high = points[before - 1].x, points[before].x
            return Break("separated", low=low, high=high, falls=lower == {1.0})
    return None


class _Data:
    """Flights with the number scaled to mean 0 and deviation 1, so that Newton's steps behave."""

    def __init__(self, points: list[Point]) -> None:
        x = np.array([point.x for point in points])
        self._centre, self.scale = float(x.mean()), float(x.std())
        self.x: Floats = (x - self._centre) / self.scale
        self._passed = np.array([float(point.passed) for point in points])
        self._count = np.array([float(point.flown) for point in points])

    def unscaled(self, x: float) -> float:
        return self._centre + self.scale * x

    def likelihood(self, odds: Floats) -> float:
        """Return the log likelihood for some log odds (R,)."""
        return float(np.sum(self._passed * odds - self._count * np.logaddexp(0.0, odds)))

    def constant_likelihood(self) -> float:
        share = float(self._passed.sum() / self._count.sum())
        return self.likelihood(np.full_like(self.x, np.log(share / (1.0 - share))))

    def fitted(self) -> tuple[float, float]:
        """Return the constant and the slope of the most likely curve, by Newton's method."""
        found = self._newton(np.stack([np.ones_like(self.x), self.x], axis=1))
        return float(found[0]), float(found[1])

    def profile(self, middle: float) -> float:
        """Return the greatest log likelihood of a curve that crosses one half at ``middle``."""
        shifted = (self.x - middle)[:, None]
        return self.likelihood(shifted[:, 0] * self._newton(shifted)[0])

    def _newton(self, design: Floats) -> Floats:
        """Return the most likely coefficients; a step that makes it worse is halved."""
        found = np.zeros(design.shape[1])
        now = self.likelihood(design @ found)
        for _ in range(STEPS):
            share = 1.0 / (1.0 + np.exp(-np.clip(design @ found, -500.0, 500.0)))
            weight = self._count * share * (1.0 - share)
            gradient = design.T @ (self._passed - self._count * share)
            curvature = (design * weight[:, None]).T @ design + 1e-12 * np.eye(len(found))
            step = np.linalg.solve(curvature, gradient)
            while (then := self.likelihood(design @ (found + step))) < now - 1e-12:
                step = step / 2.0
            found = found + step
            if then - now < 1e-12:
                break
            now = then
        return found


def _bound(allowed: Callable[[float], bool], middle: float, end: float) -> float:
    """Return how far from ``middle`` towards an end values are allowed; infinite: up to the end."""
    if allowed(end):
        return inf if end > middle else -inf
    inside, outside = middle, end
    for _ in range(BISECTIONS):
        half = (inside + outside) / 2.0
        inside, outside = (half, outside) if allowed(half) else (inside, half)
    return inside
