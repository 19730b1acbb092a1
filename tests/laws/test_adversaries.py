"""The safety filter alone against adversarial pairs, and the proof that these pairs have teeth.

The full number is flown by ``python -m tests.laws.adversaries --pairs 100000``.
"""

from math import pi

import numpy as np
import pytest

from agent.guidance.cone import Cone
from agent.guidance.safety_filter import RangingFilter, limited
from tests.laws.adversaries import (
    D_OB,
    FLEETS,
    KINDS,
    Fleet,
    Law,
    directions,
    least_distance,
    main,
    norm,
    swept,
    vehicles,
    violations,
)

pytestmark = pytest.mark.flight


@pytest.mark.parametrize("fleet", FLEETS, ids=str)
def test_no_pair_ever_comes_nearer_than_d_ob(fleet):
    count, nearest, closed = violations(fleet, 6000, seed=2)
    assert count == 0
    assert nearest >= D_OB - 1e-9
    assert closed < 0.4, "the adversaries never came near"


def test_the_fleets_are_within_the_filters_condition():
    assert all(max(fleet.speeds) * fleet.horizon_s <= 0.1 + 1e-12 for fleet in FLEETS)


def test_a_greater_share_without_margin_lets_them_collide():
    random = np.random.default_rng(3)
    _, least = least_distance(random, Fleet((1.0, 1.0), 2), 2000, share=0.9, margin=False)
    assert (least < D_OB - 1e-3).sum() > 20


@pytest.mark.parametrize("fleet", FLEETS[:4], ids=str)
def test_two_that_circle_eat_up_a_margin_that_does_not_slow_them(fleet):
    _, least = least_distance(np.random.default_rng(6), fleet, 2000, turning=False)
    assert (least < D_OB - 1e-3).sum() > 0


def test_the_array_form_is_the_law_that_flies():
    random, rows = np.random.default_rng(4), 4000
    wanted = directions(random, rows) * random.uniform(0.0, 1.0, rows)[:, None]
    towards = directions(random, rows) * random.uniform(0.2, 1.5, rows)[:, None]
    towards[::2] *= random.uniform(0.249, 0.27, rows // 2)[:, None] / norm(towards[::2])[:, None]
    wanted[::3] = towards[::3] / norm(towards[::3])[:, None]
    wanted[::5, :2] *= 0.01
    yaw, cone = random.uniform(-pi, pi, rows), random.uniform(0.0, pi, (rows, 2))
    for max_speed, horizon_s in ((0.5, 0.05), (1.0, 0.1)):
        flies = RangingFilter(D_OB, max_speed, horizon_s)
        found = Law(max_speed, horizon_s)(wanted, towards, yaw, cone)
        for row in range(rows):
            bounds = flies.bounds([tuple(towards[row].tolist())])
            safe = limited(
                tuple(wanted[row].tolist()), bounds, float(yaw[row]), Cone(*cone[row].tolist())
            )
            assert np.abs(found[row] - safe).max() <= 1e-12


def test_every_kind_of_adversary_takes_part():
    kinds = vehicles(np.random.default_rng(5), np.zeros((200, 3)), 1.0).kind
    assert set(kinds.tolist()) == set(range(len(KINDS)))


def test_the_command_says_what_it_found(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["adversaries", "--pairs", "50"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    assert capsys.readouterr().out.count("0 of 50 violate") == len(FLEETS)


def test_distances_are_those_of_the_way_not_of_its_ends():
    start, change = np.array([[1.0, 0.3, 0.0]]), np.array([[-2.0, 0.0, 0.0]])
    assert swept(start, change) == pytest.approx([0.3])
