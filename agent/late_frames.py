"""Frames of a step that is to take long: they leave with the next one, where steps take no time."""

from netem.wire.channels import Channel

Frames = tuple[tuple[Channel, bytes], ...]
"""Each as (channel, payload)."""


class LateFrames:
    """The frames of one agent's last step, where that step is still to end."""

    def __init__(self) -> None:
        self._held: Frames = ()

    def sent(self, frames: Frames, late: bool) -> Frames:
        """Return what leaves with a step. frames: of this step; late: whether it takes long."""
        held, self._held = self._held, frames if late else ()
        return held if late else held + frames
