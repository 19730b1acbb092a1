"""The recording's layout is a contract: other tools rely on these entities and timelines."""

import pytest
from rerun.chunk import Chunk, RrdReader

from tests.recording.flights import record, straight_flight, wedge
from worldsim.judge.run_events import Killed, QueueChanged, SlotChanged
from worldsim.recording.recorder import RunRecorder

AGENTS = 9


@pytest.fixture(scope="module")
def chunks(tmp_path_factory: pytest.TempPathFactory) -> list[Chunk]:
    path = tmp_path_factory.mktemp("layout") / "run.rrd"
    scenario = wedge(AGENTS, duration_s=2.0)
    recorder = RunRecorder(path, scenario, "layout", mode="virtual")
    recorder.event(Killed(t_s=0.5, agent=4, planned=True))
    recorder.event(SlotChanged(t_s=0.5125, agent=4, place=(2, 1), before=None))
    recorder.event(QueueChanged(t_s=0.5125, agent=4, queue=2))
    record(recorder, scenario, list(straight_flight(scenario)))
    return list(RrdReader(path).stream())


@pytest.mark.parametrize(
    ("entity", "component", "rows"),
    [
        ("/world/agents", "Points3D:positions", AGENTS),
        ("/world/vehicles", "Boxes3D:centers", AGENTS),
        ("/world/vehicles", "Boxes3D:quaternions", AGENTS),
        ("/world/targets", "Points3D:positions", AGENTS),
        ("/world/formation/slots", "Points3D:positions", AGENTS),
        ("/world/links", "LineStrips3D:strips", AGENTS * (AGENTS - 1) // 2),
        ("/metrics/force", "Scalars:scalars", AGENTS),
        ("/metrics/separation", "Scalars:scalars", AGENTS),
        ("/metrics/slot_error", "Scalars:scalars", AGENTS),
        ("/metrics/turn_deg", "Scalars:scalars", AGENTS),
        ("/metrics/packets/sent", "Scalars:scalars", 1),
        ("/metrics/packets/dropped_loss", "Scalars:scalars", 1),
        ("/log/events", "TextLog:text", 1),
    ],
)
def test_entities_hold_one_row_for_each_agent(
    chunks: list[Chunk], entity: str, component: str, rows: int
) -> None:
    batches = [
        chunk.to_record_batch()
        for chunk in chunks
        if chunk.entity_path == entity and not chunk.is_static
    ]
    having = [batch for batch in batches if component in batch.schema.names]
    assert having
    assert {len(row) for batch in having for row in batch.column(component).to_pylist()} == {rows}
    for batch in having:
        assert {"sim_time", "tick"} <= set(batch.schema.names)
        assert not {"log_time", "log_tick"} & set(batch.schema.names)


def test_each_second_of_an_entity_is_one_chunk(chunks: list[Chunk]) -> None:
    rows = [
        chunk.num_rows
        for chunk in chunks
        if chunk.entity_path == "/metrics/force" and not chunk.is_static
    ]
    assert rows == [20, 20, 1]


def test_series_are_named_after_their_agents(chunks: list[Chunk]) -> None:
    names = [
        chunk.to_record_batch().column("SeriesLines:names").to_pylist()
        for chunk in chunks
        if chunk.entity_path == "/metrics/force" and "SeriesLines:names" in str(chunk)
    ]
    assert names == [[[f"a{agent}" for agent in range(AGENTS)]]]


def test_events_are_sentences_with_their_time_by_what_they_matter(chunks: list[Chunk]) -> None:
    (log,) = [chunk.to_record_batch() for chunk in chunks if chunk.entity_path == "/log/events"]
    assert log.column("TextLog:text").to_pylist() == [
        ["0.50 s  a4 is killed; its vehicle hovers (scheduled)"],
        ["0.51 s  a4 takes slot 2 of queue Q2"],
        ["0.51 s  a4 enters queue Q2"],
    ]
    assert log.column("TextLog:level").to_pylist() == [["WARN"], ["INFO"], ["DEBUG"]]
    assert log.column("tick").to_pylist() == [10, 10, 10]
