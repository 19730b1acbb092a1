"""What the world tells the medium: the conditions, each slot the true positions, and orders."""

from collections.abc import Mapping, Sequence
from typing import Annotated

import msgspec
from msgspec import Meta

from netem.faults import FaultOrder, Position
from netem.link_keys import Conditions
from netem.wire.frame import AgentId, Count, unpack_typed

MAX_TRUTH_B = 256 * 1024
MAX_CONDITIONS_B = 1024 * 1024
MAX_ORDERS_B = 1024 * 1024
MAX_TURN_B = MAX_TRUTH_B + MAX_ORDERS_B
MAX_DONE_B = 4 * 1024 * 1024


class FaultOrders(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """FaultOrders to carry out, one after the other, before a slot."""

    slot: Count
    orders: tuple[FaultOrder, ...]


class MediumSetup(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All that a medium needs to begin; ``speed``: simulated seconds in one of the wall clock.

    receivers: those whom this one of several mediums delivers to; None: all.
    """

    seed: Count
    agents: Annotated[int, Meta(ge=1, lt=2**16)]
    slots_per_tick: Annotated[int, Meta(ge=1, le=64)]
    slot_hz: Annotated[float, Meta(gt=0, le=1e5)]
    conditions: Conditions
    speed: Annotated[float, Meta(gt=0, le=1e4)] = 1.0
    lockstep: bool = False
    receivers: tuple[AgentId, ...] | None = None


class Truth(msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """Where the vehicles truly are at the start of a slot.

    positions: row i = agent i [m; world frame], None where no radio is: the agent has no vehicle in
    the world, or its process is gone. incarnations: likewise, which of its processes an agent is;
    free-running (a turn of lockstep has them besides).
    """

    slot: Count
    time_s: Annotated[float, Meta(ge=0, le=1e9)]
    positions: tuple[Position | None, ...]
    incarnations: tuple[Count, ...] = ()


class MediumCounters(
    msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True
):
    """What the medium reports: how many frames met which fate so far, and a digest of all fates.

    addressed: frames sent, times the other agents, and each duplicate once more; it equals the sum
    of fates and in_flight. duplicated, corrupted: how many were copies, or had a bit turned.
    late_s: how much later than their due time batches left, free-running [s]: median and worst.
    spoken_b: payload bytes that each agent sent, channel by channel, agent after agent.
    """

    slot: Count
    sent: Count
    addressed: Count
    fates: dict[str, Count]
    in_flight: Count
    rejected: dict[str, Count]
    digest: bytes = b""
    late_s: tuple[float, float] | None = None
    duplicated: Count = 0
    corrupted: Count = 0
    spoken_b: tuple[Count, ...] = ()

    def packets(self) -> dict[str, int]:
        """Return the counters under their names in summary.json, fates between the others."""
        return packets_of(
            self.sent, self.addressed, self.fates, self.duplicated, self.corrupted, self.in_flight
        )


def packets_of(
    sent: int,
    addressed: int,
    fates: Mapping[str, int],
    duplicated: int,
    corrupted: int,
    in_flight: int,
) -> dict[str, int]:
    """Return counters under their names in summary.json, fates between the others."""
    return {
        "sent": sent,
        "addressed": addressed,
        **fates,
        "duplicated": duplicated,
        "corrupted": corrupted,
        "in_flight": in_flight,
    }


class Turn(msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """All that the medium needs to play one slot in lockstep.

    participants: who steps in it, ids ascending; incarnations: everybody's, row i = agent i.
    orders: what is to be carried out before it.
    """

    truth: Truth
    participants: tuple[AgentId, ...]
    incarnations: tuple[Count, ...]
    orders: tuple[FaultOrder, ...] = ()


class Done(msgspec.Struct, frozen=True, array_like=True, gc=False, forbid_unknown_fields=True):
    """A slot that one of several mediums has played: its pages by receiver, and its counters."""

    slot: Count
    pages: tuple[tuple[AgentId, bytes], ...]
    medium_counters: MediumCounters


_turn = msgspec.msgpack.Decoder(Turn).decode
_done = msgspec.msgpack.Decoder(Done).decode


def unpack_turn(data: bytes) -> Turn:
    """Decode what the world sends in lockstep, or raise WireError."""
    return unpack_typed(data, _turn, MAX_TURN_B)


def unpack_done(data: bytes) -> Done:
    """Decode what a medium answers in lockstep, or raise WireError."""
    return unpack_typed(data, _done, MAX_DONE_B)


def together(parts: Sequence[MediumCounters]) -> MediumCounters:
    """Return what one medium would have counted where several share the receivers out."""
    first = parts[0]
    if len(parts) == 1:
        return first
    causes = {cause for part in parts for cause in part.rejected}
    return msgspec.structs.replace(
        first,
        addressed=sum(part.addressed for part in parts),
        fates={fate: sum(part.fates[fate] for part in parts) for fate in first.fates},
        in_flight=sum(part.in_flight for part in parts),
        rejected={c: sum(part.rejected.get(c, 0) for part in parts) for c in sorted(causes)},
        duplicated=sum(part.duplicated for part in parts),
        corrupted=sum(part.corrupted for part in parts),
    )
