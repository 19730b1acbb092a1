"""The nearest vehicle is found in small fleets and large ones, dense and sparse, on the way too."""

import numpy as np
import pytest

from netem.range_index import KEPT_FROM
from worldsim.judge.metrics import FIRST_WITHIN_M, Separation

LARGE = KEPT_FROM + 20
TICKS = 4


def least_on_the_way(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return each vehicle's least distance to any other, at many times in between."""
    least = np.full(len(after), np.inf)
    for share in np.linspace(0.0, 1.0, 201):
        at = before + share * (after - before)
        distance = np.sqrt(((at[:, None] - at[None]) ** 2).sum(axis=2))
        np.fill_diagonal(distance, np.inf)
        least = np.fmin(least, distance.min(axis=1, initial=np.inf, where=~np.isnan(distance)))
    return np.where(np.isinf(least), np.nan, least)


@pytest.mark.parametrize(
    ("agents", "side_m", "step_m"),
    [(1, 1.0, 0.1), (9, 5.0, 0.1), (LARGE, 15.0, 0.05), (LARGE, 15.0, 0.8), (LARGE, 400.0, 0.3)],
    ids=["alone", "small", "large", "fast", "sparse"],
)
def test_the_nearest_is_found(agents: int, side_m: float, step_m: float) -> None:
    random, separation = np.random.default_rng(agents), Separation()
    before = random.uniform(0.0, side_m, (agents, 3))
    separation.swept(before)
    for _ in range(TICKS):
        after = before + random.uniform(-step_m, step_m, (agents, 3))
        found = separation.swept(after)
        np.testing.assert_allclose(found, least_on_the_way(before, after), atol=0.02 * step_m)
        before = after


def test_a_vehicle_that_is_not_in_the_world_is_nobodys_nearest() -> None:
    position = np.arange(3.0 * LARGE).reshape(LARGE, 3)
    position[1] = np.nan
    separation = Separation()
    for _ in range(2):
        found = separation.swept(position)
        assert np.isnan(found[1])
        assert found[0] == pytest.approx(np.sqrt(3.0) * 6.0)


def test_one_that_comes_from_far_away_is_found_at_once() -> None:
    position = np.zeros((LARGE, 3))
    position[:, 0] = 3.0 * FIRST_WITHIN_M * np.arange(LARGE)
    position[-1] = (0.0, 1000.0, 0.0)
    separation = Separation()
    separation.swept(position)
    position = position.copy()
    position[-1] = (0.0, 0.3, 0.0)
    assert separation.swept(position)[[0, -1]] == pytest.approx([0.3, 0.3])
