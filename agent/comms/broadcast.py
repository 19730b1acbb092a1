"""Broadcasting: beacons on the local channel; summaries, missions and records on the multihop one.

These are the two layers of Fig. 3: high frequency to all agents in range, and low frequency to be
passed on.
"""

from collections.abc import Sequence
from math import inf
from typing import Final, final

from agent.codec import RadioCodec
from agent.comms.gossip import RecordTable
from agent.config import Comms
from agent.messages import (
    HOME,
    Beacon,
    Drift,
    Gossip,
    Piece,
    Place,
    Pose,
    Record,
    Standing,
    Summary,
    Vector,
)
from netem.wire.channels import LOCAL, MULTIHOP, Channel

REMEMBERED_BEACONS: Final = 200
"""How many own sending times are kept, for echoes that may come."""
NEWS_SHARE, PIECES_SOON = 0.25, 8
"""A mission that a neighbour lacks goes out after this share of a round, so many times; then once a
round, as a Trickle timer does (RFC 6206): the neighbour may not hear this agent."""
MAX_ECHOES: Final = 8
"""Most echoes of one beacon; of more neighbours others have their turn in the next."""


@final
class OwnState:
    """What an agent reports about itself; see Beacon."""

    def __init__(  # noqa: PLR0913, PLR0917
        self,
        position: Vector,  # [m; world frame]
        velocity: Vector,  # [m/s; world frame]
        heading_for: Vector,  # immediate target q_tg [m; world frame]
        place: Place | None,
        speed_cap: float,  # promised for the next 3 s [m/s]
        mission: int = 0,
        frame_key: int = 0,
        frame: Pose = HOME,
        drift: Drift | None = None,
        blocked: tuple[Place, ...] = (),
        cost_mm: int = 0,  # [mm]
        standing: Standing | None = None,
        summary: Summary | None = None,
    ) -> None:
        self.position = position
        self.velocity = velocity
        self.heading_for = heading_for
        self.place = place
        self.speed_cap = speed_cap
        self.mission = mission
        self.frame_key = frame_key
        self.frame = frame
        self.drift = drift
        self.blocked = blocked
        self.cost_mm = cost_mm
        self.standing = standing
        self.summary = summary

    @property
    def claim(self) -> tuple[int, int, int]:
        """Queue and rank of the claimed place, -1 for none, and the claim's cost [mm]."""
        place = self.place
        return (place.queue, place.rank, self.cost_mm) if place is not None else (-1, -1, 0)


class Broadcast:
    """An agent's sending side of both channels.

    It numbers the beacons (``sequence``) and remembers when each was sent (``sent_s``). relays:
    whether it passes the table of members on.
    """

    def __init__(
        self,
        own_id: int,
        incarnation: int,
        comms: Comms,
        codec: RadioCodec,
        relays: bool = True,
    ) -> None:
        self._codec = codec
        self._relays = relays
        self._id = own_id
        self._incarnation = incarnation
        self._beacon_period_s = 1.0 / comms.local_hz
        self._round_period_s = 1.0 / comms.multihop_hz if comms.multihop_hz > 0.0 else inf
        self.sequence = 0
        self.forget_times()

    def forget_times(self) -> None:
        """Begin anew after a jump of the own clock; the beacons' numbers go on."""
        self._next_beacon_s = 0.0
        self._next_round_s = 0.0 if self._round_period_s < inf else inf
        self._pieces_key: int | None = None
        self._pieces_sent, self._next_pieces_s = 0, inf
        self.sent_s: dict[int, float] = {}

    def frames(
        self,
        now_s: float,
        own: OwnState,
        echoes: tuple[tuple[int, int], ...],
        table: RecordTable,
        pieces: Sequence[Piece] = (),
    ) -> tuple[tuple[Channel, bytes], ...]:
        """Return the frames due now, as (channel, payload).

        pieces: of the mission, if a neighbour lacks it; they go out several times in a row, then
        with each multihop round.
        """
        frames: list[tuple[Channel, bytes]] = []
        if now_s >= self._next_beacon_s:
            self._next_beacon_s = now_s + self._beacon_period_s - 1e-9
            beacon = self._beacon(now_s, own, echoes)
            frames.append((LOCAL, self._codec.encode_beacon(beacon)))
        if now_s >= self._next_round_s:
            self._next_round_s = now_s + self._round_period_s - 1e-9
            record = self._record(now_s, own) if self._relays else None
            frames.extend((MULTIHOP, frame) for frame in table.frames(now_s, record))
        if self._pieces_due(now_s, pieces):
            frames.extend((MULTIHOP, frame) for frame in table.frames(now_s, None, pieces))
        if own.summary is not None and self._round_period_s < inf:
            gossip = Gossip(self._id, now_s, records=(), piece=None, summary=own.summary)
            frames.append((MULTIHOP, self._codec.encode_gossip(gossip)))
        return tuple(frames)

    def _pieces_due(self, now_s: float, pieces: Sequence[Piece]) -> bool:
        """Whether the pieces of a mission go out now: sooner at first, for it is news."""
        key = pieces[0].key if pieces else None
        if key != self._pieces_key:
            self._pieces_key, self._pieces_sent = key, 0
            self._next_pieces_s = now_s if self._round_period_s < inf else inf
        if not pieces or now_s < self._next_pieces_s:
            return False
        self._pieces_sent += 1
        share = NEWS_SHARE if self._pieces_sent < PIECES_SOON else 1.0
        self._next_pieces_s = now_s + share * self._round_period_s - 1e-9
        return True

    def _beacon(self, now_s: float, own: OwnState, echoes: tuple[tuple[int, int], ...]) -> Beacon:
        sequence = self._next_sequence(now_s)
        queue, rank, cost_mm = own.claim
        return Beacon(
            id=self._id,
            incarnation=self._incarnation,
            sequence=sequence,
            stamp_s=now_s,
            position=own.position,
            velocity=own.velocity,
            target=own.heading_for,
            queue=queue,
            rank=rank,
            cost_mm=cost_mm,
            speed_cap=own.speed_cap,
            echoes=_echoes_of_turn(echoes, sequence),
            mission=own.mission,
            frame_key=own.frame_key,
            frame=own.frame,
            drift=own.drift,
            blocked=own.blocked,
            standing=own.standing,
        )

    def _record(self, now_s: float, own: OwnState) -> Record:
        queue, rank, cost_mm = own.claim
        return Record(
            id=self._id,
            incarnation=self._incarnation,
            version=self.sequence,
            stamp_s=now_s,
            position=own.position,
            queue=queue,
            rank=rank,
            cost_mm=cost_mm,
            mission=own.mission,
            blocked=own.blocked,
        )

    def _next_sequence(self, now_s: float) -> int:
        self.sequence += 1
        self.sent_s[self.sequence] = now_s
        self.sent_s.pop(self.sequence - REMEMBERED_BEACONS, None)
        return self.sequence


def _echoes_of_turn(echoes: tuple[tuple[int, int], ...], turn: int) -> tuple[tuple[int, int], ...]:
    """Return the echoes of one beacon; if there are more, other ones in each turn."""
    if len(echoes) <= MAX_ECHOES:
        return echoes
    start = turn * MAX_ECHOES % len(echoes)
    return (echoes + echoes)[start : start + MAX_ECHOES]
