"""Stills and films: drawn without a display, of the times asked for, with the team in view."""

import subprocess
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
import typer
from PIL import Image

import worldsim.results
from tests.small_scenario import SMALL
from worldsim.commands.app import command
from worldsim.commands.results import _times_of
from worldsim.report import film
from worldsim.report.film import FilmError, default_speed, write_film
from worldsim.report.shown import Shown
from worldsim.report.stills import Stills, facts
from worldsim.report.style import drawing
from worldsim.report.views import AZIMUTHS_DEG, ELEVATION_DEG, azimuth_deg, moment_region

MOVING = (
    SMALL
    + """
[frame]
waypoints_m = [[0, 0, 0], [9, 0, 0]]
speed_mps = 0.3
[[event]]
at_s = 2.0
kill = [1]
for_s = 1.0
[expect]
converge = false
"""
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a team that moves, one of whose agents is killed for a while."""
    base = tmp_path_factory.mktemp("run")
    (base / "moving.toml").write_text(MOVING)
    command(["sim", str(base / "moving.toml"), "--out", str(base / "out")])
    return base / "out"


@pytest.fixture(scope="module")
def shown(folder: Path) -> Shown:
    return Shown(worldsim.results.open(folder))


def test_a_still_is_drawn_for_each_time(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "stills"
    assert command(["picture", str(folder), "--at", "1,2.52", "--out", str(out)]) == 0
    files = [out / "0001.00s.png", out / "0002.50s.png"]
    assert capsys.readouterr().out.splitlines() == [str(file) for file in files]
    for file in files:
        picture = matplotlib.image.imread(file)
        assert picture.shape[:2] == (720, 1280)
    assert command(["picture", str(folder), "--at", "1", "--out", str(out)]) == 2
    assert capsys.readouterr().err == f"{out}: exists; nothing is overwritten\n"


def test_a_time_outside_the_run_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(["picture", str(folder), "--at=3,9", "--out", "never"]) == 2
    said = "'3,9'; write times from 0 to 5 s, as 3,10,20"
    assert capsys.readouterr().err == f"qswarm: --at: {said} (see qswarm picture --help)\n"
    assert not Path("never").exists()


@pytest.mark.parametrize("text", ["5.1", "-1", "one", "", "nan", "1,,2"])
def test_a_text_that_is_no_time_of_the_run_is_refused(text: str) -> None:
    assert _times_of("0,2.5,5", 5.0) == [0.0, 2.5, 5.0]
    with pytest.raises(typer.BadParameter):
        _times_of(text, 5.0)


def test_a_still_says_what_goes_on(shown: Shown) -> None:
    during, after = shown.tick_at(2.5), shown.tick_at(4.0)
    assert facts(shown, during)[-2:] == ["1 of 2 agents running", "in force: kill"]
    assert facts(shown, after)[:1] == ["line"]
    assert facts(shown, after)[-1].startswith("nearest pair")
    stills = Stills(shown)
    with drawing():
        stills.draw(during, moment_region(shown, during))
    texts = {text.get_text().strip() for text in stills.figure.axes[0].texts}
    assert texts == {"a0", "a1"}
    assert [axes.get_title(loc="left") for axes in stills.figure.axes[1:3]] == [
        "from above",
        "from the side",
    ]
    assert {text.get_text() for text in stills.figure.texts} >= {"small", "2.5 s"}


@pytest.mark.parametrize("time_s", [0.0, 2.0, 5.0])
def test_the_team_is_in_view_at_every_time(shown: Shown, time_s: float) -> None:
    row = shown.tick_at(time_s)
    centres, size = film._view(shown)
    for centre, extent in (moment_region(shown, row), (centres[row], size)):
        assert (np.abs(shown.position[row] - centre) <= 0.5 * extent).all()
    assert shown.position[-1, 0, 0] > 1.0  # it moves, and the view with it
    assert centres[-1, 0] > centres[0, 0] + 0.5


def test_a_film_has_ten_frames_a_second(shown: Shown, tmp_path: Path) -> None:
    file = tmp_path / "film.gif"
    write_film(shown, file, 10.0, lambda _: None)
    with Image.open(file) as gif:
        assert gif.n_frames == 6  # type: ignore[attr-defined]
        assert gif.info["duration"] == 100
    assert [each.name for each in tmp_path.iterdir()] == ["film.gif"]
    assert default_speed(shown) == 1.0


def test_a_film_is_an_mp4_that_players_show(
    shown: Shown, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(film.shutil, "which", lambda _: None)
    assert film.film_suffix() == ".mp4"  # by the package alone
    file = tmp_path / "film.mp4"
    write_film(shown, file, 10.0, lambda _: None)
    decoder = [film._ffmpeg(), "-i", file, "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    decoded = subprocess.run(decoder, check=True, capture_output=True)
    assert b"Video: h264" in decoded.stderr
    assert b"yuv420p" in decoded.stderr
    frames = np.frombuffer(decoded.stdout, dtype=np.uint8).reshape(6, 720, 1280)
    assert np.ptp(frames, axis=(1, 2)).min() > 100  # something is drawn


def test_an_interrupted_film_leaves_nothing(shown: Shown, tmp_path: Path) -> None:
    def interrupt(text: str) -> None:
        if "frame 3" in text:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_film(shown, tmp_path / "film.gif", 10.0, interrupt)
    assert list(tmp_path.iterdir()) == []


def test_a_film_that_cannot_be_written_says_why(
    shown: Shown, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(film, "_ffmpeg", lambda: None)
    assert film.film_suffix() == ".gif"
    with pytest.raises(FilmError, match=r"needs ffmpeg: pip install"):
        write_film(shown, tmp_path / "film.mp4", 10.0, lambda _: None)
    with pytest.raises(FilmError, match=r"\.avi: a film is \.mp4 or \.gif"):
        write_film(shown, tmp_path / "film.avi", 10.0, lambda _: None)
    assert list(tmp_path.iterdir()) == []


def test_the_view_is_one_in_which_no_vehicle_hides_another() -> None:
    first = AZIMUTHS_DEG[0]
    apart = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0]])
    assert azimuth_deg(apart) == first
    around, up = np.radians(first), np.radians(ELEVATION_DEG)
    sight = [np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)]
    assert azimuth_deg(np.array([[0.0, 0.0, 0.0], sight])) != first
    assert azimuth_deg(np.full((3, 3), np.nan)) == first
