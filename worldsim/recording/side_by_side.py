"""Two recordings as one, each below a root of its own, so that a viewer shows them side by side.

``python -m worldsim.recording.side_by_side OUT ONE OTHER`` does it in a process of its own: rerun's
reader ends its process on some damaged files.
"""

import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from warnings import catch_warnings, simplefilter

import rerun as rr
from rerun.chunk import Chunk, RrdReader
from rerun.error_utils import RerunWarning

from worldsim.recording.blueprint import blueprint_of_two
from worldsim.recording.recorder import APPLICATION
from worldsim.recording.rrd_file import readable

PROPERTIES = "/__properties"
ROOTS = ("/one", "/other")
BATCH = 256
"""Chunks that are passed on at once."""


@contextmanager
def joined(recordings: Sequence[Path]) -> Iterator[list[Path]]:
    """Yield two recordings as one; any other number, or damaged ones, as they are."""
    with TemporaryDirectory(prefix="qswarm-beside-") as folder:
        both = Path(folder) / "both.rrd"
        could = len(recordings) == len(ROOTS) and _could_join(recordings, both)
        yield [both] if could else list(recordings)


def _could_join(recordings: Sequence[Path], out: Path) -> bool:
    command = [sys.executable, "-P", "-m", __name__, str(out), *map(str, recordings)]
    return subprocess.run(command, check=False, capture_output=True).returncode == 0


def names(recordings: Sequence[Path]) -> list[str]:
    """Return a name for each recording: its folder's, and more of its path where needed."""
    folders = [recording.resolve().parent.parts for recording in recordings]
    for length in range(1, max(map(len, folders)) + 1):
        found = ["/".join(parts[-length:]) for parts in folders]
        if len(set(found)) == len(found):
            return found
    return [recording.name for recording in recordings]


def _join(out: Path, recordings: Sequence[Path]) -> None:
    roots = dict(zip(names(recordings), ROOTS, strict=True))
    stream = rr.RecordingStream(APPLICATION)
    stream.set_sinks(rr.FileSink(out), default_blueprint=blueprint_of_two(roots))
    stream.send_recording_name(" beside ".join(roots))
    for root, recording in zip(ROOTS, recordings, strict=True):
        for batch in _batches(_below(root, recording)):
            rr.send_chunks(batch, recording=stream)
    stream.flush()
    stream.disconnect()


def _below(root: str, recording: Path) -> Iterator[Chunk]:
    """Yield the chunks of a recording with a root before their entities."""
    with readable(recording) as file, catch_warnings():
        simplefilter("ignore", RerunWarning)
        for chunk in RrdReader(file).stream():
            if not chunk.entity_path.startswith(PROPERTIES):
                yield chunk.with_entity_path(root + chunk.entity_path)


def _batches(chunks: Iterator[Chunk]) -> Iterator[list[Any]]:
    batch: list[Any] = []
    for chunk in chunks:
        batch.append(chunk)
        if len(batch) == BATCH:
            yield batch
            batch = []
    if batch:
        yield batch


if __name__ == "__main__":
    _join(Path(sys.argv[1]), [Path(each) for each in sys.argv[2:]])
