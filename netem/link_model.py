"""The model of one directed link: a value for every parameter, and what follows from the values."""

from math import inf
from typing import Final, Never

from msgspec.structs import force_setattr

from netem.link_parameters import DEFAULTS, LinkParameters, PathLoss

EDGE_SIGMAS: Final = 6.0
"""A frame whose loss is this many shadowing_db over the budget is never received (1 in 10^9)."""


class LinkModel(LinkParameters[Never], frozen=True):
    """A link with a value for every parameter, and what follows from the values."""

    own_rate: bool = False
    """Whether the link has a queue of its own instead of the sender's."""

    draws: bool = False
    """Whether a verdict needs random numbers."""
    plain: bool = False
    """Whether the link has no more than loss and uniform jitter, and no state."""
    remembers: bool = False
    """Whether the link needs a LinkState."""
    reach_m: float = inf
    """Distance beyond which no frame is received [m]."""
    clean_delay_s: float = 0.0
    """The delay within range where no numbers are needed [s]."""

    def __post_init__(self) -> None:
        for key, default in DEFAULTS.items():
            if getattr(self, key) is None:
                force_setattr(self, key, default)
        rare = self.duplicate_percent + self.corrupt_percent + self.reorder_percent > 0.0
        shaped = self.delay_correlation_percent > 0.0 or self.distribution != "uniform"
        jittery = self.jitter_ms > 0.0
        bursts, soft = self.gemodel is not None, self.path_loss is not None
        plain = not (rare or bursts or soft or self.own_rate or (jittery and shaped))
        force_setattr(self, "plain", plain)
        force_setattr(self, "draws", jittery or self.loss_percent > 0.0 or not plain)
        correlated = jittery and self.delay_correlation_percent > 0.0
        force_setattr(self, "remembers", bursts or self.own_rate or correlated)
        force_setattr(self, "reach_m", min(self.range_m, path_loss_reach_m(self.path_loss)))
        force_setattr(self, "clean_delay_s", self.delay_ms / 1000.0)


def path_loss_reach_m(edge: PathLoss | None) -> float:
    """Return the distance [m] beyond which a soft edge lets no frame through."""
    if edge is None:
        return inf
    room_db = edge.budget_db + EDGE_SIGMAS * edge.shadowing_db - edge.reference_loss_db
    decades = min(12.0, room_db / (10.0 * edge.exponent))
    return edge.reference_distance_m * 10.0**decades if room_db > 0.0 else 0.0
