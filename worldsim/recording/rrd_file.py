"""The frames of a recording file: how far a file that was cut off can be read.

After 12 bytes of header every message is a frame: its kind and its length, each 8 bytes, and its
payload; the last one, and 32 bytes after it, are an index. Rerun refuses a file whose last frame
is not whole; a killed process leaves such a file.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copyfileobj
from struct import Struct as Layout
from tempfile import TemporaryDirectory
from typing import BinaryIO

HEADER_B = 12
FOOTER_B = 32
_FRAME = Layout("<QQ")
_END = 0
_STEP_B = 1024 * 1024


@contextmanager
def readable(path: Path) -> Iterator[Path]:
    """Give a file that rerun can read: the recording, or a copy without the frame cut in two."""
    size = path.stat().st_size
    with path.open("rb") as file:
        whole = whole_b(file, size)
        if whole == size:
            yield path
            return
        with TemporaryDirectory() as folder:
            copy = Path(folder) / path.name
            file.seek(0)
            with copy.open("wb") as out:
                copyfileobj(file, out, _STEP_B)
                out.truncate(whole)
            yield copy


def whole_b(file: BinaryIO, size: int) -> int:
    """Return how many bytes of a recording of ``size`` [bytes] hold whole frames."""
    at = HEADER_B
    while at < size:
        file.seek(at)
        head = file.read(_FRAME.size)
        if len(head) < _FRAME.size:
            return at
        kind, length = _FRAME.unpack(head)
        end = at + _FRAME.size + length
        if kind == _END:
            return size if end + FOOTER_B == size else at
        if end > size:
            return at
        at = end
    return size
