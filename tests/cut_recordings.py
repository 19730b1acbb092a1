"""Recordings that were cut off, as by a kill of the process that recorded."""

from pathlib import Path

from worldsim.recording.rrd_file import _frames


def cut(file: Path, share: float) -> bytes:
    """Return the first part of a recording, with this share of its frames and some of the next."""
    content = file.read_bytes()
    with file.open("rb") as opened:
        ends = [frame.end for frame in _frames(opened, len(content))]
    return content[: ends[int(share * len(ends))] + 20]
