"""The keys of a link as a scenario writes them, and the radio's conditions made of them.

The names and units are those of tc-netem and ns-3.
"""

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from netem.wire.frame import AgentId

MIN_RATE_KBIT = 0.001
"""A byte in 8 s; below that a frame would be on the air for longer than any flight."""

Percent = Annotated[float, Meta(ge=0, le=100)]


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table of the radio: unknown keys are refused."""


class GilbertElliott(Table, frozen=True):
    """Losses in bursts, in tc-netem's words (its p, r, 1-h, 1-k).

    A link is good or bad. p_percent: from good to bad, for each frame; r_percent: back, so a burst
    lasts 100 / r_percent frames on average. loss_bad_percent, loss_good_percent: of the frames sent
    while it is one or the other.
    """

    p_percent: Percent
    r_percent: Percent
    loss_bad_percent: Percent = 100.0
    loss_good_percent: Percent = 0.0


class PathLoss(Table, frozen=True):
    """A soft edge: log-distance path loss with log-normal shadowing, drawn for each frame.

    Over d [m] the loss is reference_loss_db + 10 exponent log10(d / reference_distance_m), and no
    less than reference_loss_db. budget_db: the loss at which half of the frames are received;
    shadowing_db: the standard deviation round it.
    """

    exponent: Annotated[float, Meta(gt=0, le=10)]
    reference_loss_db: Annotated[float, Meta(ge=0, le=300)]
    budget_db: Annotated[float, Meta(ge=0, le=300)]
    reference_distance_m: Annotated[float, Meta(gt=0, le=1e6)] = 1.0
    shadowing_db: Annotated[float, Meta(gt=0, le=50)] = 4.0


class LinkKeys(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The keys of a link as a scenario writes them; left out means: as the wider table says."""

    range_m: Annotated[float, Meta(gt=0, le=1e6)] | None = None
    delay_ms: Annotated[float, Meta(ge=0, le=60_000)] | None = None
    jitter_ms: Annotated[float, Meta(ge=0, le=60_000)] | None = None
    delay_correlation_percent: Annotated[float, Meta(ge=0, lt=100)] | None = None
    distribution: Literal["uniform", "normal", "pareto", "paretonormal"] | None = None
    loss_percent: Percent | None = None
    duplicate_percent: Percent | None = None
    corrupt_percent: Percent | None = None
    reorder_percent: Percent | None = None
    rate_kbit: Annotated[float, Meta(ge=MIN_RATE_KBIT, le=1e9)] | None = None
    rate_overhead_b: Annotated[int, Meta(ge=0, le=10_000)] | None = None
    limit: Annotated[int, Meta(ge=1, le=1_000_000)] | None = None
    gemodel: GilbertElliott | None = None
    path_loss: PathLoss | None = None


class DirectedLink(LinkKeys, frozen=True, kw_only=True, rename={"source": "from"}):
    """One directed link's own values."""

    source: AgentId
    to: AgentId


class Conditions(LinkKeys, frozen=True):
    """The radio's conditions: both channels, a channel's own values, a link's own values."""

    local: LinkKeys = LinkKeys()
    multihop: LinkKeys = LinkKeys()
    link: tuple[DirectedLink, ...] = ()
