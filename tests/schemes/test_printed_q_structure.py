"""The printed paper: its equations are the literal ones, and its Algorithm 1 is that of Fig. 4."""

from math import dist
from random import Random

import pytest

from agent.guidance.cone import Cone
from agent.guidance.potential import Potential
from agent.messages import DISTRESS, MEMBER, SUB_VERTEX, VERTEX, Place
from agent.schemes.links import Situation
from agent.schemes.printed_equations import CastZone, bobber, omega, slope
from agent.schemes.printed_q_structure import PrintedQStructure, links_needed, queue_of, roles
from tests.laws import literal
from tests.schemes.situations import WEDGE, heard, senses, setup

ZONE = CastZone(0.05, 0.5, Cone(0.785, 0.785))
STEP_S = 0.2


class Literal(Potential):
    """The potential with the literal forms of tests/laws."""

    __init__ = literal.unit_weight
    gap_at_targets = literal.gap_at_targets
    slope = literal.slope_two_sided


@pytest.mark.pure
def test_omega_is_that_of_the_literal_forms():
    random, printed = Random(1), Literal(0.25)
    for _ in range(200):
        q, q_tg, *others = [tuple(random.uniform(-2, 2) for _ in range(3)) for _ in range(8)]
        near = [heard(k, others[k], target=others[k + 3]) for k in range(3)]
        assert omega(q, q_tg, tuple(near), 0.25) == pytest.approx(
            literal.omega(printed, q, q_tg, near), rel=1e-6
        )


@pytest.mark.pure
def test_the_slope_is_that_of_23_and_never_overflows():
    for u, u_tg in ((0.3, 0.5), (0.5, 0.5), (0.9, 0.5)):
        value = [literal.value_two_sided(Literal(0.25), u + d, u_tg) for d in (-1e-6, 1e-6)]
        assert slope(u, u_tg) == pytest.approx((value[1] - value[0]) / 2e-6, abs=1e-3)
    assert slope(0.0, 0.0) < 1e30
    assert abs(slope(1e4, 0.0)) < 1e-200


def test_the_bobber_freezes_where_it_is_printed_to():
    """E7: about 0.3 m ahead wherever the target is, but for a target inside the zone."""
    for target in ((5.0, 0.3, 0.2), (3.0, 2.0, 0.0), (-3.0, 1.0, 0.0)):
        at = bobber((0.0, 0.0, 0.0), 0.0, target, ZONE)
        assert 0.2 < dist(at, (0.0, 0.0, 0.0)) < 0.35
        assert abs(at[1]) < 0.05
        level = literal.bobber((0.0, 0.0, 0.0), 0.0, (*target[:2], 0.0), _Zone)
        assert abs(at[0] - level[0]) < 0.05
    assert bobber((1.0, 0.0, 0.0), 0.0, (1.4, 0.1, 0.1), ZONE) == (1.4, 0.1, 0.1)


class _Zone:
    reach, cone = 0.5, Cone(0.785, 0.785)


def chain(agents=5, rounds=1):
    """Return what agents in a row who hear the next ones (Fig. 4) say, round by round."""
    fleet = [PrintedQStructure(setup(4 * k, 20)) for k in range(agents)]
    at = [(-(k + 0.01), k + 0.01, k + 0.01) for k in range(agents)]
    said, rounds_words = [None] * agents, []
    for step in range(rounds):
        words = []
        for k in range(agents):
            near = [
                heard(4 * j, at[j], target=at[j], standing=said[j])
                for j in (k - 1, k + 1)
                if 0 <= j < agents
            ]
            words.append(fleet[k].decide(senses(at[k], near, STEP_S * step)).words)
        said = [each.standing for each in words]
        rounds_words.append(words)
    return rounds_words


def test_the_roles_of_fig_4_come_and_flap():
    """E15: who is promoted clears the distress that promoted it."""
    rounds = [[each.role for each in words] for words in chain(rounds=30)]
    fig_4 = [VERTEX, SUB_VERTEX, SUB_VERTEX, DISTRESS, DISTRESS]
    assert fig_4 in rounds
    assert rounds[10:16] == rounds[16:22] == rounds[22:28]
    assert len({each[1] for each in rounds[10:16]}) == 2


def test_roles_are_those_of_lines_1_to_11():
    first = (0.0, 0.0, 0.0)
    ((vertex,),) = chain(agents=1)
    leader = heard(1, (0.1, 0.0, 0.0), standing=vertex.standing)
    distressed = heard(7, (3.0, 0.0, 0.0))
    linked = heard(8, (3.0, 0.0, 0.0), standing=vertex.standing)
    here = (1.0, 0.0, 0.0)
    assert roles(here, first, [distressed])[:2] == (VERTEX, 0)
    assert roles((4.0, 0.0, 0.0), first, [distressed])[:2] == (DISTRESS, -1)
    assert roles(here, first, [leader, distressed])[:2] == (SUB_VERTEX, 1)
    assert roles(here, first, [leader, linked])[:2] == (MEMBER, 1)


def test_the_first_of_every_queue_takes_the_apex():
    assert [queue_of(WEDGE, 9, k) for k in range(9)] == [0, 1, 2, 3, 0, 1, 2, 3, 0]
    apex = WEDGE.layout(9).places[0]
    for k in range(4):
        intent = PrintedQStructure(setup(k)).decide(senses((1.0, 0.0, 0.0)))
        assert intent.place == apex
        assert intent.target == (0.0, 0.0, 0.0)


def test_the_second_takes_the_point_d_ir_from_the_moving_target_of_the_first():
    ((first,),) = chain(agents=1)
    controller = PrintedQStructure(setup(4, 20))
    moving = (((0.0, 0.0, 0.0), 1.0), ((-0.2, 0.2, 0.2), 1.346))
    for now_s, (target, slot) in enumerate(moving):
        near = [heard(0, (0.0, 0.0, 0.0), target=target, standing=first.standing)]
        intent = controller.decide(senses((-2.0, 2.0, 2.0), near, now_s))
        assert intent.place == Place(0, 1)
        assert dist(intent.target, (0.0, 0.0, 0.0)) == pytest.approx(slot, abs=0.003)


def test_it_needs_its_queue():
    at = Situation(5, frozenset(range(9)), frozenset({3, 4}), leader=1, vertex_agent=0)
    assert links_needed(at) == {3, 4}
