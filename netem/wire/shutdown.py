"""When a run is over for one of its processes."""

from netem.wire.bus import Post
from netem.wire.stop import Stop


class Ending:
    """Whether the run is over for this process: it was asked to end, or the world says so."""

    def __init__(self, post: Post, stop: Stop) -> None:
        self._told = False
        self._over = post.ring("over")
        self._stop = stop

    def __call__(self) -> bool:
        """Look, and return whether it is."""
        self._told = self._told or bool(self._over.drain(1))
        return self._told or self._stop.asked
