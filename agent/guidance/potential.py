"""Potentials: attraction to the target and repulsion between agents, (18)-(28), so as to converge.

For each pair, with r = |q_i - q_j| and g = max(r - d_ob, 1 mm):

    U    = g^2 / 2                                                     (21), E2
    U_tg = (max(|q_tg,i - q_tg,j|, d_ob + 0.25 m) - d_ob)^2 / 2        (22), E1
    U_ob = sigma(U) (h(U) - h(U_tg)) for U < U_tg, else 0              (23), E3

with h(U) = U / U_tg^2 + 1 / U and sigma(U) = 1 / (1 + exp(a_t (U - U_tg)^3)). The one-sided form
keeps the pole at U = 0 and the zero slope at U_tg, and has no second equilibrium beyond U_tg. Below
U_tg the exponent is never positive, so nothing overflows (E5).
"""

from collections.abc import Sequence
from math import dist, exp
from typing import Final

from agent.controller import Heard
from agent.messages import Vector
from agent.vectors import apart

LEAST_GAP_M: Final = 1e-3
"""E2: g is at least this, also inside d_ob."""
TARGET_FLOOR_M: Final = 0.25
"""E1: targets nearer than d_ob plus this are no equilibrium of the potential."""
ROUNDED_UP: Final = 1.0 + 1e-9
"""By this factor a distance exceeds any rounding of it."""


class Potential:
    """The potential of one agent among others.

    d_ob: least acceptable distance [m]; a_t: sharpness of (23); k_ob: weight of repulsion; cap:
    limit of each pair's term in Omega [m] (E4). The weight is the result of a trial with 40 seeds
    of the wedge: from 0.02 to 0.005, convergence and separation stay, and turns over 45 degrees
    halve.
    """

    __slots__ = ("_floor", "a_t", "cap", "d_ob", "k_ob")

    def __init__(
        self, d_ob: float, a_t: float = 1.0, k_ob: float = 0.005, cap: float = 2.0
    ) -> None:
        self.d_ob = d_ob
        self.a_t = a_t
        self.k_ob = k_ob
        self.cap = cap
        self._floor = d_ob + TARGET_FLOOR_M

    def gap_at_targets(self, between_targets_m: float) -> float:
        """Return the gap g of two immediate targets at this distance from each other [m]: E1."""
        floor = self._floor
        return (between_targets_m if between_targets_m > floor else floor) - self.d_ob

    def at_targets(self, between_targets_m: float) -> float:
        """Return U_tg of two immediate targets at this distance from each other [m]: (22), E1."""
        gap = self.gap_at_targets(between_targets_m)
        return 0.5 * gap * gap

    def value(self, u: float, u_tg: float) -> float:
        """Return U_ob: (23) in the one-sided form (E3)."""
        if u >= u_tg:
            return 0.0
        return self._sigma(u - u_tg) * (u / (u_tg * u_tg) + 1.0 / u - 2.0 / u_tg)

    def slope(self, u: float, u_tg: float) -> float:
        """Return dU_ob/dU: never positive, 0 from U_tg on, with a pole at 0 (E3)."""
        if u >= u_tg:
            return 0.0
        d = u - u_tg
        sigma = self._sigma(d)
        excess = u / (u_tg * u_tg) + 1.0 / u - 2.0 / u_tg
        steepness = 1.0 / (u_tg * u_tg) - 1.0 / (u * u)
        return sigma * steepness - 3.0 * self.a_t * d * d * sigma * (1.0 - sigma) * excess

    def omega(self, q: Vector, q_tg: Vector, others: Sequence[Heard]) -> Vector:
        """Return Omega_i of (27) with the chain rule corrected (E2) [m; world frame].

        q, q_tg: own position and immediate target [m; world frame]; others: the neighbours.
        """
        x, y, z = q[0] - q_tg[0], q[1] - q_tg[1], q[2] - q_tg[2]
        here: Sequence[float] = q
        target: Sequence[float] = q_tg
        for other in others:
            there = other.position
            if self._is_surely_apart(apart(q, there), apart(q_tg, other.target)):
                continue
            push = self._push(dist(here, there), dist(target, other.target))
            if push != 0.0:
                x += push * (q[0] - there[0])
                y += push * (q[1] - there[1])
                z += push * (q[2] - there[2])
        return (x, y, z)

    def _is_surely_apart(self, r: float, between_targets: float) -> bool:
        """Whether two agents do not push each other, whatever the rounding; as ``_push``."""
        return r > ROUNDED_UP * between_targets and r > ROUNDED_UP * self._floor

    def _push(self, r: float, between_targets: float) -> float:
        """Return the factor of q_ij in Omega_i: k_ob U'_ob g / r, with a capped pair term."""
        g, gap = r - self.d_ob, self.gap_at_targets(between_targets)
        if g >= gap or r == 0.0:
            return 0.0
        g = max(g, LEAST_GAP_M)
        slope = self.slope(0.5 * g * g, 0.5 * gap * gap)
        return max(self.k_ob * slope * g, -self.cap) / r

    def _sigma(self, d: float) -> float:
        return 1.0 / (1.0 + exp(self.a_t * d * d * d))
