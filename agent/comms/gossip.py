"""Gossip: a table of single-writer records, the newest of each subject, passed on (E24).

A record is adopted only if it supersedes the last one ever adopted for that subject, as
:class:`~agent.heard_beacon.Version` says. That version outlives the record; otherwise departed
agents would circulate as ghosts. It goes by the stamp, which cannot run ahead, so the subject's own
records supersede whatever another agent invents. A record's version is its subject's beacon
sequence, so a beacon heard directly counts as a record too. Records of ids that the run does not
have are ignored, which bounds the table.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from math import inf
from operator import attrgetter
from types import MappingProxyType
from typing import Final, assert_never

from agent.codec import CHECKSUM_B, add_checksum, encode
from agent.comms.unidentified_vehicles import DepartedMember, MemberPosition
from agent.controller import Peer
from agent.heard_beacon import NEVER_HEARD, HeardBeacon, Version
from agent.messages import AGENT_IDS, MAX_TEAM, NO_MISSION, Gossip, Piece, Place, Record
from netem.wire.channels import MAX_PAYLOAD_B

RELAYED_SILENCE_ROUNDS: Final = 12
"""The part of T_d = (2 D + 10) / (1 - loss) rounds that is the same at any distance. The rest, for
D hops at that loss, is twice the measured age at which a subject's records arrive."""
LAG_SMOOTHING: Final = 0.25
LEAST_RELAYED_SILENCE_S: Final = 2.5
NONE_LOST: Mapping[int, float] = MappingProxyType({})
MAX_FRAME_B: Final = MAX_PAYLOAD_B - CHECKSUM_B
FRAME_HEAD_B: Final = 18
"""Longest encoding of a Gossip without records [B]."""


class RecordTable:
    """What one agent knows of the other members of the team.

    multihop_hz: how often the table is passed on [Hz]; 0: never. ids: number of agent ids.
    """

    def __init__(self, own_id: int, multihop_hz: float, ids: int = AGENT_IDS) -> None:
        self._own_id = own_id
        self._ids = ids
        self._newest: dict[int, HeardBeacon | Record] = {}
        self._last: dict[int, Version] = {}
        """The last one adopted of each subject whose newest statement is no beacon."""
        self._lag_s: dict[int, float] = {}
        period_s = 1.0 / multihop_hz if multihop_hz > 0.0 else 0.0
        self._relayed_silence_s = max(LEAST_RELAYED_SILENCE_S, RELAYED_SILENCE_ROUNDS * period_s)

    def adopt_beacon(self, beacon: HeardBeacon) -> None:
        """Take a neighbour's beacon as the newest record of that neighbour."""
        subject, known = beacon.id, self._newest.get(beacon.id)
        if known is None and not self._may_know(subject):
            return
        if beacon.version.supersedes(self._last_of(subject, known)):
            self._newest[subject] = beacon

    def adopt(self, gossip: Gossip, now_s: float, slack_s: float) -> None:
        """Take the new records of a frame of the multihop channel.

        It ignores stamps in the future, and stamps so old that a subject first heard of by them
        would be dropped at once.
        """
        latest_s = now_s + slack_s
        earliest_s = now_s - self._relayed_silence_s / (1.0 - 2.0 * LAG_SMOOTHING)
        for record in gossip.records:
            subject = record.id
            version = Version(record.stamp_s, record.incarnation, record.version)
            if not version.supersedes(self._last_of(subject, self._newest.get(subject))):
                continue
            if self._may_know(subject) and earliest_s <= record.stamp_s <= latest_s:
                self._last[subject] = version
                self._newest[subject] = record
                lag_s = self._lag_s.get(subject, 0.0)
                age_s = max(0.0, now_s - record.stamp_s)
                self._lag_s[subject] = lag_s + LAG_SMOOTHING * (age_s - lag_s)

    def forget_silent(
        self, now_s: float, heard: Collection[int], lost: Mapping[int, float] = NONE_LOST
    ) -> list[DepartedMember]:
        """Drop the records of departed members and return their last reports.

        heard: ids of the present neighbours. lost: neighbours just given up, as returned by
        :meth:`Neighbours.forget_silent`. A member with a relayed record later than that, or one
        that never was a neighbour, may be silent for as long as relays take.
        """
        gone = []
        for subject, newest in self._newest.items():
            match newest:
                case HeardBeacon():
                    silent = subject not in heard
                case Record():
                    limit_s = self._relayed_silence_s + 2.0 * self._lag_s.get(subject, 0.0)
                    silent = newest.stamp_s <= lost.get(subject, -inf)
                    silent = silent or now_s - newest.stamp_s > limit_s
                case _:
                    assert_never(newest)
            if silent:
                gone.append(subject)
        departed = []
        for subject in gone:
            last = self._newest.pop(subject)
            self._last[subject] = self._last_of(subject, last)
            departed.append(DepartedMember(position=last.position, stamp_s=last.stamp_s))
            self._lag_s.pop(subject, None)
        return departed

    def team(self, own: Peer, mission: int = 0) -> tuple[Peer, ...]:
        """Return all known members, the own agent included, sorted by id.

        mission: key of the own mission; a place claimed in another mission is left out.
        """
        peers = [own]
        for subject, newest in self._newest.items():
            placed = newest.queue >= 0 and newest.mission == mission != NO_MISSION
            place = Place(newest.queue, newest.rank) if placed else None
            cost_m = newest.cost_mm / 1000.0
            peers.append(Peer(id=subject, position=newest.position, place=place, cost_m=cost_m))
        peers.sort(key=attrgetter("id"))
        return tuple(peers)

    def members(self, now_s: float) -> list[MemberPosition]:
        """Return the last reported position of each member."""
        return [
            MemberPosition(id=subject, position=newest.position, age_s=now_s - newest.stamp_s)
            for subject, newest in self._newest.items()
        ]

    def newest(self) -> Collection[HeardBeacon | Record]:
        """Return the newest statement of each member."""
        return self._newest.values()

    def blocked(self, mission: int) -> frozenset[Place]:
        """Return the places that others see taken by an unidentified vehicle (E18).

        mission: key of the mission in which these are places.
        """
        reports = [
            each
            for each in self._newest.values()
            if each.blocked and each.mission == mission != NO_MISSION
        ]
        return frozenset(Place(*place) for newest in reports for place in newest.blocked)

    def frames(self, now_s: float, own: Record | None, pieces: Sequence[Piece] = ()) -> list[bytes]:
        """Return the payloads of one round: the whole table, the own record first.

        own: None where the table is not passed on. pieces: of a mission that a neighbour lacks;
        each travels in a frame of its own.
        """
        frames = [
            Gossip(id=self._own_id, stamp_s=now_s, records=chunk, piece=None)
            for chunk in self._chunks(own)
        ]
        frames += [
            Gossip(id=self._own_id, stamp_s=now_s, records=(), piece=piece) for piece in pieces
        ]
        return [add_checksum(encode(gossip)) for gossip in frames]

    def _chunks(self, own: Record | None) -> Iterator[tuple[Record, ...]]:
        if own is None:
            return iter(())
        return _chunks([own, *(_record_of(self._newest[each]) for each in sorted(self._newest))])

    def _last_of(self, subject: int, newest: HeardBeacon | Record | None) -> Version:
        """Return the last version adopted of a subject. newest: its newest statement, if known."""
        if isinstance(newest, HeardBeacon):
            return newest.version
        return self._last.get(subject, NEVER_HEARD)

    def _may_know(self, subject: int) -> bool:
        """Whether a subject is known, or another agent of the run for which there is room."""
        if subject in self._newest:
            return True
        other = subject != self._own_id and subject < self._ids
        return other and len(self._newest) < MAX_TEAM


def _record_of(newest: HeardBeacon | Record) -> Record:
    match newest:
        case Record():
            return newest
        case HeardBeacon():
            return Record(
                id=newest.id,
                incarnation=newest.version.incarnation,
                version=newest.version.sequence,
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
    """Divide records over frames, as many in each as fit."""
    chunk, size = list[Record](), FRAME_HEAD_B
    for record in records:
        length = len(encode(record))
        if chunk and size + length > MAX_FRAME_B:
            yield tuple(chunk)
            chunk, size = [], FRAME_HEAD_B
        chunk.append(record)
        size += length
    yield tuple(chunk)
