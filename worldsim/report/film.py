"""A film of a run: its stills one after the other, as MP4 where there is an ffmpeg, or as GIF."""

import shutil
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter

from worldsim.report.shown import Shown
from worldsim.report.stills import DPI, Stills
from worldsim.report.style import drawing
from worldsim.report.views import Region, moment_region, region_of
from worldsim.truth.vehicle import Floats

FPS = 10
LONGEST_S = 20.0
"""Without a speed, a film lasts no longer [s]."""
STEADY_S = 1.0
"""The view follows the mean of the team over so long before and after [s]."""
SAMPLES = 40
"""Of so many ticks, trails and slots decide how much the view shows; of all, the vehicles do."""
MARGIN_M = 0.4
GIF, MP4 = ".gif", ".mp4"
GIF_DPI = 64
"""Of a GIF, which compresses little."""


class FilmError(Exception):
    """A film cannot be made; one line that says why."""


def film_suffix() -> str:
    """Return the best kind of film that this host can write."""
    return MP4 if _ffmpeg() is not None else GIF


def _ffmpeg() -> str | None:
    """Return the ffmpeg of this host, or else that of the package imageio-ffmpeg; None: neither."""
    if (installed := shutil.which("ffmpeg")) is not None:
        return installed
    if find_spec("imageio_ffmpeg") is None:
        return None
    try:
        program: str = import_module("imageio_ffmpeg").get_ffmpeg_exe()
    except RuntimeError:  # a package without a program for this host
        return None
    return program


def default_speed(shown: Shown) -> float:
    """Return how many simulated seconds a second of a film shows, if nobody says it."""
    return max(1.0, shown.until_s / LONGEST_S)


def write_film(shown: Shown, file: Path, speed: float, progress: Callable[[str], None]) -> None:
    """Write a film; the suffix of its file says which kind. speed: simulated s in a second.

    Raises FilmError where that kind cannot be written, and OSError.
    """
    writer = _writer(file.suffix)
    step_s = speed / FPS
    times_s = np.arange(0.0, shown.until_s + 0.5 * step_s, step_s)
    rows = [shown.tick_at(time_s) for time_s in times_s.tolist()]
    centres, size = _view(shown)
    draft = file.with_name(f".draft-{file.name}")
    try:
        with drawing():
            stills = Stills(shown)
            dpi = GIF_DPI if file.suffix == GIF else DPI
            with writer.saving(stills.figure, str(draft), dpi):
                for count, row in enumerate(rows):
                    progress(f"{shown.scenario.name}: frame {count + 1} of {len(rows)}")
                    stills.draw(row, Region(centres[row], size))
                    writer.grab_frame()
        draft.rename(file)
    finally:
        draft.unlink(missing_ok=True)


def _writer(suffix: str) -> AbstractMovieWriter:
    if suffix == GIF:
        return PillowWriter(fps=FPS)
    if suffix != MP4:
        raise FilmError(f"{suffix or 'no suffix'}: a film is {MP4} or {GIF}")
    program = _ffmpeg()
    if program is None:
        how = f"{MP4} needs ffmpeg: pip install 'qswarm[video]'; {GIF} needs nothing more"
        raise FilmError(how)
    matplotlib.rcParams["animation.ffmpeg_path"] = program
    # H.264 in this form is what browsers and players show.
    return FFMpegWriter(fps=FPS, codec="h264", bitrate=2400, extra_args=["-pix_fmt", "yuv420p"])


def _view(shown: Shown) -> tuple[Floats, Floats]:
    """Return where the view's centre is at each tick (T, 3) [m], and its size (3,) [m].

    The view moves with the team, steadily, and shows it whole at every time.
    """
    every = [region_of(position) for position in shown.position]
    centres = np.array([region.centre for region in every])
    half = max(1, round(STEADY_S * shown.scenario.fleet.tick_hz))
    padded = np.concatenate((centres[:1].repeat(half, 0), centres, centres[-1:].repeat(half, 0)))
    sums = np.concatenate((np.zeros((1, 3)), np.cumsum(padded, axis=0)))
    width = 2 * half + 1
    steady: Floats = (sums[width:] - sums[:-width]) / width
    step = max(1, len(every) // SAMPLES)
    shown_whole = [moment_region(shown, row) for row in range(0, len(every), step)]
    sizes = [
        region.size + 2.0 * np.abs(region.centre - steady[row])
        for region, row in zip(shown_whole, range(0, len(every), step), strict=True)
    ]
    away = np.abs(shown.position - steady[:, None, :]).reshape(-1, 3)
    vehicles = 2.0 * (np.nanmax(away, axis=0, initial=0.0) + MARGIN_M)
    return steady, np.max([*sizes, vehicles], axis=0)
