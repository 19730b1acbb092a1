"""Two recordings side by side: each whole, below a root of its own, on one time line."""

from pathlib import Path

import numpy as np
import pytest

from tests.pictures.scene import Scenes
from tests.recording.flights import record, straight_flight, wedge
from worldsim.recording import layout
from worldsim.recording.recorder import RunRecorder
from worldsim.recording.side_by_side import ROOTS, joined, names


def recorded(folder: Path, agents: int) -> Path:
    """A recording of so many agents, in a run's folder."""
    folder.mkdir(parents=True)
    scenario = wedge(agents, duration_s=1.0)
    path = folder / "run.rrd"
    recorder = RunRecorder(path, scenario, folder.name, mode="virtual")
    record(recorder, scenario, list(straight_flight(scenario)))
    return path


@pytest.fixture
def two(tmp_path: Path) -> list[Path]:
    return [recorded(tmp_path / "clean", 2), recorded(tmp_path / "lossy", 3)]


def test_each_is_whole_below_its_own_root(two: list[Path]) -> None:
    with joined(two) as shown:
        (both,) = shown
        together = Scenes(both).at(0.5)
    for root, path in zip(ROOTS, two, strict=True):
        alone = Scenes(path).at(0.5)
        for entity, component in (
            (layout.VEHICLES, "Boxes3D:centers"),
            (layout.TEAM, "Transform3D:translation"),
            (layout.SEPARATION, "Scalars:scalars"),
        ):
            assert alone.values(entity, component)
            np.testing.assert_array_equal(
                together.values(root + entity, component), alone.values(entity, component)
            )
        assert together.text(root + layout.SCENARIO) == alone.text(layout.SCENARIO)


def test_another_number_and_damaged_ones_stay_apart(two: list[Path], tmp_path: Path) -> None:
    three = [*two, two[0]]
    for recordings in (two[:1], three):
        with joined(recordings) as shown:
            assert shown == recordings
    foreign = tmp_path / "foreign.rrd"
    foreign.write_bytes(b"RRF2" + bytes(range(60)))
    with joined([two[0], foreign]) as shown:
        assert shown == [two[0], foreign]


def test_runs_are_named_by_their_folders(tmp_path: Path) -> None:
    runs = [tmp_path / name / "run.rrd" for name in ("a/wedge", "b/wedge", "b/lossy")]
    assert names([runs[0], runs[2]]) == ["wedge", "lossy"]
    assert names(runs[:2]) == ["a/wedge", "b/wedge"]
    assert names([runs[0], runs[0].with_name("old.rrd")]) == ["run.rrd", "old.rrd"]
