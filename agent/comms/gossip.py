"""Knowledge passed on: a table of single-writer records, the newest of each subject (E24).

A record is adopted only if its (incarnation, version) exceeds the last ever adopted for that
subject, and that number outlives the record; otherwise the departed would circulate as ghosts. The
version of a record is its subject's beacon sequence, so a beacon heard directly is a record too.
"""

from agent.codec import encode
from agent.controller import Peer
from agent.messages import Beacon, Gossip, Place, Record

RELAYED_SILENCE_ROUNDS = 14
"""2 D + 10 rounds at a hop diameter D of 2, as for the suspicion of the dead."""
LEAST_RELAYED_SILENCE_S = 2.5
MAX_FRAME_B = 1200
FRAME_HEAD_B = 24
RECORD_B = 64


class Entry:
    """A record, and until when its subject counts as present without a newer one."""

    __slots__ = ("direct", "record")

    def __init__(self, record: Record, direct: bool) -> None:
        self.record = record
        self.direct = direct


class Table:
    """What one agent knows of the team, itself excepted.

    multihop_hz: how often the table is passed on; 0 for never.
    """

    def __init__(self, own_id: int, multihop_hz: float) -> None:
        self._own_id = own_id
        self._entries: dict[int, Entry] = {}
        self._last: dict[int, tuple[int, int]] = {}
        period_s = 1.0 / multihop_hz if multihop_hz > 0.0 else 0.0
        self._relayed_silence_s = max(LEAST_RELAYED_SILENCE_S, RELAYED_SILENCE_ROUNDS * period_s)

    def adopt_beacon(self, beacon: Beacon) -> None:
        """Take what a neighbour said of itself just now."""
        self._adopt(
            Record(
                beacon.id,
                beacon.incarnation,
                beacon.sequence,
                beacon.stamp_s,
                beacon.position,
                beacon.queue,
                beacon.rank,
            ),
            direct=True,
        )

    def adopt(self, gossip: Gossip, now_s: float, slack_s: float) -> None:
        """Take what is news in a frame of the multihop channel; stamps of the future are not."""
        for record in gossip.records:
            if record.id != self._own_id and record.stamp_s <= now_s + slack_s:
                self._adopt(record, direct=False)

    def forget_silent(self, now_s: float, silence_s: dict[int, float]) -> None:
        """Drop the records of those who are gone.

        silence_s: for each direct neighbour how long it may be silent [s]. One that was heard
        directly and no more may be silent for as long as the shortest relay takes.
        """
        gone = []
        for who, entry in self._entries.items():
            limit = self._relayed_silence_s
            if entry.direct:
                limit = silence_s.get(who, 0.0)
            if now_s - entry.record.stamp_s > limit:
                gone.append(who)
        for who in gone:
            del self._entries[who]

    def team(self, own: Peer) -> tuple[Peer, ...]:
        """Return all who are known, oneself included, sorted by id."""
        peers = [own]
        for who, entry in self._entries.items():
            record = entry.record
            place = Place(record.queue, record.rank) if record.queue >= 0 else None
            peers.append(Peer(who, record.position, place))
        return tuple(sorted(peers))

    def frames(self, own: Record) -> list[bytes]:
        """Return the whole table, the own record first, in frames of at most 1200 B."""
        records = [own, *(self._entries[who].record for who in sorted(self._entries))]
        per_frame = (MAX_FRAME_B - FRAME_HEAD_B) // RECORD_B
        return [
            encode(Gossip(self._own_id, own.stamp_s, tuple(records[at : at + per_frame])))
            for at in range(0, len(records), per_frame)
        ]

    def _adopt(self, record: Record, *, direct: bool) -> None:
        key = (record.incarnation, record.version)
        if key <= self._last.get(record.id, (-1, -1)):
            return
        self._last[record.id] = key
        self._entries[record.id] = Entry(record, direct)
