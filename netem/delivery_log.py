"""The delivery log: the verdict on every frame, receiver by receiver, and a digest of them all.

The log has a page for each receiver. Shards of the medium, each with some of the receivers,
together write the pages of one medium, so all pages of a slot give the same digest. A frame whose
receiver is out of reach has no entry: that follows from the positions.
"""

from collections.abc import Iterable, Mapping
from hashlib import sha256
from struct import Struct as Layout
from typing import Final

import numpy as np
from numpy.typing import NDArray

HEAD: Final = Layout("<4q").pack
"""Packs a frame's key: source, incarnation, channel, count."""
FATE: Final = Layout("<BBdd").pack
"""Packs a verdict: copy (1 for a duplicate, else 0), cause, delay [s], place of the flipped bit."""
WHOLE: Final = Layout("<4qBBdd").pack
"""Packs both: HEAD and FATE."""
ENTRY = np.dtype(
    [(name, "<i8") for name in ("source", "incarnation", "channel", "count")]
    + [("copy", "u1"), ("cause", "u1"), ("delay_s", "<f8"), ("flipped_at", "<f8")]
)
"""One entry of a page: HEAD and FATE."""


class Digest:
    """One digest over the pages of all slots."""

    def __init__(self) -> None:
        self._hash = sha256()

    def update(self, pages: Iterable[bytes]) -> None:
        """Add the pages of a slot, or their entries, in order of the receivers' ids."""
        self._hash.update(b"".join(pages))

    @property
    def value(self) -> bytes:
        """The digest of all that was added."""
        return self._hash.digest()


class DeliveryLog:
    """The pages of the present slot, row i = receiver i.

    A page is a list to which the medium appends: entries, or pieces of them.
    """

    def __init__(self, agents: int) -> None:
        self.pages: list[list[bytes]] = [[] for _ in range(agents)]
        self._digest = Digest()

    def digest(self) -> bytes:
        """End a slot: return the digest of all slots so far."""
        self._digest.update([entry for page in self.pages for entry in page])
        self._clear()
        return self._digest.value

    def take_pages(self) -> Mapping[int, bytes]:
        """End a slot of a shard: return its pages by receiver, without the empty ones."""
        taken = {receiver: b"".join(page) for receiver, page in enumerate(self.pages) if page}
        self._clear()
        return taken

    def _clear(self) -> None:
        for page in self.pages:
            if page:
                page.clear()


def joined_pages(shards: Iterable[Mapping[int, bytes]]) -> list[bytes]:
    """Return the pages of a slot from all shards, in order of the receivers' ids."""
    pages = {receiver: page for shard in shards for receiver, page in shard.items()}
    return [pages[receiver] for receiver in sorted(pages)]


def entries(page: bytes) -> NDArray[np.void]:
    """Return the entries of a page as a structured array (n,) of ENTRY, in order."""
    return np.frombuffer(page, dtype=ENTRY)
