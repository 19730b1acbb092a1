"""Neighbours: who is heard directly, how old what they said is, and who fell silent.

Everything here is in the Observation's time, which all vehicles share (as GPS gives it); a host's
clock is never read.
"""

from collections.abc import Collection
from math import inf, log

from agent.codec import RejectedError
from agent.controller import Heard
from agent.messages import Beacon, Place

MAX_AGE_S = 5.0
"""A beacon older than this says nothing about now."""
FORWARD_S = 1.0
"""A position is carried forward along its velocity for this long at most."""
LEAST_SILENCE_S = 1.5
NO_VERSION = (-1, -1)
"""(incarnation, sequence) of a sender not heard so far: lower than any."""
FALSE_ALARM = log(1e-6)
HEARD_BY_OTHERS = 0.25
"""Share of T_lost by which others hear the last word of one who is gone later than oneself."""
SMOOTHING = 0.05
MARGIN = 1.2
"""The loss is known from the last 39 gaps or so: n (1e6^(1/n) - 1) / ln 1e6 at n = 39."""


class Neighbour:
    """One neighbour: its last beacon, and the radio's quality as its sequence numbers show it."""

    __slots__ = ("beacon", "key", "latency_s", "mean_gap", "place")

    def __init__(self, beacon: Beacon, latency_s: float) -> None:
        self.beacon = beacon
        self.key = (beacon.incarnation, beacon.sequence)
        self.latency_s = latency_s
        self.mean_gap = 1.0
        self.place = _claim(beacon)

    def hear(self, beacon: Beacon, key: tuple[int, int], latency_s: float) -> None:
        """Take a newer beacon that was under way for ``latency_s`` [s]; key: which it is."""
        before, self.key = self.beacon, key
        if beacon.incarnation == before.incarnation:
            gap = beacon.sequence - before.sequence
            self.mean_gap += SMOOTHING * (gap - self.mean_gap)
        self.latency_s += SMOOTHING * (latency_s - self.latency_s)
        if beacon.rank != before.rank or beacon.queue != before.queue:
            self.place = _claim(beacon)
        self.beacon = beacon

    def silence_s(self, beacon_hz: float) -> float:
        """Return T_lost of E17 [s]: after that long without a word it is taken for gone.

        So long that chance alone would bring it once in a million, at the loss measured.
        """
        loss = 1.0 - 1.0 / max(self.mean_gap, 1.0)
        missed = MARGIN * FALSE_ALARM / log(loss) if loss > 1e-9 else 0.0
        return max(LEAST_SILENCE_S, missed / beacon_hz) + self.latency_s


class Neighbours:
    """The neighbours of one agent.

    sorted_ids: who is heard directly. beacon_hz: how often each is expected; slack_s: how far ahead
    of the own observation a stamp may be, for a message can overtake an observation [s].
    """

    def __init__(self, own_id: int, beacon_hz: float, slack_s: float) -> None:
        self._own_id = own_id
        self._beacon_hz = beacon_hz
        self._slack_s = slack_s
        self._known: dict[int, Neighbour] = {}
        self._in_order: list[Neighbour] = []
        self.sorted_ids: tuple[int, ...] = ()
        self._last: dict[int, tuple[int, int]] = {}

    def hear(self, beacon: Beacon, now_s: float, own_sent_s: dict[int, float]) -> None:
        """Take a beacon, or raise RejectedError: a replay, or a stamp that cannot be.

        own_sent_s: when each of the own recent sequences was sent [s]; a beacon that echoes one
        was sent after it (E22), whatever its stamp says.
        """
        who, key = beacon.id, (beacon.incarnation, beacon.sequence)
        if who == self._own_id:
            raise RejectedError("spoofed", "a beacon under one's own id")
        known = self._known.get(who)
        if key <= (known.key if known is not None else self._last.get(who, NO_VERSION)):
            raise RejectedError("replay", f"sequence {key} of {who} is not new")
        age_s = now_s - beacon.stamp_s
        if age_s < -self._slack_s:
            raise RejectedError("future", f"a stamp {-age_s:.3f} s ahead")
        if age_s > MAX_AGE_S:
            raise RejectedError("old", f"a stamp {age_s:.3f} s old")
        # Nothing was sent later than a fresh stamp: only an old one can be found out.
        if age_s > self._slack_s and self._answers_later(beacon, own_sent_s):
            raise RejectedError("offset", "older than a beacon it has heard")
        latency_s = age_s if age_s > 0.0 else 0.0
        if known is not None:
            known.hear(beacon, key, latency_s)
        else:
            self._known[who] = Neighbour(beacon, latency_s)
            self._put_in_order()

    def _answers_later(self, beacon: Beacon, own_sent_s: dict[int, float]) -> bool:
        """Whether a beacon echoes one of one's own that was sent after its stamp."""
        for echoed, sequence in beacon.echoes:
            if echoed == self._own_id:
                return beacon.stamp_s + self._slack_s < own_sent_s.get(sequence, -inf)
        return False

    @property
    def ids(self) -> Collection[int]:
        """Who is heard directly; to look one up."""
        return self._known.keys()

    def forget_silent(self, now_s: float) -> dict[int, float]:
        """Drop those who have been silent for longer than chance explains.

        Returns for each of them until when word passed on says no more than its own did: somebody
        else may have heard its last beacons, but not many more of them [s].
        """
        gone = {
            who: stamp_s + HEARD_BY_OTHERS * known.silence_s(self._beacon_hz)
            for who, known in self._known.items()
            if now_s - (stamp_s := known.beacon.stamp_s) > LEAST_SILENCE_S
            and now_s - stamp_s > known.silence_s(self._beacon_hz)
        }
        for who in gone:
            self._last[who] = self._known.pop(who).key
        if gone:
            self._put_in_order()
        return gone

    def silences_s(self) -> dict[int, float]:
        """Return for each neighbour how long it may be silent [s]."""
        return {who: each.silence_s(self._beacon_hz) for who, each in self._known.items()}

    def heard(self, now_s: float, mission: int = 0) -> tuple[Heard, ...]:
        """Return all neighbours, brought forward to now, sorted by id.

        A place claimed in another mission than ``mission`` is none.
        """
        heard = []
        for known in self._in_order:
            beacon = known.beacon
            since_s = now_s - beacon.stamp_s
            age_s = since_s if since_s > 0.0 else 0.0
            along = age_s if age_s < FORWARD_S else FORWARD_S
            x, y, z = beacon.position
            u, v, w = velocity = beacon.velocity
            position = (x + along * u, y + along * v, z + along * w)
            place = known.place if beacon.mission == mission else None
            heard.append(
                Heard(
                    id=beacon.id,
                    age_s=age_s,
                    position=position,
                    velocity=velocity,
                    target=beacon.target,
                    place=place,
                )
            )
        return tuple(heard)

    def behind(self, mission: int) -> bool:
        """Whether somebody who is heard flies an older mission."""
        return any(known.beacon.mission < mission for known in self._in_order)

    def beacons(self) -> list[Beacon]:
        """Return each neighbour's last beacon, sorted by id."""
        return [each.beacon for each in self._in_order]

    def echoes(self) -> tuple[tuple[int, int], ...]:
        """Return (id, last sequence heard) of each neighbour, sorted by id."""
        return tuple([(each.beacon.id, each.beacon.sequence) for each in self._in_order])

    def _put_in_order(self) -> None:
        self.sorted_ids = tuple(sorted(self._known))
        self._in_order = [self._known[who] for who in self.sorted_ids]


def _claim(beacon: Beacon) -> Place | None:
    return Place(beacon.queue, beacon.rank) if beacon.queue >= 0 else None
