"""Knowledge passed on: a table of single-writer records, the newest of each subject (E24).

A record is adopted only if its (incarnation, version) exceeds the last ever adopted for that
subject, and that number outlives the record; otherwise the departed would circulate as ghosts. The
version of a record is its subject's beacon sequence, so a beacon heard directly is a record too.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from math import inf
from types import MappingProxyType
from typing import assert_never

from agent.codec import SEAL_B, encode, sealed
from agent.comms.neighbours import NO_VERSION
from agent.comms.unidentified_vehicles import Departed, Member
from agent.controller import Peer
from agent.messages import Beacon, Gossip, Piece, Place, Record
from netem.wire.channels import MAX_PAYLOAD_B

RELAYED_SILENCE_ROUNDS = 12
"""T_d = (2 D + 10) / (1 - loss) rounds: what of it is the same at any distance. The rest, for D
hops at that loss, is twice the age at which a subject's records are measured to come."""
LAG_SMOOTHING = 0.25
LEAST_RELAYED_SILENCE_S = 2.5
NOBODY: Mapping[int, float] = MappingProxyType({})
MAX_FRAME_B = MAX_PAYLOAD_B - SEAL_B
FRAME_HEAD_B = 17
"""What a Gossip takes besides its records, with the greatest numbers it may hold."""
MAX_KNOWN = 1024
"""So many subjects at most: what is passed on in one round must fit one transmission."""


class Table:
    """What one agent knows of the team, itself excepted.

    multihop_hz: how often the table is passed on; 0 for never.
    """

    def __init__(self, own_id: int, multihop_hz: float) -> None:
        self._own_id = own_id
        self._newest: dict[int, Beacon | Record] = {}
        self._last: dict[int, tuple[int, int]] = {}
        self._lag_s: dict[int, float] = {}
        period_s = 1.0 / multihop_hz if multihop_hz > 0.0 else 0.0
        self._relayed_silence_s = max(LEAST_RELAYED_SILENCE_S, RELAYED_SILENCE_ROUNDS * period_s)

    def adopt_beacon(self, beacon: Beacon) -> None:
        """Take what a neighbour said of itself just now."""
        who, version = beacon.id, (beacon.incarnation, beacon.sequence)
        if version > self._last.get(who, NO_VERSION) and (who in self._newest or self._has_room):
            self._last[who] = version
            self._newest[who] = beacon

    def adopt(self, gossip: Gossip, now_s: float, slack_s: float) -> None:
        """Take what is news in a frame of the multihop channel.

        Stamps of the future are not, nor are those so old that one first heard of by them would
        be dropped at once.
        """
        latest_s = now_s + slack_s
        earliest_s = now_s - self._relayed_silence_s / (1.0 - 2.0 * LAG_SMOOTHING)
        for record in gossip.records:
            who, version = record.id, (record.incarnation, record.version)
            if version <= self._last.get(who, NO_VERSION):
                continue
            plausible = who != self._own_id and earliest_s <= record.stamp_s <= latest_s
            if plausible and (who in self._newest or self._has_room):
                self._last[who] = version
                self._newest[who] = record
                lag_s = self._lag_s.get(who, 0.0)
                age_s = max(0.0, now_s - record.stamp_s)
                self._lag_s[who] = lag_s + LAG_SMOOTHING * (age_s - lag_s)

    def forget_silent(
        self, now_s: float, heard: Collection[int], lost: Mapping[int, float] = NOBODY
    ) -> list[Departed]:
        """Drop the records of those who are gone, and return where they were.

        heard: the direct neighbours who are not; lost: those given up just now, see
        :meth:`Neighbours.forget_silent`. One of whom others tell later than that, or who never was
        a neighbour, may be silent for as long as relays take.
        """
        gone = []
        for who, newest in self._newest.items():
            match newest:
                case Beacon():
                    silent = who not in heard
                case Record():
                    limit_s = self._relayed_silence_s + 2.0 * self._lag_s.get(who, 0.0)
                    silent = newest.stamp_s <= lost.get(who, -inf)
                    silent = silent or now_s - newest.stamp_s > limit_s
                case _:
                    assert_never(newest)
            if silent:
                gone.append(who)
        departed = []
        for who in gone:
            last = self._newest.pop(who)
            departed.append(Departed(position=last.position, stamp_s=last.stamp_s))
            self._lag_s.pop(who, None)
        return departed

    def team(self, own: Peer, mission: int = 0) -> tuple[Peer, ...]:
        """Return all who are known, oneself included, sorted by id.

        A place claimed in another mission than ``mission`` is none.
        """
        peers = [own]
        for who, newest in self._newest.items():
            placed = newest.queue >= 0 and newest.mission == mission
            place = Place(newest.queue, newest.rank) if placed else None
            cost_m = newest.cost_mm / 1000.0
            peers.append(Peer(id=who, position=newest.position, place=place, cost_m=cost_m))
        peers.sort()
        return tuple(peers)

    def members(self, now_s: float) -> list[Member]:
        """Return where each member last said it was, and how long ago."""
        return [
            Member(position=newest.position, age_s=now_s - newest.stamp_s)
            for newest in self._newest.values()
        ]

    def blocked(self, mission: int) -> frozenset[Place]:
        """Return the places that others see taken by a silent body (E18)."""
        told = [each for each in self._newest.values() if each.blocked and each.mission == mission]
        return frozenset(Place(*place) for newest in told for place in newest.blocked)

    def frames(self, own: Record, pieces: Sequence[Piece] = ()) -> list[bytes]:
        """Return the whole table, the own record first, in frames of at most 1200 B.

        pieces: of a mission that somebody lacks; each travels in a frame of its own.
        """
        records = [own, *(_record(self._newest[who]) for who in sorted(self._newest))]
        said = [
            Gossip(id=self._own_id, stamp_s=own.stamp_s, records=chunk, piece=None)
            for chunk in _chunks(records)
        ]
        said += [
            Gossip(id=self._own_id, stamp_s=own.stamp_s, records=(), piece=piece)
            for piece in pieces
        ]
        return [sealed(encode(gossip)) for gossip in said]

    @property
    def _has_room(self) -> bool:
        return len(self._newest) < MAX_KNOWN


def _record(newest: Beacon | Record) -> Record:
    match newest:
        case Record():
            return newest
        case Beacon():
            return Record(
                id=newest.id,
                incarnation=newest.incarnation,
                version=newest.sequence,
                stamp_s=newest.stamp_s,
                position=newest.position,
                queue=newest.queue,
                rank=newest.rank,
                cost_mm=newest.cost_mm,
                mission=newest.mission,
                blocked=newest.blocked,
            )
        case _:
            assert_never(newest)


def _chunks(records: Sequence[Record]) -> Iterator[tuple[Record, ...]]:
    """Divide records over frames, as many to each as fit."""
    chunk, size = list[Record](), FRAME_HEAD_B
    for record in records:
        length = len(encode(record))
        if chunk and size + length > MAX_FRAME_B:
            yield tuple(chunk)
            chunk, size = [], FRAME_HEAD_B
        chunk.append(record)
        size += length
    yield tuple(chunk)
