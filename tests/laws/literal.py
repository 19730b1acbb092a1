"""The paper's equations as they are printed, to be put in the place of the forms that fly.

Each is what a reader would write from the page; the law named beside it in
test_literal_forms.py says what then breaks.
"""

from math import acos, atan2, cos, dist, exp, hypot, pi, sin, sqrt

from agent.messages import Place

STEP_M = 1e-3


def gap_at_targets(self, between_targets_m):
    """(22): U_tg,ij = |q_tg,i - q_tg,j|^2 / 2, so the gap is the whole distance."""
    return between_targets_m


def gap_at_targets_without_floor(self, between_targets_m):
    """(22) with (21)'s offset but no floor."""
    return max(between_targets_m - self.d_ob, 1e-4)


def omega(self, q, q_tg, others):
    """(27): Omega_i = (q_i - q_tg,i) + sum U'_ob,ij q_ij."""
    total = [a - b for a, b in zip(q, q_tg, strict=True)]
    for other in others:
        gap = dist(q, other.position) - self.d_ob
        u_tg = self.at_targets(dist(q_tg, other.target))
        slope = self.k_ob * self.slope(0.5 * gap * gap, u_tg)
        for axis in range(3):
            total[axis] += slope * (q[axis] - other.position[axis])
    return tuple(total)


def unit_weight(self, d_ob, a_t=1.0, k_ob=1.0, cap=1e9):
    """(20), (28): repulsion at unit weight, and no limit to it."""
    self.d_ob, self.a_t, self.k_ob, self.cap = d_ob, a_t, k_ob, cap
    self._floor = d_ob + 0.25


def value_two_sided(self, u, u_tg):
    """(23), on both sides of U_tg."""
    sigma = 1.0 / (1.0 + exp(min(self.a_t * (u - u_tg) ** 3, 700.0)))
    return sigma * (u / u_tg**2 + 1.0 / u)


def slope_two_sided(self, u, u_tg):
    """The derivative of (23), on both sides of U_tg."""
    d = u - u_tg
    sigma = 1.0 / (1.0 + exp(min(self.a_t * d**3, 700.0)))
    h, h_slope = u / u_tg**2 + 1.0 / u, 1.0 / u_tg**2 - 1.0 / u**2
    return sigma * h_slope - 3.0 * self.a_t * d * d * sigma * (1.0 - sigma) * h


def push_two_sided(self, r, between_targets):
    """The factor of q_ij for (23) on both sides."""
    gap = max(r - self.d_ob, 1e-3)
    slope = slope_two_sided(self, 0.5 * gap * gap, self.at_targets(between_targets))
    return self.k_ob * slope * gap / r


def pushes_far_away(self, r, between_targets):
    """(23) on both sides also acts on agents that are farther apart than their targets."""
    return False


def bobber(q, yaw, q_toq, zone):
    """(1)-(3), (10) at unit weight: the least U_tcast + U_obcast in the cast-zone, on a grid."""
    near, far, theta = 0.05, zone.reach, zone.cone.left
    best, least = q, float("inf")
    for ring in range(1, 40):
        r = near + (far - near) * ring / 40
        for ray in range(1, 60):
            side = -theta + 2.0 * theta * ray / 60
            at = (q[0] + r * cos(yaw + side), q[1] + r * sin(yaw + side), q[2])
            onward = [t - a for t, a in zip(q_toq, at, strict=True)]
            out = [a - b for a, b in zip(at, q, strict=True)]
            cosine = sum(a * b for a, b in zip(out, onward, strict=True)) / (
                r * sqrt(sum(b * b for b in onward))
            )
            walls = 0.5 / (r - near) ** 2 + 0.5 / (r - far) ** 2
            walls += 1.0 / (r * sin(theta - side)) + 1.0 / (r * sin(theta + side))
            potential = acos(max(-1.0, min(1.0, cosine))) + walls
            if potential < least:
                best, least = at, potential
    return best


def bobber_of_angle_alone(q, yaw, q_toq, zone):
    """(10) without the walls of (3): the least angle at the bobber, which lies nearest to d_c1."""
    near, theta = 0.05, zone.cone.left
    choices = []
    for ring in range(20):
        for ray in range(41):
            r, side = near + (zone.reach - near) * ring / 19, theta * (ray / 20.0 - 1.0)
            at = (q[0] + r * cos(yaw + side), q[1] + r * sin(yaw + side), q[2])
            onward = [t - a for t, a in zip(q_toq, at, strict=True)]
            out = [a - b for a, b in zip(at, q, strict=True)]
            cosine = sum(a * b for a, b in zip(out, onward, strict=True)) / (r * hypot(*onward))
            choices.append((acos(max(-1.0, min(1.0, cosine))), at))
    return min(choices)[1]


def bobber_from_d_c1_on(q, yaw, q_toq, zone):
    """Algorithm 2, lines 1, 3: a cast-zone from d_c1 = 0.05 m on; what is nearer lies outside."""
    v = [t - a for t, a in zip(q_toq, q, strict=True)]
    scale = min(max(1.0, 0.05 / max(hypot(*v), 1e-12)), zone.reach / max(hypot(*v), 1e-12))
    return tuple(a + scale * x for a, x in zip(q, v, strict=True))


def bobber_never_head_on(q, yaw, q_toq, zone):
    """Algorithm 2, lines 7-10, and the proof of Lemma 9: always onwards, on the cone's edge."""
    x, y, z = (t - a for t, a in zip(q_toq, q, strict=True))
    error = atan2(y, x) - yaw
    error -= 2.0 * pi * round(error / (2.0 * pi))
    if zone.cone.holds(error):
        scale = min(1.0, zone.reach / max(hypot(x, y, z), 1e-12))
        return (q[0] + scale * x, q[1] + scale * y, q[2] + scale * z)
    heading = yaw + (zone.cone.left if error > 0.0 else -zone.cone.right)
    step = 0.5 * zone.reach
    climb = min(max(z, -step), step)
    return (q[0] + step * cos(heading), q[1] + step * sin(heading), q[2] + climb)


def cast_reach_given(control, range_m):
    """Algorithm 2, line 1: d_c2 is given, whatever the range; here 2 m."""
    return 2.0


def steer_in_a_pyramid(wanted, yaw, cone):
    """(4), (5): the cone in azimuth and, theta_3,4 = 45 degrees, in elevation."""
    heading = atan2(wanted[1], wanted[0])
    error = heading - yaw
    error -= 2.0 * pi * round(error / (2.0 * pi))
    if cone.holds(error) and abs(wanted[2]) <= hypot(wanted[0], wanted[1]):
        return wanted, heading
    return (0.0, 0.0, 0.0), heading


def adopt_nothing(self, gossip, now_s, slack_s):
    """Algorithm 1, lines 12-15: the own list holds those within communication range, no more."""


def members_by_chord(self, count):
    """Algorithm 1, line 18: the next point of the queue at the straight distance d_ir."""
    s, placed = 0.0, []
    for _ in range(count):
        before = self.point(s)
        s += STEP_M
        while dist(self.point(s), before) < self._spacing:
            s += STEP_M
        placed.append(s)
    return placed


def holders_queue_by_queue(self):
    """Algorithm 1, line 15 in each queue by itself: its first agent takes the vertex."""
    return {
        f"{name} of {j}": [Place(j, rank)]
        for j, names in enumerate(self._vertices_of)
        for rank, name in enumerate(names)
    }


def allot_by_distance(team, places, slots):
    """Algorithm 1, lines 12-18: ordered by distance from the vertex, each time anew."""
    ordered = sorted(team, key=lambda peer: dist(peer.position, slots[0]))
    return {peer.id: place for peer, place in zip(ordered, places, strict=True)}
