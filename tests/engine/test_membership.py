"""Who is struck, who comes back, who joins: found when it happens, from the seed and the claims."""

from pathlib import Path

import numpy as np
import pytest

from worldsim.engine.membership import Team
from worldsim.scenario.file import load
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.tables import Scenario
from worldsim.scenario.timeline import Holding, Joining, Revival, Strike

WEDGE = Path("deploy/scenarios/wedge-9.toml")
PLACES = [(0, 0), (0, 1), (1, 1), (1, 2), (2, 1), (3, 1), (0, 2), None, (9, 9)]


def scenario(**overrides: str) -> Scenario:
    events = "[{ at_s = 1, join = 3 }]"
    return load(WEDGE, {"event": events, **{k.replace("__", "."): v for k, v in overrides.items()}})


def struck(team: Team, *selectors: int | str) -> tuple[int, ...]:
    strike = Strike(0, "kill", selectors)
    return team.struck(strike, [*PLACES, None, None, None], scenario().formation).agents


@pytest.mark.parametrize(
    ("selectors", "agents"),
    [
        ((3, 1, 3), (1, 3)),
        (("vertex:V1",), (0,)),
        (("queue:Q1", 5), (0, 1, 5, 6)),
        (("all",), tuple(range(9))),
    ],
)
def test_selectors(selectors: tuple[int | str, ...], agents: tuple[int, ...]) -> None:
    assert struck(Team(scenario()), *selectors) == agents


def test_random_ones_belong_to_the_seed_and_the_event() -> None:
    first = struck(Team(scenario()), "random:3")
    assert len(set(first)) == 3
    assert struck(Team(scenario()), "random:3") == first
    others = {
        Team(scenario(seed=str(seed))).struck(
            Strike(0, "kill", ("random:3",)), [*PLACES, None, None, None], scenario().formation
        )
        for seed in range(8)
    }
    assert len(others) > 1


def test_the_dead_are_not_struck_again_and_come_back_with_a_higher_incarnation() -> None:
    team = Team(scenario())
    position = np.zeros((12, 3))
    stop = team.struck(Strike(4, "kill", (2, 5)), [None] * 12, scenario().formation)
    team.take(stop, 10.0)
    assert not team.whole
    assert struck(team, 2, 5) == ()
    back = team.revived(Revival(4, ()), position)
    assert (back.incarnations, back.stands) == ({2: 1, 5: 1}, {})
    team.take(back, 20.0)
    assert not team.alive[2]
    assert team.next_boot_s == 21.0
    assert team.booted(20.9).agents == ()
    team.take(team.booted(21.0), 21.0)
    assert team.alive[[2, 5]].all()
    assert team.incarnations[2] == 1


def test_the_paused_take_part_but_do_not_step_until_they_resume() -> None:
    team = Team(scenario())
    places = [*PLACES, None, None, None]
    formation = scenario().formation
    team.take(team.held(Holding(0, "pause", ("vertex:V1", 4)), places, formation), 10.0)
    assert team.alive[[0, 4]].all()
    assert not team.awake[[0, 4]].any()
    assert team.first == 1
    assert struck(team, "vertex:V1") == ()  # it is not where it was found last
    assert struck(team, 4) == (4,)
    assert team.held(Holding(0, "pause", (4,)), places, formation).agents == ()
    team.take(team.held(Holding(1, "resume", (4,)), places, formation), 11.0)
    assert team.held(Holding(0, "resume", ()), places, formation).agents == (0,)
    team.take(team.struck(Strike(2, "kill", (0,)), places, formation), 12.0)
    assert team.held(Holding(0, "resume", ()), places, formation).agents == ()


def test_joiners_get_the_next_ids_and_keep_clear_of_who_is_there() -> None:
    team = Team(scenario())
    position = np.full((12, 3), np.nan)
    position[:9] = np.arange(27).reshape(9, 3)
    start = BoxStart(size_m=(3.0, 3.0, 3.0), spacing_m=0.6)
    joining = team.joined(Joining(0, 3, start), position)
    assert list(joining.incarnations) == [9, 10, 11]
    stands = np.array([where for where, _ in joining.stands.values()])
    everybody = np.concatenate((position[:9], stands))
    apart = np.linalg.norm(everybody[:, None] - stands, axis=2)
    apart[range(9, 12), range(3)] = np.inf
    assert apart.min() >= 0.6


def test_a_place_that_is_taken_refuses_all_who_would_join() -> None:
    team = Team(scenario())
    position = np.full((12, 3), np.nan)
    position[0] = (1.0, 0.0, 0.0)
    start = ListStart(positions_m=((5.0, 0.0, 0.0), (1.1, 0.0, 0.0)))
    refused = team.joined(Joining(0, 2, start), position)
    assert refused.incarnations == {}
    assert refused.refused == "a vehicle is within 0.25 m of [1.1, 0, 0]"


def test_who_left_comes_back_somewhere_clear() -> None:
    team = Team(scenario())
    position = np.zeros((12, 3)) + np.arange(12)[:, None]
    stop = team.struck(Strike(4, "leave", (2,)), [None] * 12, scenario().formation)
    team.take(stop, 10.0)
    position[2] = np.nan
    back = team.revived(Revival(7, (2,)), position)
    (where, _) = back.stands[2]
    away = np.linalg.norm(np.delete(position, 2, axis=0) - where, axis=1)
    assert away.min() >= 0.6
