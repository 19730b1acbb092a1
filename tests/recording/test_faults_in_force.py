"""What is in force is in the picture while it is in force, and gone when it is over."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from rerun.chunk import Chunk, RrdReader

from netem.faults import Jam
from netem.link_parameters import Conditions
from tests.recording.flights import record, straight_flight, wedge
from worldsim.judge.radio_events import Healed, Jammed, Partitioned
from worldsim.judge.run_events import Killed, Paused, PoseChanged, Resumed, RunEvent
from worldsim.judge.tick import Tick
from worldsim.recording import layout, palette
from worldsim.recording.link_columns import hears_of, missing_links
from worldsim.recording.recorder import RunRecorder
from worldsim.recording.situation import Situations

AGENTS = 4
SCENARIO = msgspec.structs.replace(wedge(AGENTS, duration_s=4.0), netem=Conditions(range_m=3.0))
JAM = Jam((1.0, 2.0, 3.0), 1.5)
GROUPS = ((0, 1),)
EVENTS: list[RunEvent] = [
    Jammed(t_s=0.5, agent=None, planned=True, number=1, jam=JAM),
    Partitioned(
        t_s=1.0, agent=None, planned=True, number=2, groups=GROUPS, parted="clean", bridge=()
    ),
    Killed(t_s=1.5, agent=3, planned=True),
    Paused(t_s=1.5, agent=2, planned=True),
    PoseChanged(t_s=1.5, agent=1, planned=True, number=3, bias_m=(0.1, 0.0, 0.0)),
    Jammed(t_s=2.0, agent=None, planned=True, number=1, jam=None),
    Healed(t_s=2.5, agent=None, planned=True, number=2),
    Resumed(t_s=3.0, agent=2, planned=True),
    PoseChanged(t_s=3.0, agent=1, planned=True, number=3, ends=True),
]


def flight() -> list[Tick]:
    stopped = {3: (1.5, 9.0), 2: (1.5, 3.0)}
    rows = []
    for tick in straight_flight(SCENARIO):
        off = [at for at, (since, to) in stopped.items() if since <= tick.time_s < to]
        rows.append(replace(tick, alive=~np.isin(np.arange(AGENTS), off)))
    return rows


@pytest.fixture(scope="module")
def chunks(tmp_path_factory: pytest.TempPathFactory) -> list[Chunk]:
    path: Path = tmp_path_factory.mktemp("faults") / "run.rrd"
    recorder = RunRecorder(path, SCENARIO, "faults", mode="virtual")
    for event in EVENTS:
        recorder.event(event)
    record(recorder, SCENARIO, flight())
    return list(RrdReader(path).stream())


def shown(chunks: list[Chunk], entity: str, component: str, time_s: float) -> list[object]:
    """Return what a viewer shows of a component at a time [s]: its latest value."""
    rows = []
    for chunk in chunks:
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and not chunk.is_static and component in batch.schema.names:
            times = [each.total_seconds() for each in batch.column("sim_time").to_pylist()]
            rows += list(zip(times, batch.column(component).to_pylist(), strict=True))
    # A null leaves what was shown before.
    given = sorted((row for row in rows if row[1] is not None), key=lambda row: row[0])
    before = [row for row in given if row[0] <= time_s + 1e-9]
    return before[-1][1] if before else []


@pytest.mark.parametrize(
    ("entity", "component", "counts"),
    [
        (layout.JAMS, "Ellipsoids3D:centers", (0, 1, 1, 1, 0, 0, 0)),
        (layout.SIDES, "Ellipsoids3D:centers", (0, 0, 4, 4, 4, 0, 0)),
        (layout.DEAD, "LineStrips3D:strips", (0, 0, 0, 1, 1, 1, 1)),
        (layout.PAUSED, "Boxes3D:centers", (0, 0, 0, 1, 1, 1, 0)),
    ],
)
def test_a_fault_is_shown_from_its_start_to_its_end(
    chunks: list[Chunk], entity: str, component: str, counts: tuple[int, ...]
) -> None:
    times_s = (0.45, 0.5, 1.2, 1.7, 2.2, 2.7, 3.2)
    assert [len(shown(chunks, entity, component, at)) for at in times_s] == list(counts)


def test_a_jam_is_drawn_where_it_is(chunks: list[Chunk]) -> None:
    assert shown(chunks, layout.JAMS, "Ellipsoids3D:centers", 1.0) == [[1.0, 2.0, 3.0]]
    assert shown(chunks, layout.JAMS, "Ellipsoids3D:half_sizes", 1.0) == [[1.5, 1.5, 1.5]]


def test_sides_have_a_colour_each_and_move_with_the_vehicles(chunks: list[Chunk]) -> None:
    colours = shown(chunks, layout.SIDES, "Ellipsoids3D:colors", 2.0)
    assert colours == palette.SIDES[[0, 0, 1, 1]].tolist()
    centres = shown(chunks, layout.SIDES, "Ellipsoids3D:centers", 1.25)
    vehicles = shown(chunks, layout.VEHICLES, "Boxes3D:centers", 1.25)
    assert centres == vehicles


def test_a_paused_vehicle_is_hollow_and_a_dead_one_black(chunks: list[Chunk]) -> None:
    sizes = np.array(shown(chunks, layout.VEHICLES, "Boxes3D:half_sizes", 2.0))
    assert [bool(each.any()) for each in sizes] == [True, True, False, True]
    assert np.array(shown(chunks, layout.VEHICLES, "Boxes3D:half_sizes", 3.5)).all()
    assert shown(chunks, layout.VEHICLES, "Boxes3D:colors", 2.0)[3] == int(palette.DEAD)


def test_labels_say_what_is_wrong(chunks: list[Chunk]) -> None:
    assert shown(chunks, layout.VEHICLES, "Boxes3D:labels", 2.0) == [
        *("a0 (side A)", "a1 (wrong pose, side A)", "a2 (paused, side B)"),
        "",
    ]
    assert shown(chunks, layout.DEAD, "LineStrips3D:labels", 2.0) == ["a3 (dead)"]
    assert shown(chunks, layout.VEHICLES, "Boxes3D:labels", 3.5)[:3] == ["a0", "a1", "a2"]


def missing(links: list[tuple[int, int]], *events: RunEvent) -> dict[str, set[tuple[int, int]]]:
    """Return the pairs of agents at x = 0, 1, 2 and 9 m without a link both ways, by entity.

    links: (hearer, heard). Their range is 3 m.
    """
    x = (0.0, 1.0, 2.0, 9.0)
    tick = replace(
        flight()[0],
        position=np.array([[each, 0.0, 0.0] for each in x]),
        links=np.array(links, dtype=np.int32).reshape(-1, 2),
    )
    situations = Situations(AGENTS, SCENARIO.netem)
    for event in events:
        situations.handle_event(event)
    found = missing_links(tick, situations.at(replace(tick, time_s=9.0)), hears_of([tick])[0])
    return {
        entity: {(one, other) for one, other in pairs.tolist()} for entity, pairs in found.items()
    }


ALL_NEAR = [(a, b) for a in range(3) for b in range(3) if a != b]
FAR = {(0, 3), (1, 3), (2, 3)}


def test_pairs_are_told_apart_by_why_they_do_not_hear() -> None:
    assert missing(ALL_NEAR) == {
        layout.LINKS_CUT: set(),
        layout.LINKS_LOST: set(),
        layout.LINKS_OUT_OF_RANGE: FAR,
    }
    one_way = [link for link in ALL_NEAR if link not in {(0, 1), (1, 2), (2, 1)}]
    assert missing(one_way)[layout.LINKS_LOST] == {(0, 1), (1, 2)}
    parted = [(0, 1), (1, 0)]
    found = missing(parted, EVENTS[1])
    assert found[layout.LINKS_CUT] == {(0, 2), (1, 2)}
    assert (found[layout.LINKS_LOST], found[layout.LINKS_OUT_OF_RANGE]) == (set(), FAR)
    jam = Jammed(t_s=0.5, agent=None, planned=True, number=1, jam=Jam((0.0, 0.0, 0.0), 0.5))
    assert missing([(1, 2), (2, 1)], jam)[layout.LINKS_CUT] == {(0, 1), (0, 2)}
