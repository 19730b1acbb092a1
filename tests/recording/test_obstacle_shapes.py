"""Recorded obstacles: static shapes, positions of moving ones, and the verdict on distances."""

from pathlib import Path

import msgspec
import pytest
from rerun.chunk import Chunk, RrdReader

from tests.recording.flights import record, straight_flight, wedge
from worldsim.judge.verdict import Judge
from worldsim.recording.recorder import RunRecorder
from worldsim.recording.verify import verify
from worldsim.scenario.obstacle_tables import Box, Cylinder, Sphere, Wall

PATH = ((5.0, -2.0, 0.0), (5.0, 2.0, 0.0))
OBSTACLES = (
    Sphere(centre_m=(4.0, 0.0, 0.0), radius_m=0.5),
    Sphere(waypoints_m=PATH, speed_mps=1.0, radius_m=0.3),
    Box(centre_m=(0.0, 5.0, 0.0), size_m=(1.0, 2.0, 3.0), yaw_deg=90.0),
    Cylinder(centre_m=(0.0, -5.0, 0.0), radius_m=0.5, height_m=4.0),
    Wall(from_m=(-5.0, -1.0, 0.0), to_m=(-5.0, 1.0, 0.0), height_m=2.0, thickness_m=0.2),
)
TICKS = 41
Flown = tuple[Path, Judge, list[Chunk]]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    folder = tmp_path_factory.mktemp("obstacles")
    scenario = msgspec.structs.replace(wedge(5, duration_s=2.0), obstacle=OBSTACLES)
    recorder = RunRecorder(folder / "run.rrd", scenario, "obstacles", mode="virtual")
    judge = record(recorder, scenario, list(straight_flight(scenario)))
    return folder, judge, list(RrdReader(folder / "run.rrd").stream())


def rows(flown: Flown, entity: str, component: str, static: bool) -> list[list[list[float]]]:
    batches = [
        chunk.to_record_batch()
        for chunk in flown[2]
        if chunk.entity_path == entity and chunk.is_static == static
    ]
    having = [batch for batch in batches if component in batch.schema.names]
    return [row for batch in having for row in batch.column(component).to_pylist()]


def test_resting_obstacles_are_static(flown: Flown) -> None:
    under = "/world/obstacles"
    (spheres,) = rows(flown, f"{under}/spheres", "Ellipsoids3D:centers", static=True)
    assert spheres == [[4.0, 0.0, 0.0]]
    (boxes,) = rows(flown, f"{under}/boxes", "Boxes3D:half_sizes", static=True)
    assert boxes == [pytest.approx([0.5, 1.0, 1.5]), pytest.approx([1.0, 0.1, 1.0])]
    (turned,) = rows(flown, f"{under}/boxes", "Boxes3D:quaternions", static=True)
    assert turned[0] == pytest.approx([0.0, 0.0, 0.5**0.5, 0.5**0.5])
    (lengths,) = rows(flown, f"{under}/cylinders", "Cylinders3D:lengths", static=True)
    assert lengths == [4.0]


def test_moving_obstacles_have_a_position_at_every_tick(flown: Flown) -> None:
    entity = "/world/obstacles/moving/spheres"
    (sizes,) = rows(flown, entity, "Ellipsoids3D:half_sizes", static=True)
    assert sizes == [pytest.approx([0.3, 0.3, 0.3])]
    centres = rows(flown, entity, "Ellipsoids3D:centers", static=False)
    assert len(centres) == TICKS
    assert [centres[0][0], centres[20][0]] == [[5.0, -2.0, 0.0], [5.0, -1.0, 0.0]]


def test_each_agent_has_an_obstacle_distance(flown: Flown) -> None:
    distances = rows(flown, "/metrics/obstacle_distance", "Scalars:scalars", static=False)
    assert [len(row) for row in distances] == [5] * TICKS
    assert min(min(row) for row in distances) == flown[1].min_obstacle_distance_m


def test_the_recording_alone_gives_the_same_distance(flown: Flown) -> None:
    folder, judge, _ = flown
    verification = verify(folder)
    assert verification.min_obstacle_distance_m == judge.min_obstacle_distance_m is not None
    row = next(row for row in verification.expectations if row.name == "min_obstacle_distance_m")
    assert (row.wanted, row.got) == (0.5, judge.min_obstacle_distance_m)


def test_without_obstacles_there_are_no_entities_of_them(tmp_path: Path) -> None:
    scenario = wedge(3, duration_s=1.0)
    recorder = RunRecorder(tmp_path / "run.rrd", scenario, "none", mode="virtual")
    judge = record(recorder, scenario, list(straight_flight(scenario)))
    assert judge.min_obstacle_distance_m is None
    entities = {chunk.entity_path for chunk in RrdReader(tmp_path / "run.rrd").stream()}
    assert not [entity for entity in entities if "obstacle" in entity]
