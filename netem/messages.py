"""What the world tells the medium: the conditions, each slot the true positions, and orders."""

from typing import Annotated

import msgspec
from msgspec import Meta

from netem.wire.frame import AgentId, Count

Metres = Annotated[float, Meta(ge=-1e6, le=1e6)]
Position = tuple[Metres, Metres, Metres]

MAX_TRUTH_B = 256 * 1024
MAX_CONDITIONS_B = 1024 * 1024
MAX_ORDERS_B = 1024 * 1024


class LinkKeys(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The keys of a link as a scenario writes them; left out means: as the wider table says."""

    range_m: Annotated[float, Meta(gt=0, le=1e6)] | None = None
    delay_ms: Annotated[float, Meta(ge=0, le=60_000)] | None = None
    jitter_ms: Annotated[float, Meta(ge=0, le=60_000)] | None = None
    loss_percent: Annotated[float, Meta(ge=0, le=100)] | None = None


class DirectedLink(LinkKeys, frozen=True, kw_only=True, rename={"source": "from"}):
    """One directed link's own values."""

    source: AgentId
    to: AgentId


class Conditions(LinkKeys, frozen=True):
    """The radio's conditions: both channels, a channel's own values, a link's own values."""

    local: LinkKeys = LinkKeys()
    multihop: LinkKeys = LinkKeys()
    link: tuple[DirectedLink, ...] = ()


Groups = tuple[tuple[AgentId, ...], ...]
"""Who hears whom in a partition; the agents that no group names form one more."""


class Changed(msgspec.Struct, frozen=True, tag="change", forbid_unknown_fields=True):
    """From now on the radio is under other conditions, all of them given anew."""

    conditions: Conditions


class Parted(msgspec.Struct, frozen=True, tag="partition", forbid_unknown_fields=True):
    """From now on agents hear only those of their own group."""

    groups: Groups


class Healed(msgspec.Struct, frozen=True, tag="heal", forbid_unknown_fields=True):
    """From now on there are no groups."""


RadioOrder = Changed | Parted | Healed
"""What the medium does between slots."""


class Orders(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Orders to carry out, one after the other, before a slot."""

    slot: Count
    orders: tuple[RadioOrder, ...]


class MediumSetup(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All that a medium needs to begin; ``speed``: simulated seconds in one of the wall clock."""

    seed: Count
    agents: Annotated[int, Meta(ge=1, lt=2**16)]
    slots_per_tick: Annotated[int, Meta(ge=1, le=64)]
    slot_hz: Annotated[float, Meta(gt=0, le=1e5)]
    conditions: Conditions
    speed: Annotated[float, Meta(gt=0, le=1e4)] = 1.0


class Truth(msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """Where the vehicles truly are at the start of a slot.

    positions: row i = agent i [m; world frame], None where no radio is: the agent has no vehicle in
    the world, or its process is gone.
    """

    slot: Count
    time_s: Annotated[float, Meta(ge=0, le=1e9)]
    positions: tuple[Position | None, ...]


class Verdicts(msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """What the medium reports: how many frames met which fate so far, and a digest of all fates.

    late_s: how much later than their due time batches left, free-running [s]: median and worst.
    """

    slot: Count
    sent: Count
    addressed: Count
    fates: dict[str, Count]
    in_flight: Count
    rejected: dict[str, Count]
    digest: bytes = b""
    late_s: tuple[float, float] | None = None

    def packets(self) -> dict[str, int]:
        """Return the counters under their names in summary.json, fates between the others."""
        counted = {"sent": self.sent, "addressed": self.addressed}
        return {**counted, **self.fates, "in_flight": self.in_flight}
