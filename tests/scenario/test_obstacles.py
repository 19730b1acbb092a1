"""Obstacles in a scenario: refused tables, and the resolution of a random field."""

from math import dist, hypot
from pathlib import Path

import pytest

from tests.small_scenario import SMALL
from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS, admit
from worldsim.scenario.file import dump, load, parse
from worldsim.scenario.obstacle_tables import Cylinder, Sphere
from worldsim.scenario.toml import ScenarioError

WEDGE = Path("deploy/scenarios/wedge-9.toml")
FIELD = "centre_m = [9, 0, 0], size_m = [10, 8, 4], corridor_m = 1"
BALL = "shape = 'sphere', radius_m = 0.5"
LINE = "waypoints_m = [[0, 0, 9], [1, 0, 9]]"
PAIR = "{ kind = 'list', positions_m = [[0, 0, 0], [2, 0, 0]] }"


def with_field(more: str, **overrides: str):
    return load(WEDGE, {"obstacle_field": f"{{ {FIELD}, {more} }}", **overrides})


REFUSED = [
    ("{ shape = 'cone' }", "obstacle[0].shape", "'sphere' or 'box' or 'cylinder' or 'wall'"),
    ("{ shape = 'sphere', centre_m = [0, 0, 9] }", "obstacle[0].radius_m", "is missing"),
    (f"{{ {BALL} }}", "obstacle[0].centre_m", "to rest there, or waypoints_m"),
    (f"{{ {BALL}, centre_m = [0, 0, 9], {LINE} }}", "obstacle[0].centre_m", "one"),
    (f"{{ {BALL}, {LINE} }}", "obstacle[0].speed_mps", "goes with waypoints_m"),
    (f"{{ {BALL}, centre_m = [0, 0, 9], speed_mps = 1 }}", "obstacle[0].speed_mps", "goes with"),
    (
        f"{{ {BALL}, waypoints_m = [[0, 0, 9]], speed_mps = 1 }}",
        "obstacle[0].waypoints_m",
        "a list of 2 to 64",
    ),
    (
        f"{{ {BALL}, waypoints_m = [[0, 0, 9], [0, 0, 9]], speed_mps = 1 }}",
        "obstacle[0].waypoints_m",
        "all at one place",
    ),
    (f"{{ {BALL}, {LINE}, speed_mps = 1, at_end = 'jump' }}", "obstacle[0].at_end", "'back' or"),
    ("{ shape = 'box', centre_m = [0, 0, 9], size_m = [1, 1] }", "obstacle[0].size_m", "of 3"),
    (
        "{ shape = 'wall', from_m = [0, 0, 9], to_m = [0, 1, 8], height_m = 1 }",
        "obstacle[0].to_m",
        "that of from_m, 9",
    ),
    (
        "{ shape = 'wall', from_m = [0, 0, 9], to_m = [0, 0, 9], height_m = 1 }",
        "obstacle[0].to_m",
        "has a length",
    ),
]


@pytest.mark.parametrize(("table", "key", "says"), REFUSED)
def test_an_inconsistent_obstacle_is_refused(table: str, key: str, says: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load(WEDGE, {"obstacle": f"[{table}]"})
    assert str(caught.value).startswith(f"{WEDGE}: {key}: ")
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


FIELDS = [
    ("seed = 3", "seed", "unknown key"),
    ("shape = 'sphere'", "count", "one of the two"),
    ("count = 3, density_per_m3 = 1", "count", "one of the two"),
    ("count = 0", "count", "from 1"),
    ("density_per_m3 = 0.05, shape = 'box'", "shape", "'cylinder' or 'sphere'"),
    ("count = 3, radius_m = [2, 1]", "radius_m", "the least first"),
    ("density_per_m3 = 4", "density_per_m3", "1280 obstacles; at most 1000"),
    ("count = 900", "count", "of 900 obstacles 1 m apart in a box of 10 x 8 x 4 m"),
    ("density_per_m3 = 2", "density_per_m3", "fewer, or a smaller corridor_m"),
]


@pytest.mark.parametrize(("more", "key", "says"), FIELDS)
def test_an_inconsistent_field_is_refused(more: str, key: str, says: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        with_field(more)
    assert str(caught.value).startswith(f"{WEDGE}: obstacle_field.{key}: ")
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_obstacle_on_top_of_a_start_is_refused() -> None:
    ball = f"[{{ {BALL}, centre_m = [2, 0.9, 0] }}]"
    scenario = load(WEDGE, {"fleet.agents": "2", "fleet.start": PAIR, "obstacle": ball})
    with pytest.raises(ScenarioError) as caught:
        admit(scenario, "mine.toml", VIRTUAL_COMMAND_TICKS)
    error = "mine.toml: fleet.start: obstacle[0] is within 0.5 m of [2, 0, 0]"
    assert str(caught.value) == error


def test_a_box_of_starts_full_of_obstacle_is_refused() -> None:
    scenario = load(WEDGE, {"obstacle": "[{ shape = 'sphere', centre_m = [0,0,0], radius_m = 9 }]"})
    with pytest.raises(ScenarioError, match=r"fleet\.start: no room .*, 0\.5 m from obstacles"):
        admit(scenario, "mine.toml", VIRTUAL_COMMAND_TICKS)


def test_a_field_becomes_obstacles_that_can_be_written_and_read() -> None:
    scenario = with_field("count = 7")
    assert scenario.obstacle_field is None
    assert len(scenario.obstacle) == 7
    assert parse(dump(scenario)) == scenario


def test_the_field_depends_on_the_seed_alone() -> None:
    first, again = with_field("count = 7"), with_field("count = 7")
    other = with_field("count = 7", seed="2")
    assert first.obstacle == again.obstacle
    assert first.obstacle != other.obstacle


def test_a_density_counts_obstacles_per_volume() -> None:
    assert len(with_field("density_per_m3 = 0.02").obstacle) == 7


@pytest.mark.parametrize("seed", range(5))
def test_spheres_leave_corridors_and_the_start_free(seed: int) -> None:
    scenario = with_field("count = 9, radius_m = [0.3, 0.6]", seed=str(seed))
    balls = [each for each in scenario.obstacle if isinstance(each, Sphere)]
    assert len(balls) == 9
    for index, ball in enumerate(balls):
        assert ball.centre_m is not None
        assert 0.3 <= ball.radius_m <= 0.6
        assert all(
            abs(c - m) <= h for c, m, h in zip(ball.centre_m, (9, 0, 0), (5, 4, 2), strict=True)
        )
        assert ball.centre_m[0] - 2.5 - ball.radius_m >= 1.0 - 1e-9
        for other in balls[:index]:
            between = dist(ball.centre_m, other.centre_m or ())
            assert between - ball.radius_m - other.radius_m >= 1.0


def test_cylinders_are_as_high_as_the_box() -> None:
    forest = with_field("count = 6, shape = 'cylinder'").obstacle
    trees = [each for each in forest if isinstance(each, Cylinder) and each.centre_m is not None]
    assert {(tree.height_m, tree.centre_m[2]) for tree in trees} == {(4.0, 0.0)}
    assert len(trees) == 6
    for index, tree in enumerate(trees):
        for other in trees[:index]:
            x, y = tree.centre_m[0] - other.centre_m[0], tree.centre_m[1] - other.centre_m[1]
            assert hypot(x, y) - tree.radius_m - other.radius_m >= 1.0


def test_a_field_comes_after_the_list() -> None:
    scenario = with_field("count = 2", obstacle=f"[{{ {BALL}, centre_m = [0, 9, 0] }}]")
    assert scenario.obstacle[0] == Sphere(centre_m=(0, 9, 0), radius_m=0.5)
    assert len(scenario.obstacle) == 3


def test_a_flat_field_has_no_cylinders_but_may_have_spheres() -> None:
    flat = "{ centre_m = [9, 0, 0], size_m = [6, 6, 0], count = 3, shape = '%s' }"
    with pytest.raises(ScenarioError, match=r"obstacle_field\.size_m\[2\]: must be above 0"):
        load(WEDGE, {"obstacle_field": flat % "cylinder"})
    assert len(load(WEDGE, {"obstacle_field": flat % "sphere"}).obstacle) == 3


RESOLVED = {
    "obstacle_field.size_m[2]": {"shape": "'cylinder'", "size_m": "[9, 9, 0.0001]"},
    "obstacle_field.centre_m[0]": {"centre_m": "[1000000, 0, 0]"},
    "obstacle_field": {"count": "1000", "size_m": "[4000, 4000, 4000]"},
}


@pytest.mark.parametrize(("key", "change"), RESOLVED.items(), ids=RESOLVED)
def test_a_field_is_refused_whose_resolved_obstacles_would_be(
    key: str, change: dict[str, str]
) -> None:
    sound = {"centre_m": "[20, 0, 0]", "size_m": "[9, 9, 5]", "count": "1"}
    overrides = {f"obstacle_field.{name}": value for name, value in (sound | change).items()}
    listed = {"obstacle": "[{ shape = 'sphere', centre_m = [9, 9, 9], radius_m = 1 }]"}
    with pytest.raises(ScenarioError) as refused:
        parse(SMALL, overrides=overrides | listed)
    assert refused.value.key == key
