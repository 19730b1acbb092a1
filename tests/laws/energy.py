"""Laws of the potential field: (a)-(e) of (23), the closed loop (29), Lemma 6, and E4.

The closed loop is the one that flies: the controller's weights and gain, and the default d_ob,
speed and tick.
"""

from dataclasses import dataclass
from itertools import combinations, pairwise
from math import dist
from random import Random

from agent.config import Control, Vehicle
from agent.guidance import potential as potential_room
from agent.guidance import q_structure
from agent.guidance.movement import saturated
from agent.messages import Vector
from worldsim.scenario.tables import Fleet

D_OB = Control().separation_m
TICK_S = 1.0 / Fleet(agents=1).tick_hz
SPEED_MPS = Vehicle().max_speed_mps
U_TARGETS = (0.032, 0.1, 0.28, 1.0, 4.0, 30.0)
"""U_tg from the floor's on [m^2]: targets 0.5 to 8 m apart."""


@dataclass(frozen=True)
class Other:
    """A neighbour as the potential sees it."""

    position: Vector
    target: Vector


def random_point(random: Random, size: float) -> Vector:
    """Return a point in a cube [m]."""
    return (
        random.uniform(-size, size),
        random.uniform(-size, size),
        random.uniform(-size, size),
    )


def scattered(random: Random, count: int, size: float, apart: float) -> list[Vector]:
    """Return random points at least so far apart [m]."""
    found: list[Vector] = []
    while len(found) < count:
        point = random_point(random, size)
        if all(dist(point, other) >= apart for other in found):
            found.append(point)
    return found


def omegas(potential, places: list[Vector], targets: list[Vector]) -> list[Vector]:
    """Return Omega_i of (27) for a whole team [m]."""
    team = [Other(*each) for each in zip(places, targets, strict=True)]
    return [
        potential.omega(each.position, each.target, team[:i] + team[i + 1 :])
        for i, each in enumerate(team)
    ]


def energy(potential, places: list[Vector], targets: list[Vector]) -> float:
    """Return U of (18): attraction (19), and each pair's repulsion (20) by its weight [m^2]."""
    total = sum(0.5 * dist(q, t) ** 2 for q, t in zip(places, targets, strict=True))
    for i, j in combinations(range(len(places)), 2):
        gap = max(dist(places[i], places[j]) - potential.d_ob, potential_room.LEAST_GAP_M)
        u_tg = potential.at_targets(dist(targets[i], targets[j]))
        total += potential.k_ob * potential.value(0.5 * gap * gap, u_tg)
    return total


def flown(potential, places, targets) -> list[Vector]:
    """Return a team's places one tick later: u_i of (28), with the gain and speed that fly."""
    return stepped(potential, places, targets, q_structure.GAIN * TICK_S, SPEED_MPS * TICK_S)


def stepped(potential, places, targets, step: float, most: float) -> list[Vector]:
    """Return a team's places after one Euler step of (28), none longer than ``most`` [m]."""
    return [
        tuple(
            x + v
            for x, v in zip(q, saturated(tuple(-step * o for o in omega), most, most), strict=True)
        )
        for q, omega in zip(places, omegas(potential, places, targets), strict=True)
    ]


def pole_and_zero_slope() -> None:
    """(a), (b), (c) in the one-sided form (E3): a pole at 0, falling from there, flat at U_tg."""
    potential = potential_room.Potential(D_OB)
    for u_tg in U_TARGETS:
        assert potential.value(1e-9 * u_tg, u_tg) > 1e7 / u_tg
        assert potential.slope(1e-6 * u_tg, u_tg) < -1e10 / u_tg**2
        assert potential.slope(u_tg, u_tg) == 0.0
        assert abs(potential.slope(u_tg * (1 - 1e-7), u_tg)) < 1e-4 * (1.0 + u_tg**-2)
        steps = [u_tg * k / 200 for k in range(1, 400)]
        values = [potential.value(u, u_tg) for u in steps]
        assert all(value >= 0.0 for value in values)
        assert all(value > 0.0 for value in values[:198])
        assert all(a >= b - 1e-12 for a, b in pairwise(values))
        assert all(potential.slope(u, u_tg) <= 0.0 for u in steps)


def nothing_beyond_the_targets() -> None:
    """(e) in the one-sided form: agents farther apart than their targets do not feel each other."""
    potential = potential_room.Potential(D_OB)
    for u_tg in U_TARGETS:
        for factor in (1.0, 1.0 + 1e-12, 1.5, 3.0, 1e3):
            assert potential.value(factor * u_tg, u_tg) == 0.0
            assert potential.slope(factor * u_tg, u_tg) == 0.0


def curved_upwards_at_the_targets() -> None:
    """(d): U'' >= 0 at U_tg, and it is 1 / U_tg^3 as seen from within."""
    potential = potential_room.Potential(D_OB)
    for u_tg in U_TARGETS:
        h = 1e-5 * u_tg
        inside = (potential.slope(u_tg, u_tg) - potential.slope(u_tg - h, u_tg)) / h
        assert abs(inside * u_tg**3 - 1.0) < 1e-3, inside
        assert (potential.slope(u_tg + h, u_tg) - potential.slope(u_tg, u_tg)) / h == 0.0


def energy_never_grows() -> None:
    """(29): along the closed loop U falls from tick to tick, wherever the agents are.

    Targets are as near as a formation may have them (E1), vehicles as near as the filter lets them.
    """
    random = Random(29)
    for trial in range(16):
        team = 2 + trial % 8
        potential = potential_room.Potential(D_OB)
        targets = scattered(random, team, 1.5, D_OB + potential_room.TARGET_FLOOR_M)
        places = scattered(random, team, 1.5, D_OB)
        before = energy(potential, places, targets)
        for _ in range(150):
            places = flown(potential, places, targets)
            now = energy(potential, places, targets)
            assert now <= before + 1e-12 * max(1.0, before), f"{team} agents: {before} to {now}"
            before = now


def targets_attract_what_is_near() -> None:
    """Lemma 6 (i): from anywhere near, a team comes back to its targets, and stays."""
    random = Random(61)
    for team in (2, 3, 5, 9):
        potential = potential_room.Potential(D_OB)
        targets = scattered(random, team, 1.5, D_OB + potential_room.TARGET_FLOOR_M)
        places = [
            tuple(a + b for a, b in zip(t, random_point(random, 0.1), strict=True)) for t in targets
        ]
        for _ in range(400):
            places = flown(potential, places, targets)
        worst = max(map(dist, places, targets))
        assert worst < 1e-4, f"{team} agents: still {worst} m off"


def no_other_rest() -> None:
    """Lemma 6 (ii) in its true form, E3: from far off, too, a team rests on its targets only.

    It holds at the weight that flies and at 0.02, where (23) on both sides comes to rest elsewhere.
    """
    random = Random(62)
    for trial in range(48):
        team = 2 + trial % 5
        potential = potential_room.Potential(D_OB)
        if trial % 2:
            potential.k_ob = 0.02
        targets = scattered(random, team, 1.2, 0.7)
        places = scattered(random, team, 3.0, 0.6)
        for _ in range(1200):
            places = flown(potential, places, targets)
        worst = max(map(dist, places, targets))
        assert worst < 0.01, f"trial {trial}, {team} agents: rest {worst} m off"


def head_on_is_unstable() -> None:
    """Lemma 6 (ii): two that block each other on a line stay there, until a breath moves them.

    There they stand nearer than any targets, so at 20 Hz they tremble: by 6 mm.
    """
    potential = potential_room.Potential(D_OB)
    targets: list[Vector] = [(0.5, 0.0, 0.0), (-0.5, 0.0, 0.0)]
    for aside, parted in ((0.0, False), (1e-6, True)):
        places: list[Vector] = [(-0.6, aside, 0.0), (0.6, 0.0, 0.0)]
        for _ in range(3000):
            places = flown(potential, places, targets)
        worst = max(map(dist, places, targets))
        assert (worst < 0.01) == parted, f"{aside} m aside: rest {worst} m off"
        assert max(map(dist, places, flown(potential, places, targets))) < 0.01


def stiffness_is_bounded() -> None:
    """E4: an Euler step from within the targets shrinks iff c dt (1 + 16 k_ob / g^4) < 2."""
    for apart in (0.5, 0.6, 1.0, 1.7):
        gap = apart - D_OB
        for k_ob in (0.005, 0.02, 1.0):
            bound = 2.0 / (1.0 + 16.0 * k_ob / gap**4)
            potential = potential_room.Potential(D_OB, k_ob=k_ob, cap=1e9)
            for factor, shrinks in ((0.5, True), (0.98, True), (1.02, False)):
                off = 1e-6 * gap
                places = [(0.0, 0.0, 0.0), (apart - off, 0.0, 0.0)]
                targets = [(-0.5 * off, 0.0, 0.0), (apart - 0.5 * off, 0.0, 0.0)]
                now = stepped(potential, places, targets, factor * bound, 1e9)
                assert (abs(dist(*now) - apart) < off) == shrinks, (apart, k_ob, factor)


def what_flies_is_not_stiff() -> None:
    """E4: with the gain, the weight and the tick that fly, slots 0.51 m apart are within it."""
    k_ob, c_dt = potential_room.Potential(D_OB).k_ob, q_structure.GAIN * TICK_S
    for apart in (0.51, 0.6, 1.0, 2.0):
        assert c_dt * (1.0 + 16.0 * k_ob / (apart - D_OB) ** 4) < 2.0, apart


LAWS = {
    "(a)-(c)": pole_and_zero_slope,
    "(d)": curved_upwards_at_the_targets,
    "(e)": nothing_beyond_the_targets,
    "(29)": energy_never_grows,
    "Lemma 6 (i)": targets_attract_what_is_near,
    "Lemma 6 (ii)": no_other_rest,
    "Lemma 6 head-on": head_on_is_unstable,
    "E4": stiffness_is_bounded,
    "E4 flown": what_flies_is_not_stiff,
}
