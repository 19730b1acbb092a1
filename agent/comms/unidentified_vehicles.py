"""Silent bodies: vehicles that are sensed and stay put, but from which nothing is heard (E18).

A dead agent's vehicle may hover in a slot. Whoever senses it long enough without knowing of anybody
there takes it for what it is, and remembers it while out of the sensor's range. A sensor may see
farther than a radio hears: a body is silent only if others as far away are heard.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import dist
from typing import NamedTuple

import msgspec

from agent.messages import Beacon, Vector

SAME_BODY_M = 0.2
NEIGHBOUR_M = 0.4
SILENCE_S = 1.5
MEMORY_S = 10.0
"""So long a body is remembered out of sight; whoever comes near will see it again."""
SURE_RANGE_M = 1.8
"""Nearer than this a body would be sensed if it were still there."""

WITNESS_M = 1.3
"""Nearer than this to where a body was, whoever tells of none there says that it is gone."""
TellsOf = Callable[[Beacon, Vector], bool]


class _Body(NamedTuple):
    """A body without a name: where it stands [m; world frame], since when, and when last seen."""

    position: Vector
    since_s: float
    seen_s: float

    def seen_again(self, now_s: float, sensed: Sequence[Vector]) -> _Body:
        near = any(dist(self.position, each) < SAME_BODY_M for each in sensed)
        return self._replace(seen_s=now_s) if near else self


class Member(msgspec.Struct, frozen=True, gc=False):
    """A member of the team as last told of: where it was [m; world frame], and how long ago [s]."""

    position: Vector
    age_s: float


class Departed(NamedTuple):
    """A member that fell silent: where it was [m; world frame] when it last spoke [s]."""

    position: Vector
    stamp_s: float


class UnidentifiedVehicles:
    """The silent bodies that one agent knows of. max_speed: the fastest vehicle's limit [m/s]."""

    def __init__(self, max_speed: float) -> None:
        self._max_speed = max_speed
        self._bodies: list[_Body] = []
        self._departed: list[Departed] = []

    def look(
        self,
        now_s: float,
        position: Vector,
        sensed: Sequence[Vector],
        heard: Sequence[Beacon],
        team: Sequence[Member],
        departed: Sequence[Departed] = (),
        tells_of: TellsOf = lambda _witness, _body: True,
    ) -> tuple[Vector, ...]:
        """Return where silent bodies stand [m; world frame].

        sensed: bodies relative to ``position`` [m; world axes]; heard: the last beacons of those
        who are heard directly; team: all members known; departed: who was one until now; tells_of:
        whether a neighbour tells of a body there.
        """
        if departed or self._departed:
            self._departed = [
                gone for gone in (*self._departed, *departed) if now_s - gone.stamp_s <= MEMORY_S
            ]
        unknown = [body for body in _in_world(position, sensed) if not self._explained(body, team)]
        if unknown:
            reach = max((dist(position, each.position) for each in heard), default=0.0)
            reach += SAME_BODY_M
            unknown = [body for body in unknown if dist(position, body) <= reach]
        if not unknown and not self._bodies:
            return ()
        known = [each.seen_again(now_s, unknown) for each in self._bodies]
        new = [
            seen
            for seen in unknown
            if all(dist(body.position, seen) >= SAME_BODY_M for body in known)
        ]
        lost = [body for body in known if body.seen_s < now_s]
        kept = [
            body
            for body in known
            if body.seen_s == now_s
            or (
                self._remembered(body, now_s, position, team)
                and not _refuted(body, heard, tells_of)
            )
        ]
        self._bodies = kept + [self._found(seen, now_s, lost) for seen in new]
        return tuple(body.position for body in self._bodies if now_s - body.since_s >= SILENCE_S)

    def _found(self, body: Vector, now_s: float, lost: Sequence[_Body]) -> _Body:
        """Return a body found now; where a member fell silent, it is as silent as that one.

        lost: those no longer seen; one of them that has flown on stands nowhere yet.
        """
        since_s = min(
            (gone.stamp_s for gone in self._departed if dist(gone.position, body) < NEIGHBOUR_M),
            default=now_s,
        )
        flown = any(
            dist(each.position, body) < SAME_BODY_M + self._max_speed * (now_s - each.seen_s)
            for each in lost
        )
        return _Body(body, now_s if flown else since_s, now_s)

    def _remembered(
        self, body: _Body, now_s: float, position: Vector, team: Sequence[Member]
    ) -> bool:
        """Whether a body that is not sensed now may still be there: one that was seen to stand."""
        out_of_sight = dist(body.position, position) > SURE_RANGE_M
        recent = now_s - body.seen_s <= MEMORY_S and body.seen_s - body.since_s >= SILENCE_S
        return out_of_sight and recent and not self._explained(body.position, team)

    def _explained(self, body: Vector, team: Sequence[Member]) -> bool:
        """Whether a member may be there by now: told of long ago, it may have moved on."""
        for member in team:
            if dist(body, member.position) < NEIGHBOUR_M + self._max_speed * member.age_s:
                return True
        return False


def _refuted(body: _Body, heard: Sequence[Beacon], tells_of: TellsOf) -> bool:
    """Whether a neighbour who would see a body tells of none."""
    return any(
        dist(witness.position, body.position) <= WITNESS_M and not tells_of(witness, body.position)
        for witness in heard
    )


def _in_world(position: Vector, sensed: Sequence[Vector]) -> list[Vector]:
    return [(position[0] + x, position[1] + y, position[2] + z) for x, y, z in sensed]
