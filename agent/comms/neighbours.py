"""Neighbours: agents heard directly, the age of their reports, and the detection of silence.

All times are in Observation time, which all vehicles share (as GPS gives it). The host's clock is
never read.
"""

from collections.abc import Collection
from math import dist, inf, log
from typing import Final

from agent.controller import UNHEARD, Heard, Link
from agent.heard_beacon import NEVER_HEARD, HeardBeacon, Version
from agent.messages import Vector
from agent.rejection import RejectedError
from agent.vectors import apart

MAX_AGE_S: Final = 5.0
"""An older beacon is rejected."""
MAX_EXTRAPOLATION_S: Final = 1.0
"""A position is extrapolated along its velocity for this long at most."""
LEAST_SILENCE_S: Final = 1.5
LOG_FALSE_ALARM = log(1e-6)
"""Logarithm of the probability that chance alone makes a silence of T_lost (E17)."""
HEARD_BY_OTHERS: Final = 0.25
"""Share of T_lost by which others may hear a departing agent's last beacon later."""
POOLED: Final = 0.005
"""Weight of one beacon in the radio's quality: it follows from the last 200 beacons or so."""
NEARLY: Final = 1.0 - 1e-9
"""By this factor a distance falls below any rounding of it."""
WITNESSES: Final = 2
"""So many neighbours must have been heard from a distance until it counts as within reach."""
ECHO_LASTS_S: Final = 3.0
"""A neighbour that echoed a beacon hears this agent for so long."""
SMOOTHING: Final = 0.05
MARGIN: Final = 1.2
"""The loss is estimated from the last 39 gaps or so: n (1e6^(1/n) - 1) / ln 1e6 at n = 39."""


class LinkQuality:
    """The radio's quality, pooled over all neighbours, so that it is known within a second."""

    def __init__(self) -> None:
        self._beacons = self._sent = self._latency_s = 0.0
        self._farthest_m: dict[int, float] = {}
        """The two neighbours that were heard from farthest away."""
        self._reach_m = 0.0
        """From how far two neighbours were heard; 0 before."""

    def note(self, gap: float, latency_s: float) -> None:
        """Note a beacon heard. gap: beacons that its sender has sent since the last one heard."""
        self._beacons += 1.0 - POOLED * self._beacons
        self._sent += gap - POOLED * self._sent
        self._latency_s += latency_s - POOLED * self._latency_s

    def may_reach(self, away_m: float) -> bool:
        """Whether a distance [m], but for rounding, is as far as that of one of the two."""
        return away_m >= NEARLY * self._reach_m

    def note_distance(self, sender: int, away_m: float) -> None:
        """Note from how far a neighbour was heard [m].

        The reach is the second farthest: a neighbour that lies about its position cannot stretch
        it. While only one neighbour was heard, there is only that one.
        """
        farthest = self._farthest_m
        farthest[sender] = max(farthest.get(sender, 0.0), away_m)
        if len(farthest) > WITNESSES:
            del farthest[min(farthest, key=farthest.__getitem__)]
        if len(farthest) == WITNESSES:
            self._reach_m = min(farthest.values())

    def link(self) -> Link:
        """Return the quality now."""
        if self._beacons == 0.0:
            return UNHEARD
        reach_m = inf
        for away_m in self._farthest_m.values():
            reach_m = min(reach_m, away_m)
        return Link(
            loss=max(0.0, 1.0 - self._beacons / self._sent),
            latency_s=self._latency_s / self._beacons,
            reach_m=reach_m,
        )


class Neighbour:
    """One neighbour: its last beacon, and the radio's quality estimated from its sequence."""

    __slots__ = ("beacon", "echoed_s", "id", "latency_s", "mean_gap")

    def __init__(self, beacon: HeardBeacon, latency_s: float) -> None:
        self.id = beacon.id
        self.beacon = beacon
        self.latency_s = latency_s
        self.mean_gap = 1.0
        self.echoed_s = -inf
        """When it last echoed an own beacon [s]."""

    def update(self, beacon: HeardBeacon, latency_s: float, beacon_hz: float) -> float:
        """Take a newer beacon; return how many the sender has sent since the last one.

        latency_s: its delay [s]; beacon_hz: the expected rate [Hz].
        """
        last, version = self.beacon.version, beacon.version
        gap = 1.0
        if version.incarnation == last.incarnation:
            gap = float(version.sequence - last.sequence)
            if gap != 1:
                # An invented sequence must not make a long silence seem likely.
                most = 2.0 + 2.0 * (version.stamp_s - last.stamp_s) * beacon_hz
                gap = min(max(gap, 1), most)
            self.mean_gap += SMOOTHING * (gap - self.mean_gap)
        self.latency_s += SMOOTHING * (latency_s - self.latency_s)
        self.beacon = beacon
        return gap

    def silence_s(self, beacon_hz: float) -> float:
        """Return T_lost of E17 [s]: after a longer silence the neighbour counts as gone.

        At the measured loss, chance alone makes such a silence once in a million gaps.
        """
        loss = 1.0 - 1.0 / max(self.mean_gap, 1.0)
        missed = MARGIN * LOG_FALSE_ALARM / log(loss) if loss > 1e-9 else 0.0
        return max(LEAST_SILENCE_S, missed / beacon_hz) + self.latency_s


class Neighbours:
    """The neighbours of one agent, with ``sorted_ids``: the ids heard directly.

    beacon_hz: expected beacon rate of each neighbour [Hz]. slack_s: how far a stamp may lie ahead
    of the own observation [s], since a message can overtake an observation.
    """

    def __init__(self, own_id: int, beacon_hz: float, slack_s: float) -> None:
        self._own_id = own_id
        self._beacon_hz = beacon_hz
        self._slack_s = slack_s
        self._known: dict[int, Neighbour] = {}
        self._in_order: list[Neighbour] = []
        self.sorted_ids: tuple[int, ...] = ()
        self._last: dict[int, Version] = {}
        self._quality = LinkQuality()

    def receive(self, beacon: HeardBeacon, now_s: float, own_sent_s: dict[int, float]) -> None:
        """Take a beacon, or raise RejectedError for a replay or an implausible stamp.

        own_sent_s: sending time of each recent own sequence [s]. A beacon that echoes a sequence
        was sent after it (E22), whatever its stamp says.
        """
        sender, version = beacon.id, beacon.version
        if sender == self._own_id:
            raise RejectedError("spoofed", "a beacon with the receiver's own id")
        known = self._known.get(sender)
        last = known.beacon.version if known is not None else self._last.get(sender, NEVER_HEARD)
        if not version.supersedes(last):
            raise RejectedError("replay", f"{version} of agent {sender} is not new")
        age_s = now_s - version.stamp_s
        if age_s < -self._slack_s:
            raise RejectedError("future", f"the stamp is {-age_s:.3f} s ahead")
        if age_s > MAX_AGE_S:
            raise RejectedError("old", f"the stamp is {age_s:.3f} s old")
        # A fresh stamp is later than every own beacon; only an old one can contradict its echo.
        echoed = beacon.echo_of(self._own_id)
        sent_s = own_sent_s.get(echoed, -inf) if echoed >= 0 else -inf
        if age_s > self._slack_s and version.stamp_s + self._slack_s < sent_s:
            raise RejectedError("offset", "the stamp is older than a beacon that it echoes")
        latency_s = age_s if age_s > 0.0 else 0.0
        if known is not None:
            gap = known.update(beacon, latency_s, self._beacon_hz)
        else:
            gap, known = 1.0, Neighbour(beacon, latency_s)
            self._known[sender] = known
            self._put_in_order()
        self._quality.note(gap, latency_s)
        if echoed >= 0:
            known.echoed_s = version.stamp_s

    def link(self, here: Vector) -> Link:
        """Return the radio's quality as measured. here: own position [m; world frame]."""
        for known in self._in_order:
            there = known.beacon.position
            if self._quality.may_reach(apart(here, there)):
                self._quality.note_distance(known.id, dist(here, there))
        return self._quality.link()

    @property
    def ids(self) -> Collection[int]:
        """The ids heard directly, for membership tests."""
        return self._known.keys()

    def forget_silent(self, now_s: float) -> dict[int, float]:
        """Drop neighbours whose silence is longer than chance explains.

        Returns for each of them a time [s]: a relayed record with a stamp up to then adds nothing
        to the neighbour's own last beacon, for others may have heard a few beacons more.
        """
        gone = {
            sender: stamp_s + HEARD_BY_OTHERS * known.silence_s(self._beacon_hz)
            for sender, known in self._known.items()
            if now_s - (stamp_s := known.beacon.stamp_s) > LEAST_SILENCE_S
            and now_s - stamp_s > known.silence_s(self._beacon_hz)
        }
        for sender in gone:
            self._last[sender] = self._known.pop(sender).beacon.version
        if gone:
            self._put_in_order()
        return gone

    def silences_s(self) -> dict[int, float]:
        """Return the allowed silence T_lost of each neighbour [s]."""
        return {sender: each.silence_s(self._beacon_hz) for sender, each in self._known.items()}

    def heard(self, now_s: float, mission: int = 0) -> tuple[Heard, ...]:
        """Return all neighbours, extrapolated to now, sorted by id.

        mission: key of the own mission; a place claimed in another mission is left out.
        """
        heard = []
        for known in self._in_order:
            beacon = known.beacon
            since_s = now_s - beacon.stamp_s
            age_s = since_s if since_s > 0.0 else 0.0
            along = age_s if age_s < MAX_EXTRAPOLATION_S else MAX_EXTRAPOLATION_S
            x, y, z = beacon.position
            u, v, w = velocity = beacon.velocity
            position = (x + along * u, y + along * v, z + along * w)
            flown = beacon.mission
            heard.append(
                Heard(
                    id=known.id,
                    age_s=age_s,
                    position=position,
                    velocity=velocity,
                    target=beacon.target,
                    place=beacon.place if flown == mission else None,
                    mission=flown,
                    cost_m=beacon.cost_mm / 1000.0,
                    standing=beacon.standing,
                    hears_me=now_s - known.echoed_s <= ECHO_LASTS_S,
                )
            )
        return tuple(heard)

    def any_behind(self, mission: int) -> bool:
        """Whether any neighbour flies an older mission than the one with this key, or none."""
        return any(known.beacon.mission < mission for known in self._in_order)

    def beacons(self) -> list[HeardBeacon]:
        """Return the last beacon of each neighbour, sorted by id."""
        return [each.beacon for each in self._in_order]

    def echoes(self) -> tuple[tuple[int, int], ...]:
        """Return (id, last sequence heard) of each neighbour, sorted by id."""
        return tuple([(each.id, each.beacon.version.sequence) for each in self._in_order])

    def _put_in_order(self) -> None:
        self.sorted_ids = tuple(sorted(self._known))
        self._in_order = [self._known[sender] for sender in self.sorted_ids]
