"""What an agent says, and when: beacons on the local channel, its table on the multihop one.

Fig. 3's two layers: high frequency to whoever hears it, low frequency to be passed on.
"""

from collections.abc import Sequence
from math import inf

import msgspec

from agent.codec import encode, sealed
from agent.comms.gossip import Table
from agent.comms.hierarchy import ALONE, Standing
from agent.messages import HOME, Beacon, Drift, Piece, Place, Pose, Record, Vector
from netem.wire.channels import LOCAL, MULTIHOP, Channel

MEMORY = 200
"""So many of the own beacons are remembered, for the echoes that may come."""
MAX_ECHOES = 67
"""So many fit beside the greatest numbers of a Beacon: 317 B with its seal, and 13 B each."""


class OwnState(msgspec.Struct, frozen=True, gc=False):
    """What an agent says of itself: SI units, world frame; see Beacon."""

    position: Vector
    velocity: Vector
    heading_for: Vector
    place: Place | None
    speed_cap: float
    mission: int = 0
    frame_key: int = 0
    frame: Pose = HOME
    drift: Drift | None = None
    standing: Standing = ALONE
    blocked: tuple[Place, ...] = ()
    cost_mm: int = 0

    @property
    def claim(self) -> tuple[int, int, int]:
        """Queue and rank claimed, -1 for none, and the claim's cost [mm]."""
        return (*self.place, self.cost_mm) if self.place is not None else (-1, -1, 0)


class Broadcast:
    """An agent's side of both channels; it numbers the beacons and remembers when each was sent.

    beacon_period_s, round_period_s: of the two channels [s]; infinite for a channel that is off.
    """

    def __init__(
        self, own_id: int, incarnation: int, beacon_period_s: float, round_period_s: float
    ) -> None:
        self._id = own_id
        self._incarnation = incarnation
        self._beacon_period_s = beacon_period_s
        self._round_period_s = round_period_s
        self._next_beacon_s = 0.0
        self._next_round_s = 0.0 if round_period_s < inf else inf
        self.sequence = 0
        self.sent_s: dict[int, float] = {}

    def frames(
        self,
        now_s: float,
        own: OwnState,
        echoes: tuple[tuple[int, int], ...],
        table: Table,
        pieces: Sequence[Piece] = (),
    ) -> tuple[tuple[Channel, bytes], ...]:
        """Return what is due now, as (channel, payload).

        pieces: of the mission, where somebody who is heard lacks it; they go with the next round.
        """
        frames: list[tuple[Channel, bytes]] = []
        if now_s >= self._next_beacon_s:
            self._next_beacon_s = now_s + self._beacon_period_s - 1e-9
            frames.append((LOCAL, sealed(encode(self._beacon(now_s, own, echoes)))))
        if now_s >= self._next_round_s:
            self._next_round_s = now_s + self._round_period_s - 1e-9
            frames.extend(
                (MULTIHOP, frame) for frame in table.frames(self._record(now_s, own), pieces)
            )
        return tuple(frames)

    def _beacon(self, now_s: float, own: OwnState, echoes: tuple[tuple[int, int], ...]) -> Beacon:
        sequence = self._numbered(now_s)
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
            echoes=_in_turns(echoes, sequence),
            mission=own.mission,
            frame_key=own.frame_key,
            frame=own.frame,
            drift=own.drift,
            tier=own.standing.tier,
            parent=own.standing.parent,
            root=own.standing.root,
            blocked=own.blocked,
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

    def _numbered(self, now_s: float) -> int:
        self.sequence += 1
        self.sent_s[self.sequence] = now_s
        self.sent_s.pop(self.sequence - MEMORY, None)
        return self.sequence


def _in_turns(echoes: tuple[tuple[int, int], ...], turn: int) -> tuple[tuple[int, int], ...]:
    """Return as many echoes as fit a beacon; where that is not all, others in each turn."""
    if len(echoes) <= MAX_ECHOES:
        return echoes
    start = turn * MAX_ECHOES % len(echoes)
    return (echoes + echoes)[start : start + MAX_ECHOES]
