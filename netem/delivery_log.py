"""The journal: what became of every frame, receiver by receiver, and one digest of it all.

A page for each receiver, so that shards of the medium, each with some of the receivers, have
together the pages of one medium with all of them: whoever has all pages of a slot has its digest.
Frames for whom their receiver was out of reach are not noted: that follows from the positions.
"""

from collections.abc import Iterable, Mapping
from hashlib import sha256
from struct import Struct as Layout

import numpy as np
from numpy.typing import NDArray

HEAD = Layout("<4q").pack
"""A frame's key: source, incarnation, channel, count."""
FATE = Layout("<BBdd").pack
"""Its fate: copy (0, or 1 for a duplicate), cause, delay [s], and the share of the bit turned."""
ENTRY = np.dtype(
    [(name, "<i8") for name in ("source", "incarnation", "channel", "count")]
    + [("copy", "u1"), ("cause", "u1"), ("delay_s", "<f8"), ("turned", "<f8")]
)


class Digest:
    """One digest over slot after slot of pages."""

    def __init__(self) -> None:
        self._hash = sha256()

    def take(self, pages: Iterable[bytes | bytearray]) -> None:
        """Take the pages of a slot, in order of the receivers' ids."""
        self._hash.update(b"".join(pages))

    @property
    def value(self) -> bytes:
        """The digest so far."""
        return self._hash.digest()


class DeliveryLog:
    """``pages``: what was noted for each agent since the last slot's end; whoever notes adds."""

    def __init__(self, agents: int) -> None:
        self.pages = [bytearray() for _ in range(agents)]
        self._digest = Digest()

    def digest(self) -> bytes:
        """End a slot: return the digest of all that was noted by now."""
        self._digest.take(self.pages)
        self._clear()
        return self._digest.value

    def torn_out(self) -> Mapping[int, bytes]:
        """End a slot of a shard: return its pages by receiver, those left out that are empty."""
        torn = {receiver: bytes(page) for receiver, page in enumerate(self.pages) if page}
        self._clear()
        return torn

    def _clear(self) -> None:
        for page in self.pages:
            page.clear()


def joined(shards: Iterable[Mapping[int, bytes]]) -> list[bytes]:
    """Return the pages of a slot from all shards, in order of the receivers' ids."""
    pages = {receiver: page for shard in shards for receiver, page in shard.items()}
    return [pages[receiver] for receiver in sorted(pages)]


def entries(page: bytes) -> NDArray[np.void]:
    """Return what a page holds as a structured array, an ENTRY each, in order."""
    return np.frombuffer(page, dtype=ENTRY)
