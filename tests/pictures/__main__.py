"""Takes pictures of recordings in the rerun viewer, without a display.

``python -m tests.pictures DIR`` flies the six flights of FLIGHTS and takes three pictures of each.
``python -m tests.pictures RUN.rrd DIR 3,10 [TAB ...]`` takes pictures of a recording at some times
[s], of the tabs that are named: motion (the first, if none is), network, structure, faults.
"""

import sys
from pathlib import Path

from tests.pictures.flights import FLIGHTS, fly
from tests.pictures.viewer import View, take
from worldsim.recording.panels import MOTION


def main(arguments: list[str]) -> None:
    """Take the pictures that the arguments ask for, and print their files."""
    match arguments:
        case [folder]:
            _take_all(Path(folder))
        case [recording, folder, times, *tabs]:
            times_s = [float(each) for each in times.split(",")]
            _take(Path(recording), Path(folder), times_s, tabs or [MOTION])
        case _:
            sys.exit(__doc__)


def _take_all(folder: Path) -> None:
    for name, flight in FLIGHTS.items():
        recording = fly(name, folder / name)
        _take(recording, folder / name, flight.times_s, [flight.tab])


def _take(
    recording: Path, folder: Path, times_s: list[float] | tuple[float, ...], tabs: list[str]
) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    views = [
        View(at_s, tab, folder / f"{tab}-{at_s:06.2f}s.png") for tab in tabs for at_s in times_s
    ]
    take(recording, views)
    for view in views:
        print(view.file, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
