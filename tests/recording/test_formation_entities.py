"""The formation in the picture: where the judge has it at any time, and only where there is one."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from rerun.chunk import Chunk, RrdReader

from agent.messages import DISTRESS, FramePath
from agent.qstructure.formation import Formation, FormationSpec, QueueSpec
from agent.qstructure.frame_path import Track
from agent.qstructure.shape import Ray
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.phase import Phase
from worldsim.judge.run_events import FormationGiven
from worldsim.judge.tick import HierarchyRows, Tick
from worldsim.judge.verdict import Judge
from worldsim.recording import palette
from worldsim.recording.recorder import RunRecorder
from worldsim.scenario.target_frame import FrameTable, path_of

AGENTS = 9
GIVEN_S, MISSION = 2.03, 1024
KILLED_S = 3.2
SLOTS = "/world/formation/slots"
LINE = FormationSpec(
    name="line",
    vertices={"V1": (0.5, 0.0, 1.0)},
    queue=(QueueSpec(name="Q1", vertices=("V1",), shape=Ray(direction=(0, 1, 0))),),
)
CORNER = FrameTable(
    waypoints_m=((20.0, 0.0, 0.0), (21.0, 0.0, 0.0), (21.0, 1.0, 0.0)),
    speed_mps=2.0,
    start_s=0.3,
    yaw="path",
    turn_dps=180.0,
)
NEW_PATH = FramePath(
    waypoints=((40.0, 0.0, 0.0), (40.0, 9.0, 3.0)), speed=1.5, yaw=0.7, start_s=GIVEN_S
)
SCENARIO = msgspec.structs.replace(wedge(AGENTS, duration_s=4.0), frame=CORNER)
GIVEN = FormationGiven(
    t_s=GIVEN_S,
    agent=0,
    planned=True,
    formation="line",
    mission=MISSION,
    path=NEW_PATH,
    tables=LINE,
)


def moving_flight() -> list[Tick]:
    """A wedge, whose agents take up a line at 2.3 s; one of them dies at 3.2 s."""
    in_line = np.array([(0, rank) for rank in range(AGENTS)], dtype=np.int16)
    flown = []
    for tick in straight_flight(SCENARIO):
        if tick.time_s >= 2.3:
            mission = np.full(AGENTS, MISSION, dtype=np.int64)
            tick = replace(tick, place=in_line, mission=mission)  # noqa: PLW2901
        if tick.time_s >= KILLED_S:
            running = np.arange(AGENTS) != 3
            tick = replace(tick, alive=running)  # noqa: PLW2901
        flown.append(tick)
    return flown


def recorded(path: Path, ticks: list[Tick], *events: FormationGiven) -> list[Chunk]:
    recorder, judge = RunRecorder(path, SCENARIO, "formation", mode="virtual"), Judge(SCENARIO)
    given = list(events)
    for tick in ticks:
        while given and given[0].t_s <= tick.time_s:
            judge.handle_event(given[0])
            recorder.event(given.pop(0))
        recorder.tick(tick, judge.see(tick))
    recorder.close()
    return list(RrdReader(path).stream())


@pytest.fixture(scope="module")
def chunks(tmp_path_factory: pytest.TempPathFactory) -> list[Chunk]:
    path = tmp_path_factory.mktemp("formation") / "run.rrd"
    return recorded(path, moving_flight(), GIVEN)


def values(chunks: list[Chunk], entity: str, component: str) -> list[tuple[float, list[object]]]:
    """Return the times [s] and values of a component, in the order of time."""
    batches = [each.to_record_batch() for each in chunks if each.entity_path == entity]
    rows = [
        (time.total_seconds(), value)
        for batch in batches
        if component in batch.schema.names and "sim_time" in batch.schema.names
        for time, value in zip(
            batch.column("sim_time").to_pylist(), batch.column(component).to_pylist(), strict=True
        )
        if value is not None
    ]
    return sorted(rows, key=lambda row: row[0])


def shown(chunks: list[Chunk], entity: str, component: str, time_s: float) -> np.ndarray:
    """Return what a viewer shows of a component at a time [s]: the latest value."""
    return np.array([v for t, v in values(chunks, entity, component) if t <= time_s + 1e-9][-1])


def in_world(chunks: list[Chunk], points: np.ndarray, time_s: float) -> np.ndarray:
    """Return points under the formation's transform as a viewer shows them [m; world frame]."""
    (offset,) = shown(chunks, "/world/formation", "Transform3D:translation", time_s)
    ((x, y, z, w),) = shown(chunks, "/world/formation", "Transform3D:quaternion", time_s)
    assert (x, y) == (0.0, 0.0)
    cos, sin = w * w - z * z, 2.0 * w * z
    return points @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) + offset


def judged_distance_m(drawn: np.ndarray, tick: Tick) -> float:
    """Return how far the farthest agent's slot, by the judge, is from every drawn point [m]."""
    if tick.time_s < GIVEN_S:
        phase = Phase(Formation(SCENARIO.formation, 1.0), 0.0, path_of(CORNER))
    else:
        phase = Phase(Formation(LINE, 1.0), GIVEN_S, NEW_PATH, MISSION)
    at_points = [
        phase.slot_error(replace(tick, position=np.tile(point, (AGENTS, 1)))) for point in drawn
    ]
    return float(np.min(at_points, axis=0)[tick.alive].max())


@pytest.mark.parametrize("time_s", [0.0, 0.25, 0.6, 0.95, 1.3, 1.75, 2.0, 2.3, 2.65, 3.0, 3.5, 4.0])
def test_slots_are_drawn_where_the_judge_has_them(chunks: list[Chunk], time_s: float) -> None:
    tick = moving_flight()[round(time_s * 20)]
    slots = in_world(chunks, shown(chunks, SLOTS, "Points3D:positions", time_s), time_s)
    assert judged_distance_m(slots, tick) < 1e-3
    assert len(slots) == AGENTS, "a dead agent in the line leaves a gap"


def test_a_frame_turns_its_formation_on_the_spot(chunks: list[Chunk]) -> None:
    poses = values(chunks, "/world/formation", "Transform3D:quaternion")
    turned_deg = [np.degrees(2.0 * np.arctan2(z, w)) for t, ((_, _, z, w),) in poses if t < GIVEN_S]
    assert min(turned_deg) == 0.0
    assert max(turned_deg) == pytest.approx(90.0, abs=1e-3)
    assert any(30.0 < each < 60.0 for each in turned_deg)


@pytest.mark.parametrize("time_s", [0.0, 2.0, GIVEN_S, 2.05, 3.5])
def test_spheres_and_queues_are_those_of_the_slots(chunks: list[Chunk], time_s: float) -> None:
    slots = shown(chunks, SLOTS, "Points3D:positions", time_s)
    spheres = shown(chunks, "/world/formation/arrived", "Ellipsoids3D:centers", time_s)
    np.testing.assert_array_equal(spheres, slots)
    strips = [
        v
        for t, v in values(chunks, "/world/formation/queues", "LineStrips3D:strips")
        if t <= time_s + 1e-9
    ][-1]
    assert len(strips) == (4 if time_s < GIVEN_S else 1)
    curves = np.concatenate([np.array(strip) for strip in strips])
    away = np.linalg.norm(slots[:, None] - curves[None], axis=2)
    assert away.min(axis=1).max() < 0.05


def test_a_new_mission_replaces_the_formation_at_its_time(chunks: list[Chunk]) -> None:
    assert GIVEN_S in [pytest.approx(t) for t, _ in values(chunks, SLOTS, "Points3D:positions")]
    slots = in_world(chunks, shown(chunks, SLOTS, "Points3D:positions", GIVEN_S), GIVEN_S)
    assert np.linalg.norm(slots - np.array([40.0, 0.0, 1.0]), axis=1).min() < 1.0


def without_claims() -> list[Tick]:
    """Ticks of a controller that forms nothing: all agents report distress, having no queue."""
    hierarchy = HierarchyRows(
        tier=np.full(AGENTS, -1, dtype=np.int16),
        parent=np.full(AGENTS, -1, dtype=np.int32),
        role=np.full(AGENTS, DISTRESS, dtype=np.int8),
        record_age_s=np.zeros(AGENTS, dtype=np.float32),
    )
    return [
        replace(tick, place=np.full_like(tick.place, -1), hierarchy=hierarchy)
        for tick in straight_flight(SCENARIO)
    ]


def test_without_claims_there_is_no_formation_and_no_distress(tmp_path: Path) -> None:
    chunks = recorded(tmp_path / "run.rrd", without_claims(), GIVEN)
    assert not [each for each in chunks if each.entity_path.startswith("/world/formation/")]
    assert [v for _, v in values(chunks, "/roles/a0", "StateChange:state")] == [["no place"]]
    names = [v for _, v in values(chunks, "/world/vehicles", "Boxes3D:labels")]
    assert names == [[f"a{agent}" for agent in range(AGENTS)]]
    colours = [v for _, v in values(chunks, "/world/vehicles", "Boxes3D:colors")]
    assert colours == [[int(palette.UNPLACED)] * AGENTS]
    tiers = np.array([v for _, v in values(chunks, "/metrics/tier", "Scalars:scalars")])
    assert np.isnan(tiers).all()


def test_an_agent_without_a_place_in_a_team_that_forms_is_in_distress(tmp_path: Path) -> None:
    ticks = [
        replace(tick, place=flown.place if tick.time_s >= 1.0 else tick.place)
        for tick, flown in zip(without_claims(), straight_flight(SCENARIO), strict=True)
    ]
    chunks = recorded(tmp_path / "run.rrd", ticks)
    states = values(chunks, "/roles/a0", "StateChange:state")
    assert states == [(0.0, ["no place"]), (1.0, ["distress"])]
    assert values(chunks, SLOTS, "Points3D:positions")[0][0] == 1.0


@pytest.mark.parametrize("time_s", [0.0, 0.6, 0.95, 1.3, 2.0, 2.65, 4.0])
def test_queue_curves_move_with_the_frame(chunks: list[Chunk], time_s: float) -> None:
    spec, path = (LINE, NEW_PATH) if time_s >= GIVEN_S else (SCENARIO.formation, path_of(CORNER))
    frame = Track(path).at(time_s)
    rows = values(chunks, "/world/formation/queues", "LineStrips3D:strips")
    strips = [v for t, v in rows if t <= time_s + 1e-9][-1]
    for queue, strip in zip(Formation(spec, 1.0).queues, strips, strict=True):
        drawn = in_world(chunks, np.array(strip), time_s)
        along_m = np.linspace(0.0, np.linalg.norm(drawn[-1] - drawn[0]), len(strip))
        true = np.array([frame.to_world(queue.point(float(at))) for at in along_m])
        np.testing.assert_allclose(drawn, true, atol=1e-4)


def test_agents_on_the_mission_before_keep_their_formation(tmp_path: Path) -> None:
    """The radio keeps a new mission from agents 5 to 8 until 3 s; then all fly it."""
    late = np.arange(AGENTS) >= 5
    ticks = []
    for tick, old in zip(moving_flight(), straight_flight(SCENARIO), strict=True):
        if GIVEN_S < tick.time_s < 3.0:
            mission = np.where(late, 0, MISSION)
            place = np.where(late[:, None], old.place, tick.place)
            ticks.append(replace(tick, mission=mission, place=place))
        else:
            ticks.append(tick)
    chunks = recorded(tmp_path / "run.rrd", ticks, GIVEN)
    drawn = values(chunks, "/world/formation_before/slots", "Points3D:positions")
    times_s = [t for t, _ in drawn]
    assert times_s[0] == pytest.approx(2.05)
    assert len(shown(chunks, "/world/formation_before/slots", "Points3D:positions", 2.9)) == 4
    (offset,) = shown(chunks, "/world/formation_before", "Transform3D:translation", 2.9)
    np.testing.assert_allclose(offset, Track(path_of(CORNER)).at(2.9).origin, atol=1e-4)
    cleared = values(chunks, "/world/formation_before", "Clear:is_recursive")
    assert [t for t, _ in cleared] == [pytest.approx(3.0)]
