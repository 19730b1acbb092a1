"""Broadcasting: beacons on the local channel, the record table on the multihop channel.

These are the two layers of Fig. 3: high frequency to all agents in range, and low frequency to be
passed on.
"""

from collections.abc import Sequence
from math import ceil, inf

import msgspec

from agent.codec import add_checksum, encode
from agent.comms.gossip import RecordTable
from agent.comms.hierarchy import IN_DISTRESS, HierarchyState
from agent.messages import HOME, Beacon, Drift, Piece, Place, Pose, Record, Vector
from netem.wire.channels import LOCAL, MULTIHOP, Channel

REMEMBERED_BEACONS = 200
"""How many own sending times are kept, for echoes that may come."""
MAX_ECHOES = 67
"""Most echoes that fit a frame: a Beacon of few places takes up to 317 B with its checksum."""
FEW_PLACES, PLACE_B, ECHO_B = 8, 7, 13


class OwnState(msgspec.Struct, frozen=True, gc=False):
    """What an agent reports about itself; see Beacon."""

    position: Vector  # [m; world frame]
    velocity: Vector  # [m/s; world frame]
    heading_for: Vector  # immediate target q_tg [m; world frame]
    place: Place | None
    speed_cap: float  # promised for the next 3 s [m/s]
    mission: int = 0
    frame_key: int = 0
    frame: Pose = HOME
    drift: Drift | None = None
    hierarchy: HierarchyState = IN_DISTRESS
    blocked: tuple[Place, ...] = ()
    cost_mm: int = 0  # [mm]

    @property
    def claim(self) -> tuple[int, int, int]:
        """Queue and rank of the claimed place, -1 for none, and the claim's cost [mm]."""
        return (*self.place, self.cost_mm) if self.place is not None else (-1, -1, 0)


class Broadcast:
    """An agent's sending side of both channels.

    It numbers the beacons (``sequence``) and remembers when each was sent (``sent_s``). The periods
    of the two channels are in [s]; infinite for a channel that is off.
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
        table: RecordTable,
        pieces: Sequence[Piece] = (),
    ) -> tuple[tuple[Channel, bytes], ...]:
        """Return the frames due now, as (channel, payload).

        pieces: of the mission, if a neighbour lacks it; they go out with the next multihop round.
        """
        frames: list[tuple[Channel, bytes]] = []
        if now_s >= self._next_beacon_s:
            self._next_beacon_s = now_s + self._beacon_period_s - 1e-9
            frames.append((LOCAL, add_checksum(encode(self._beacon(now_s, own, echoes)))))
        if now_s >= self._next_round_s:
            self._next_round_s = now_s + self._round_period_s - 1e-9
            frames.extend(
                (MULTIHOP, frame) for frame in table.frames(self._record(now_s, own), pieces)
            )
        return tuple(frames)

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
            echoes=_echoes_of_turn(echoes, sequence, most_echoes(len(own.blocked))),
            mission=own.mission,
            frame_key=own.frame_key,
            frame=own.frame,
            drift=own.drift,
            tier=own.hierarchy.tier,
            parent=own.hierarchy.parent,
            root=own.hierarchy.root,
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

    def _next_sequence(self, now_s: float) -> int:
        self.sequence += 1
        self.sent_s[self.sequence] = now_s
        self.sent_s.pop(self.sequence - REMEMBERED_BEACONS, None)
        return self.sequence


def most_echoes(places: int) -> int:
    """Return how many echoes fit a beacon that names so many blocked places."""
    return MAX_ECHOES - ceil(max(0, places - FEW_PLACES) * PLACE_B / ECHO_B)


def _echoes_of_turn(
    echoes: tuple[tuple[int, int], ...], turn: int, most: int
) -> tuple[tuple[int, int], ...]:
    """Return as many echoes as fit a beacon; if not all fit, other ones in each turn."""
    if len(echoes) <= most:
        return echoes
    start = turn * most % len(echoes)
    return (echoes + echoes)[start : start + most]
