"""The laws of the method, as functions that raise AssertionError where one does not hold.

Each looks its subject up when it is called, so that a literal form of the paper can be put in its
place: see test_literal_forms.py.
"""

from math import dist, hypot
from random import Random

from agent.assignment import allocation
from agent.controller import Peer
from agent.guidance import potential as potential_room
from agent.messages import Place, Vector
from agent.qstructure.formation import Formation, FormationSpec, QueueSpec
from agent.qstructure.shape import Polyline, Ray
from tests.laws import approach, energy, far_agents, radio
from tests.laws.energy import D_OB, Other, random_point

WEDGE = FormationSpec(
    "wedge",
    {"V1": (0.0, 0.0, 0.0)},
    tuple(
        QueueSpec(f"Q{index}", ("V1",), Ray((-1.0, y, z)))
        for index, (y, z) in enumerate([(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
    ),
)
ZIGZAG = FormationSpec(
    "zigzag",
    {"V1": (1.0, 2.0, 3.0)},
    (
        QueueSpec(
            "Q1",
            ("V1",),
            Polyline(((0.0, 0.0, 0.0), (1.5, 0.0, 0.0), (1.5, 1.5, 0.0), (0.0, 1.5, 1.5))),
        ),
    ),
)


def targets_are_an_equilibrium() -> None:
    """(21), (22), E1: agents that stand on their targets want to stay there."""
    potential = potential_room.Potential(D_OB)
    for spacing in (0.6, 1.0, 1.7):
        here, there = (0.0, 0.0, 0.0), (spacing, 0.0, 0.0)
        omega = potential.omega(here, here, [Other(there, there)])
        assert hypot(*omega) < 1e-9, f"{spacing} m apart: Omega {omega}"


def repulsion_never_attracts() -> None:
    """E1, E2: whatever the targets, also equal ones, a neighbour never pulls."""
    random = Random(2)
    potential = potential_room.Potential(D_OB)
    for _ in range(2000):
        q, q_j, q_tg = (random_point(random, 1.0) for _ in range(3))
        q_tg_j = tuple(x + random.choice((0.0, 1e-3, 0.3, 1.0)) for x in q_tg)
        omega = potential.omega(q, q_tg, [Other(q_j, q_tg_j)])  # type: ignore[arg-type]
        own = potential.omega(q, q_tg, [])
        r = dist(q, q_j)
        towards = sum((o - w) * (a - b) for o, w, a, b in zip(omega, own, q, q_j, strict=True))
        assert towards / r <= 1e-12, f"pulled by {towards / r} at {r} m"


def omega_is_the_gradient() -> None:
    """(26), (27), E2: Omega_i is the gradient of U, checked by central differences."""
    random = Random(3)
    potential = potential_room.Potential(D_OB, k_ob=1.0, cap=1e9)
    for _ in range(300):
        q_j, q_tg, q_tg_j = (random_point(random, 1.0) for _ in range(3))
        away = random_point(random, 1.0)
        r = random.uniform(0.5, 1.5)
        q = tuple(a + r * b / hypot(*away) for a, b in zip(q_j, away, strict=True))
        u_tg = potential.at_targets(dist(q_tg, q_tg_j))

        def energy(at: Vector, q_j=q_j, q_tg=q_tg, u_tg=u_tg) -> float:  # type: ignore[no-untyped-def]
            gap = dist(at, q_j) - D_OB
            return 0.5 * dist(at, q_tg) ** 2 + potential.value(0.5 * gap * gap, u_tg)

        omega = potential.omega(q, q_tg, [Other(q_j, q_tg_j)])  # type: ignore[arg-type]
        for axis in range(3):
            h = 1e-6
            plus = tuple(x + h * (k == axis) for k, x in enumerate(q))
            minus = tuple(x - h * (k == axis) for k, x in enumerate(q))
            slope = (energy(plus) - energy(minus)) / (2.0 * h)  # type: ignore[arg-type]
            assert abs(slope - omega[axis]) <= 1e-4 * max(1.0, abs(slope)), (slope, omega[axis])


def no_second_equilibrium() -> None:
    """Lemma 6 in its true form, E3: from wherever a pair starts, it comes to rest on its targets.

    The pair starts on the line of its targets, in the targets' order.
    """
    potential = potential_room.Potential(D_OB, k_ob=1.0, cap=1e9)
    for apart in (0.6, 1.0, 1.5, 2.0, 2.34, 2.6, 3.0):
        left, right = -0.5 * apart, 0.5 * apart
        for _ in range(4000):
            a = potential.omega(
                (left, 0.0, 0.0), (-0.5, 0.0, 0.0), [Other((right, 0.0, 0.0), (0.5, 0.0, 0.0))]
            )
            b = potential.omega(
                (right, 0.0, 0.0), (0.5, 0.0, 0.0), [Other((left, 0.0, 0.0), (-0.5, 0.0, 0.0))]
            )
            left, right = left - 0.005 * a[0], right - 0.005 * b[0]
        assert abs(right - left - 1.0) < 0.01, f"from {apart} m apart it rests at {right - left}"


def slots_stand_by_arc_length() -> None:
    """E13: neighbouring slots are d_ir apart along the queue, round corners too."""
    for spacing in (0.7, 1.0):
        formation = Formation(ZIGZAG, spacing)
        slots = formation.layout(7).slots
        for rank in range(1, 7):
            end = slots[Place(0, rank)].point
            walked, before = 0.0, slots[Place(0, rank - 1)].point
            s = (rank - 1) * spacing
            while dist(before, end) > 2e-4 and walked < 3.0 * spacing:
                s += 1e-4
                point = formation.queues[0].point(s)
                walked += dist(before, point)
                before = point
            assert abs(walked - spacing) < 1e-3, f"slot {rank}: {walked} m where {spacing} m belong"


def everybody_gets_a_slot_of_their_own() -> None:
    """E16: a shared vertex has one agent; no two of a team's slots coincide."""
    formation = Formation(WEDGE, 1.0)
    for agents in range(1, 40):
        layout = formation.layout(agents)
        slots = [layout.slots[place].point for place in layout.places]
        assert len(slots) == agents
        for index, slot in enumerate(slots):
            assert all(dist(slot, other) > 0.5 for other in slots[:index]), (agents, slot)


def noise_changes_no_order() -> None:
    """E17: two agents as far from a slot as each other keep their order under 1 cm of noise."""
    random = Random(17)
    places = (Place(0, 0), Place(0, 1))
    slots = ((0.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
    true = {1: (1.0, 0.5, 0.0), 2: (1.0, -0.5, 0.0)}
    claims: dict[int, Place | None] = {1: None, 2: None}
    flips = 0
    for update in range(600):
        team = [
            Peer(
                id=who,
                position=tuple(x + random.gauss(0.0, 0.01) for x in true[who]),  # type: ignore[arg-type]
                place=claims[who],
            )
            for who in (1, 2)
        ]
        chosen = allocation.allocate(team, places, slots)
        flips += update > 0 and chosen != claims
        claims = dict(chosen)
    assert flips == 0, f"{flips} flips in 600 updates"


LAWS = {
    "E1": targets_are_an_equilibrium,
    "E1 floor": repulsion_never_attracts,
    "E2": omega_is_the_gradient,
    "E3": no_second_equilibrium,
    "E13": slots_stand_by_arc_length,
    "E16": everybody_gets_a_slot_of_their_own,
    "E17": noise_changes_no_order,
    **energy.LAWS,
    **approach.LAWS,
    **radio.LAWS,
    **far_agents.LAWS,
}
