"""Messages between the world and the medium: setup, true positions, faults, counters.

Structs marked ``array_like`` are encoded as msgpack arrays, so the order of their fields is the
wire format.
"""

from collections import Counter
from collections.abc import Sequence
from typing import Annotated

import msgspec
from msgspec import Meta

from netem.faults import FaultOrder, Position
from netem.link_parameters import Conditions
from netem.sender_counts import SenderRow
from netem.wire.frame import (
    MAX_OBSERVATION_B,
    AgentId,
    Count,
    EncodedObservation,
    unpack_typed,
)

MAX_TRUTH_B = 256 * 1024
MAX_CONDITIONS_B = 1024 * 1024
MAX_ORDERS_B = 1024 * 1024
MAX_PARTICIPANTS = 256
"""A quarter of the most agents that a team has: agents step in turn, in four slots of a tick."""
MAX_SLOT_INPUT_B = MAX_TRUTH_B + MAX_ORDERS_B + MAX_PARTICIPANTS * (MAX_OBSERVATION_B + 5)
MAX_SLOT_RESULT_B = 4 * 1024 * 1024


class FaultOrders(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Fault orders that the medium applies, in this order, before a slot."""

    slot: Count
    orders: tuple[FaultOrder, ...]


def packet_counters(
    sent: int,
    addressed: int,
    fates: dict[str, int],
    *,
    duplicated: int,
    corrupted: int,
    in_flight: int,
) -> dict[str, int]:
    """Return packet counters under their keys of summary.json; see :class:`MediumCounters`."""
    return {
        "sent": sent,
        "addressed": addressed,
        **fates,
        "duplicated": duplicated,
        "corrupted": corrupted,
        "in_flight": in_flight,
    }


class MediumCounters(
    msgspec.Struct, frozen=True, kw_only=True, array_like=True, gc=False, forbid_unknown_fields=True
):
    """The medium's counters since the start of the run.

    ``addressed`` equals the sum of ``fates`` plus ``in_flight``.
    """

    slot: Count
    """The next slot to play."""
    sent: Count
    """Frames."""
    addressed: Count
    """Frames, times the other agents, and each duplicate once more."""
    fates: dict[str, Count]
    """Copies of frames by what became of them."""
    in_flight: Count
    rejected: dict[str, Count]
    """Messages from agents and the world that were refused, by cause."""
    digest: bytes = b""
    """Hash over all verdicts of the run."""
    late_s: tuple[float, float] | None = None
    """Delay of batches after their due time, free-running: median, worst [s; simulated time]."""
    duplicated: Count = 0
    corrupted: Count = 0
    """Delivered frames with a flipped bit."""
    sent_b: tuple[Count, ...] = ()
    """Payload bytes that each agent sent on each channel, channels of one agent side by side."""
    struck: tuple[tuple[Count, Count], ...] = ()
    """Numbers of radio faults, each with frames, times the links that it cut or altered."""
    transmissions: tuple[SenderRow, ...] = ()
    """Of each agent, free-running: those that the medium accepted and refused."""
    frames: tuple[SenderRow, ...] = ()
    """Of each foreign agent: those that whoever hears them accepts or rejects."""

    def packets(self) -> dict[str, int]:
        """Return the packet counters under their keys of summary.json."""
        return packet_counters(
            self.sent,
            self.addressed,
            self.fates,
            duplicated=self.duplicated,
            corrupted=self.corrupted,
            in_flight=self.in_flight,
        )

    def after_kill(self) -> "MediumCounters":
        """Return the counters once the medium's process was killed: its frames are lost."""
        lost = self.fates.get("dropped_medium", 0) + self.in_flight
        fates = {**self.fates, "dropped_medium": lost}
        return msgspec.structs.replace(self, fates=fates, in_flight=0)


class Resumption(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the medium of a run needs of the one before it, whose process has ended."""

    slot: Count
    """The next slot to play."""
    orders: tuple[FaultOrder, ...] = ()
    """Bring the faults in force into force again."""
    counters: MediumCounters | None = None
    """Of the earlier medium; nothing is in flight any more."""


NEW_RUN = Resumption(0)


class MediumSetup(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Everything that a medium needs before its first slot."""

    seed: Count
    agents: Annotated[int, Meta(ge=1, lt=2**16)]
    """Number of agents, those that join later included; their ids are 0 to agents - 1."""
    slots_per_tick: Annotated[int, Meta(ge=1, le=64)]
    slot_hz: Annotated[float, Meta(gt=0, le=1e5)]
    """Slots per simulated second."""
    conditions: Conditions
    """Link conditions at the start of the run."""
    speed: Annotated[float, Meta(gt=0, le=1e4)] = 1.0
    """Simulated seconds per second of wall time."""
    lockstep: bool = False
    receivers: tuple[AgentId, ...] | None = None
    """The agents that this shard of the medium delivers to; None: all."""
    resumes: Resumption | None = None
    """Where the medium goes on; None: at the start of a run."""


class Truth(
    msgspec.Struct, frozen=True, kw_only=True, array_like=True, gc=False, forbid_unknown_fields=True
):
    """True positions at the start of a slot."""

    slot: Count
    time_s: Annotated[float, Meta(ge=0, le=1e9)]
    """[s; simulated time]"""
    positions: tuple[Position | None, ...]
    """Row i = agent i [m; world frame]; None where the agent has no vehicle or no process."""
    incarnations: tuple[Count, ...] = ()
    """Row i = agent i's current incarnation; empty in lockstep, where SlotInput holds them."""


class SlotInput(
    msgspec.Struct, frozen=True, kw_only=True, array_like=True, gc=False, forbid_unknown_fields=True
):
    """Everything that the medium and the agents need to play one slot in lockstep."""

    truth: Truth
    participants: tuple[AgentId, ...]
    """The agents that step in the slot, in ascending order."""
    observations: tuple[EncodedObservation, ...]
    """Row i is for participant i, in its inbox."""
    incarnations: tuple[Count, ...]
    """Row i = agent i's current incarnation."""
    orders: tuple[FaultOrder, ...] = ()
    """Applied before the slot."""


class SlotResult(
    msgspec.Struct, frozen=True, kw_only=True, array_like=True, gc=False, forbid_unknown_fields=True
):
    """What one shard of the medium reports of a slot that it has played in lockstep."""

    slot: Count
    pages: tuple[tuple[AgentId, bytes], ...]
    """The slot's page of the delivery log of each receiver; empty pages are left out."""
    counters: MediumCounters


_slot_input = msgspec.msgpack.Decoder(SlotInput).decode
_slot_result = msgspec.msgpack.Decoder(SlotResult).decode


def unpack_slot_input(data: bytes) -> SlotInput:
    """Decode a slot's input in lockstep, or raise WireError."""
    return unpack_typed(data, _slot_input, MAX_SLOT_INPUT_B)


def unpack_slot_result(data: bytes) -> SlotResult:
    """Decode a slot's result in lockstep, or raise WireError."""
    return unpack_typed(data, _slot_result, MAX_SLOT_RESULT_B)


def merged(shards: Sequence[MediumCounters]) -> MediumCounters:
    """Return the counters of one medium for those of the shards that divide its receivers."""
    first = shards[0]
    if len(shards) == 1:
        return first
    causes = {cause for shard in shards for cause in shard.rejected}
    struck: Counter[int] = Counter()
    for shard in shards:
        struck.update(dict(shard.struck))
    return msgspec.structs.replace(
        first,
        addressed=sum(shard.addressed for shard in shards),
        fates={fate: sum(shard.fates[fate] for shard in shards) for fate in first.fates},
        in_flight=sum(shard.in_flight for shard in shards),
        rejected={c: sum(shard.rejected.get(c, 0) for shard in shards) for c in sorted(causes)},
        duplicated=sum(shard.duplicated for shard in shards),
        corrupted=sum(shard.corrupted for shard in shards),
        struck=tuple(sorted(struck.items())),
    )
