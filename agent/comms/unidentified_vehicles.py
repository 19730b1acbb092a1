"""Unidentified vehicles: sensed and stationary, but no member of the team (E18).

The vehicle of a dead agent may hover in a slot. An agent that senses a vehicle for long enough, and
knows of no member there, takes it for unidentified. It remembers the vehicle out of the sensor's
range until the vehicle is known to have left, or may be a new member: a place that agents forget
and find occupied again makes them move to and fro.

Where nobody sees the vehicle leave, the memory ends by itself. It ends early where the agent, or a
neighbour that reports none there, would sense the vehicle if it had not moved. Each time that the
vehicle is found there again, its memory lasts twice as long: agents look after a dead vehicle ever
less often.

A sensor may reach farther than the radio: a vehicle counts as unidentified only within the distance
from which a member has ever been heard. Present neighbours do not decide this, for the last
survivor of a team has none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import Final, NamedTuple, final

from agent.heard_beacon import HeardBeacon
from agent.messages import PROXIMITY_RANGE_M, Vector
from agent.vectors import apart

SAME_VEHICLE_M: Final = 0.2
"""Two sightings nearer than this are the same vehicle, which then is stationary."""
SAME_MEMBER_M: Final = 0.4
"""A vehicle sensed nearer than this to where a member is reported is that member."""
UNIDENTIFIED_AFTER_S: Final = 1.5
RECENT_S: Final = 10.0
"""How long the last report or sight of a vehicle tells what a vehicle sensed near by may be."""
MAX_REMEMBERED: Final = 64
"""Most vehicles remembered out of the sensor's range; those seen last are kept."""
SURE_RANGE_M: Final = PROXIMITY_RANGE_M - SAME_VEHICLE_M
"""A vehicle nearer than this would be sensed if it were still there."""
UNMOVED_RANGE_M: Final = PROXIMITY_RANGE_M - 0.05
"""A vehicle last sensed nearer than this would be sensed if it had not moved since."""
REMEMBERED_S: Final = 60.0
"""How long a vehicle that nobody would sense is remembered at first."""
MISSED_S: Final = 1.5
"""How long one is that the agent or a neighbour would sense; a neighbour needs as long to report a
vehicle that it comes to sense."""

ReportsVehicle = Callable[[HeardBeacon, Vector], bool]
"""Whether a neighbour's beacon reports an unidentified vehicle at a position [m; world frame]."""


def _always(_witness: HeardBeacon, _vehicle: Vector) -> bool:
    return True


class _Track(NamedTuple):
    """A vehicle without an id, as tracked over time."""

    position: Vector  # [m; world frame]
    since_s: float  # at this position since [s]
    seen_s: float  # last sensed [s]
    others: frozenset[int]  # ids of members that were elsewhere while it was sensed
    last: Vector  # where it was sensed last [m; world frame]
    missed_s: float = inf  # since when it would be sensed if it had not moved [s]
    given_up: bool = False  # whether the memory has ended
    patience: float = 1.0  # by what factor the memory lasts longer than the first one

    def seen(self, now_s: float, at: Vector, members: frozenset[int]) -> _Track:
        """Return the track of a vehicle that is sensed now, at a position [m; world frame]."""
        others = self.others | members
        if self.given_up:
            return _Track(self.position, now_s, now_s, others, at, patience=2.0 * self.patience)
        return self._replace(seen_s=now_s, others=others, last=at, missed_s=inf)

    def unseen(self, now_s: float, *, missed: bool) -> _Track:
        """Return the track of a vehicle that the agent does not sense now.

        missed: whether the agent or a neighbour would sense it if it had not moved.
        """
        missed_s = min(self.missed_s, now_s) if missed else inf
        ended = (
            now_s - self.seen_s >= self.patience * REMEMBERED_S
            or now_s - missed_s >= self.patience * MISSED_S
        )
        return self._replace(missed_s=missed_s, given_up=self.given_up or ended)


@final
class MemberPosition:
    """A team member's last reported position."""

    def __init__(
        self,
        id: int,
        position: Vector,  # [m; world frame]
        age_s: float,  # age of the report [s]
    ) -> None:
        self.id = id
        self.position = position
        self.age_s = age_s


class DepartedMember(NamedTuple):
    """A member that fell silent, with its last report."""

    position: Vector  # [m; world frame]
    stamp_s: float  # time of the report [s]


@final
class Surroundings:
    """What an agent senses and knows of vehicles near by at one time."""

    def __init__(  # noqa: PLR0913, PLR0917
        self,
        now_s: float,  # [s]
        position: Vector,  # own [m; world frame]
        sensed: Sequence[Vector],  # vehicles, relative to ``position`` [m; world axes]
        beacons: Sequence[HeardBeacon],  # the last one of each neighbour
        team: Sequence[MemberPosition],  # all known members
        departed: Sequence[DepartedMember] = (),  # members that fell silent since the last update
        reports_vehicle: ReportsVehicle = _always,
    ) -> None:
        self.now_s = now_s
        self.position = position
        self.sensed = sensed
        self.beacons = beacons
        self.team = team
        self.departed = departed
        self.reports_vehicle = reports_vehicle


class UnidentifiedVehicles:
    """The unidentified vehicles that one agent knows of.

    max_speed: the limit of the fleet's fastest vehicle [m/s].
    """

    def __init__(self, max_speed: float) -> None:
        self._max_speed = max_speed
        self._tracks: list[_Track] = []
        self._departed: list[DepartedMember] = []
        self._heard_from_m = 0.0
        """The farthest distance from which a member has been heard [m]."""

    def update(self, around: Surroundings) -> tuple[Vector, ...]:
        """Return the positions of unidentified vehicles [m; world frame]."""
        self._note_departed(around)
        self._note_hearing_range(around)
        unknown = self._unknown(around)
        if not unknown and not self._tracks:
            return ()
        members = frozenset([member.id for member in around.team])
        tracks = [_followed(each, around, unknown, members) for each in self._tracks]
        new = [
            seen
            for seen in unknown
            if all(apart(track.position, seen) >= SAME_VEHICLE_M for track in tracks)
        ]
        sensed = [track for track in tracks if track.seen_s == around.now_s]
        lost = [track for track in tracks if track.seen_s < around.now_s]
        remembered = [track for track in lost if self._may_remain(track, around)]
        found = [self._new_track(seen, around.now_s, lost, members) for seen in new]
        self._tracks = remembered[-MAX_REMEMBERED:] + sensed + found
        return tuple(
            track.position
            for track in self._tracks
            if around.now_s - track.since_s >= UNIDENTIFIED_AFTER_S and not track.given_up
        )

    def _note_departed(self, around: Surroundings) -> None:
        if around.departed or self._departed:
            self._departed = [
                gone
                for gone in (*self._departed, *around.departed)
                if around.now_s - gone.stamp_s <= RECENT_S
            ]

    def _note_hearing_range(self, around: Surroundings) -> None:
        for beacon in around.beacons:
            away_m = apart(around.position, beacon.position)
            self._heard_from_m = max(self._heard_from_m, away_m)

    def _unknown(self, around: Surroundings) -> list[Vector]:
        """Return the sensed vehicles that are no member and within hearing range [m; world]."""
        reach_m = self._heard_from_m + SAME_VEHICLE_M
        return [
            vehicle
            for vehicle in _in_world(around.position, around.sensed)
            if apart(around.position, vehicle) <= reach_m
            and not self._is_member(vehicle, around.team)
        ]

    def _new_track(
        self, vehicle: Vector, now_s: float, lost: Sequence[_Track], members: frozenset[int]
    ) -> _Track:
        """Return the track of a vehicle first sensed now.

        Where a member fell silent, the vehicle counts as silent since then. lost: the tracks no
        longer sensed; one of them may have flown on to here, and then is not stationary yet.
        """
        since_s = min(
            (
                gone.stamp_s
                for gone in self._departed
                if apart(gone.position, vehicle) < SAME_MEMBER_M
            ),
            default=now_s,
        )
        moved = any(
            apart(each.position, vehicle) < SAME_VEHICLE_M + self._max_speed * (now_s - each.seen_s)
            for each in lost
            if now_s - each.seen_s <= RECENT_S
        )
        return _Track(vehicle, now_s if moved else since_s, now_s, members, vehicle)

    def _may_remain(self, track: _Track, around: Surroundings) -> bool:
        """Whether a vehicle that is not sensed now is still taken to be where it hovered."""
        return (
            track.seen_s - track.since_s >= UNIDENTIFIED_AFTER_S
            and apart(track.position, around.position) > SURE_RANGE_M
            and not self._is_member(track.position, around.team)
            and not self._may_have_joined(track, around)
        )

    def _may_have_joined(self, track: _Track, around: Surroundings) -> bool:
        """Whether a member first heard since the vehicle was sensed may be that vehicle."""
        return any(
            member.id not in track.others
            and apart(track.position, member.position)
            < SAME_MEMBER_M + self._max_speed * (around.now_s - track.seen_s)
            for member in around.team
        )

    def _is_member(self, vehicle: Vector, team: Sequence[MemberPosition]) -> bool:
        """Whether a member may be there by now, having moved on since its last report."""
        for member in team:
            if apart(vehicle, member.position) < SAME_MEMBER_M + self._max_speed * member.age_s:
                return True
        return False


def _followed(
    track: _Track, around: Surroundings, sensed: Sequence[Vector], members: frozenset[int]
) -> _Track:
    """Return a track as it is now. sensed: the unidentified vehicles [m; world frame]."""
    for vehicle in sensed:
        if apart(track.position, vehicle) < SAME_VEHICLE_M:
            return track.seen(around.now_s, vehicle, members)
    return track.unseen(around.now_s, missed=_is_missed(track, around))


def _is_missed(track: _Track, around: Surroundings) -> bool:
    """Whether the agent would sense a vehicle that has not moved, or a neighbour reports none."""
    return apart(track.last, around.position) < UNMOVED_RANGE_M or any(
        apart(track.last, witness.position) < UNMOVED_RANGE_M
        and not around.reports_vehicle(witness, track.position)
        for witness in around.beacons
    )


def _in_world(position: Vector, sensed: Sequence[Vector]) -> list[Vector]:
    return [(position[0] + x, position[1] + y, position[2] + z) for x, y, z in sensed]
