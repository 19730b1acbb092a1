"""The message frames of a recording file: which part of a truncated file can be read.

A file has 12 bytes of header, and then frames: kind and length, 8 bytes each, and a payload. The
last frame, with 32 bytes of footer after it, is an index. Rerun refuses a file whose last frame is
incomplete, which is what a killed process leaves.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copyfileobj
from struct import Struct
from tempfile import TemporaryDirectory
from typing import BinaryIO, NamedTuple

MAGIC = b"RRF2"
HEADER_B = 12
FOOTER_B = 32
COPY_STEP_B = 1024 * 1024
_FRAME_HEAD = Struct("<QQ")
_INDEX_KIND = 0


class _Frame(NamedTuple):
    """One frame of a file."""

    kind: int
    end: int
    """Its end in the file, with the footer after an index [bytes]."""


def is_recording(path: Path) -> bool:
    """Return whether a file begins as a recording does."""
    with path.open("rb") as file:
        head = file.read(HEADER_B)
    return len(head) == HEADER_B and head.startswith(MAGIC)


def is_finished(path: Path) -> bool:
    """Return whether a recording ends with its index, which its recorder writes last."""
    size = path.stat().st_size
    with path.open("rb") as file:
        return any(frame.kind == _INDEX_KIND for frame in _frames(file, size))


@contextmanager
def readable(path: Path) -> Iterator[Path]:
    """Yield a file that rerun can read: the recording, or a copy without its incomplete frame.

    The copy is deleted afterwards.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        complete = complete_b(file, size)
        if complete == size:
            yield path
            return
        with TemporaryDirectory() as folder:
            copy = Path(folder) / path.name
            file.seek(0)
            with copy.open("wb") as out:
                copyfileobj(file, out, COPY_STEP_B)
                out.truncate(complete)
            yield copy


def complete_b(file: BinaryIO, size: int) -> int:
    """Return the length [bytes] of the part with complete frames, of a file of ``size`` [bytes]."""
    return max((frame.end for frame in _frames(file, size)), default=min(HEADER_B, size))


def _frames(file: BinaryIO, size: int) -> Iterator[_Frame]:
    """Yield the complete frames of a file of ``size`` [bytes], in order."""
    at = HEADER_B
    while at < size:
        file.seek(at)
        head = file.read(_FRAME_HEAD.size)
        if len(head) < _FRAME_HEAD.size:
            return
        kind, length = _FRAME_HEAD.unpack(head)
        at += _FRAME_HEAD.size + length
        if kind == _INDEX_KIND:
            if at + FOOTER_B == size:
                yield _Frame(kind, size)
            return
        if at > size:
            return
        yield _Frame(kind, at)
