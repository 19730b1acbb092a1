"""What must be in the picture, in six flights at three times each.

Nothing is drawn at the origin that is elsewhere, the team is in view, and colours keep their
meaning: what the panel of words says of them.
"""

import re
from typing import NamedTuple

import numpy as np
import pytest

import worldsim.results
from tests.pictures.flights import FLIGHTS, fly
from tests.pictures.scene import STRIPS, Scene, Scenes
from worldsim.judge.tick import Tick
from worldsim.recording import layout, palette
from worldsim.recording.panels import MOTION, QUESTIONS

CENTRES, BOX_COLOURS = "Boxes3D:centers", "Boxes3D:colors"
POSITIONS, POINT_COLOURS = "Points3D:positions", "Points3D:colors"
NEAR_M = 0.35
"""An agent of a moving team flies so far ahead of its slot, at most."""
ELSEWHERE = (layout.GROUND, layout.OBSTACLES, layout.JAMS)
"""What stays where it is in the world, though the team moves away."""
FORMING = [name for name in FLIGHTS if name != "flocking-9"]


def of(*names: str) -> pytest.MarkDecorator:
    """Test flights of these names, all tests of one flight together."""
    return pytest.mark.parametrize("moments", names, indirect=True, scope="module")


class Moment(NamedTuple):
    """A time of a flight: what is true, and what is shown."""

    tick: Tick
    scene: Scene


Moments = list[Moment]


@pytest.fixture(scope="module")
def moments(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Moments:
    """Return the moments of a flight, which is flown once for all tests of it."""
    name = request.param
    recording = fly(name, tmp_path_factory.mktemp("pictures") / name)
    scenes, ticks = Scenes(recording), worldsim.results.open(recording).ticks
    return [
        Moment(min(ticks, key=lambda tick: abs(tick.time_s - at)), scenes.at(at))
        for at in FLIGHTS[name].times_s
    ]


@of(*FLIGHTS)
def test_vehicles_are_drawn_where_they_are_and_in_view(moments: Moments) -> None:
    for tick, scene in moments:
        shown = scene.rows(layout.VEHICLES, CENTRES)
        np.testing.assert_allclose(shown, tick.position, atol=0.06)
        centre, radius_m = scene.view()
        assert np.linalg.norm(shown[tick.alive] - centre, axis=1).max() <= radius_m
        assert radius_m <= 1.5 * max(np.ptp(tick.position, axis=0).max(), 3.0), "it is no dot"


@of(*FLIGHTS)
def test_nothing_is_drawn_away_from_the_team(moments: Moments) -> None:
    for tick, scene in moments:
        centre, radius_m = scene.view()
        # At the start of a large fleet, the last slots of long queues are far away.
        reach_m = max(radius_m, np.nanmax(np.linalg.norm(tick.target - centre, axis=1), initial=0))
        drawn = [each for each in scene.entities() if not each.startswith(ELSEWHERE)]
        assert {layout.VEHICLES, layout.AGENTS, layout.LINKS} <= set(drawn)
        for entity in drawn:
            away = np.linalg.norm(scene.points(entity) - centre, axis=1).max()
            assert away <= 1.6 * reach_m, (entity, tick.time_s)


@of(*FORMING)
def test_slots_stand_where_agents_fly_to(moments: Moments) -> None:
    for tick, scene in moments:
        slots = np.concatenate(
            [
                scene.points(f"{formation}/{layout.SLOTS_PART}")
                for formation in (layout.FORMATION, layout.FORMATION_BEFORE)
            ]
        )
        placed = tick.alive & (tick.place[:, 0] >= 0)
        assert placed.any()
        assert len(slots) >= np.count_nonzero(placed)
        aims = tick.target[placed]
        nearest = np.linalg.norm(aims[:, None, :] - slots[None, :, :], axis=2).min(axis=1)
        assert nearest.max() <= NEAR_M, tick.time_s


@of("flocking-9")
def test_a_controller_that_forms_nothing_shows_no_formation(moments: Moments) -> None:
    for _, scene in moments:
        shown = [entity for entity in scene.entities() if entity.startswith(layout.FORMATION)]
        assert not shown


@of(*FLIGHTS)
def test_lines_join_vehicles(moments: Moments) -> None:
    for tick, scene in moments:
        for entity in (layout.LINKS, layout.LINKS_LOST, layout.LINKS_CUT, layout.HIERARCHY):
            ends = [end for strip in scene.values(entity, STRIPS) for end in strip]
            apart = np.array(ends).reshape(-1, 1, 3) - tick.position[None]
            nearest = np.linalg.norm(apart, axis=2).min(axis=1, initial=np.inf)
            # Lines of a large fleet are drawn less often than its vehicles.
            assert (nearest <= 1.0).all(), (entity, tick.time_s)


@of(*FORMING)
def test_colours_are_those_that_the_panel_names(moments: Moments) -> None:
    for tick, scene in moments:
        panels = [scene.text(layout.panel_entity(question)) for question in QUESTIONS]
        assert len({panel.rsplit("**Now", 1)[1] for panel in panels}) == 1
        colours = colours_of_queues(panels[0])
        shown = scene.values(layout.VEHICLES, BOX_COLOURS)
        trails = scene.values(layout.AGENTS, POINT_COLOURS)
        for agent, (queue, _) in enumerate(tick.place.tolist()):
            if tick.mission[agent] != tick.mission.max():
                continue
            allowed = {int(palette.SHARED_VERTEX), int(palette.IN_DISTRESS)}
            allowed |= {colours[queue]} if queue >= 0 else {int(palette.UNPLACED)}
            assert {shown[agent], trails[agent]} <= allowed, (agent, tick.time_s)


@of("flocking-9")
def test_agents_without_a_formation_have_colours_of_their_own(moments: Moments) -> None:
    seen = [scene.values(layout.VEHICLES, BOX_COLOURS) for _, scene in moments]
    assert len(set(seen[0])) == len(seen[0])
    assert seen[0] == seen[1] == seen[2]
    for _, scene in moments:
        assert "each agent has a colour of its own" in scene.text(layout.panel_entity(MOTION))


@of("partition-9")
def test_a_partition_and_a_jam_are_shown_while_they_are_in_force(moments: Moments) -> None:
    before, during, after = (scene for _, scene in moments)
    for scene in (before, after):
        assert not len(scene.points(layout.JAMS))
    assert not len(before.points(layout.SIDES))
    np.testing.assert_allclose(during.points(layout.JAMS), [[-1.5, 1.5, 0.0]], atol=1e-6)
    assert during.values(layout.JAMS, "Ellipsoids3D:half_sizes") == [[pytest.approx(1.6)] * 3]
    tick = moments[1].tick
    discs = during.rows(layout.SIDES, "Ellipsoids3D:centers")
    np.testing.assert_allclose(discs, tick.position, atol=0.06)
    sides = during.values(layout.SIDES, "Ellipsoids3D:colors")
    apart = {0, 3, 6, 8}
    assert len({sides[agent] for agent in apart}) == 1
    assert len({sides[agent] for agent in set(range(9)) - apart}) == 1
    assert len(set(sides)) == 2


@of(*[name for name in FLIGHTS if name != "wedge-100"])
def test_labels_name_every_vehicle(moments: Moments) -> None:
    for tick, scene in moments:
        labels = scene.values(layout.VEHICLES, "Boxes3D:labels")
        assert [re.match(r"a\d+", label)[0] for label in labels] == [  # type: ignore[index]
            layout.agent_name(agent) for agent in range(len(tick.alive))
        ]


def colours_of_queues(panel: str) -> list[int]:
    """Return the colour of each queue as a panel names it: "its queues: blue Q1, green Q2"."""
    listed = panel.split("Colours are its queues:", 1)[1].split(";", 1)[0]
    words = [part.split()[0] for part in listed.split(",")]
    return [int(palette.QUEUES[palette.QUEUE_COLOUR_NAMES.index(word)]) for word in words]
