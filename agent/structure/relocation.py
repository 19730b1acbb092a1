"""Where a team that is given another mission goes from the places that it holds.

Who holds a place knows the places of all others: they are the layout for the size of the team. So
each member finds the same plan from all old places to the new ones, without a word, and takes what
follows from its own. The plan is that of the assignment: the nearest first, then exchanges of two
until none gains. Of those with the same sum it is one whose longest ways are short. It sends nobody
to where a vehicle hovers in a place of old.
"""

from functools import lru_cache
from math import dist, remainder, tau
from typing import Final, NamedTuple, final

from agent.assignment.allocation import allocate
from agent.controller import Flown, Peer
from agent.messages import Place
from agent.places.place_points import PlacePoints
from agent.qstructure.formation import Formation
from agent.qstructure.target_frame import Frame
from agent.structure.longest_way import shortened

PLANS_KEPT: Final = 16
SAME_M, SAME_RAD = 0.05, 0.02
"""Two frames nearer to each other than this are one, known at different times."""


@final
class Held:
    """What a member held in a mission: its place in a team of so many members."""

    def __init__(
        self,
        place: Place,
        members: int,
        blocked: frozenset[Place],
        mission: Flown,  # with the frame at the time at_s
        at_s: float,  # [s]
    ) -> None:
        self.place = place
        self.members = members
        self.blocked = blocked
        self.mission = mission
        self.at_s = at_s


class Relocated(NamedTuple):
    """The place of a member in a new mission, and the size of its team."""

    place: Place
    members: int


def relocated(held: Held, mission: Flown, now_s: float, spacing_m: float) -> Relocated | None:
    """Return what follows from the place held before; None where others may find another plan.

    Members learn of a mission at different times, so both frames must be at rest, or the same.
    """
    old, new = held.mission.frame, mission.frame
    if _is_same(_later(old, now_s - held.at_s), new):
        old = new = Frame()
    elif old.moves or new.moves:
        return None
    move = _Move(held.mission.formation, mission.formation, held.members, held.blocked, spacing_m)
    place = _plan(move, (*old.origin, old.yaw), (*new.origin, new.yaw)).get(held.place)
    return Relocated(place, held.members) if place is not None else None


class _Move(NamedTuple):
    """The change of a team's formation."""

    before: Formation
    after: Formation
    members: int
    blocked: frozenset[Place]
    spacing_m: float


_Pose = tuple[float, float, float, float]
"""Origin [m; world frame] and yaw [rad] of a frame."""


@lru_cache(PLANS_KEPT)
def _plan(move: _Move, old_pose: _Pose, new_pose: _Pose) -> dict[Place, Place]:
    """Return the new place of each old one; nothing where a team of that size has not room."""
    here, there = (Frame(pose[:3], pose[3]) for pose in (old_pose, new_pose))
    old = move.before.layout(move.members, move.blocked)
    new = move.after.layout(move.members, _taken(move, here, there))
    if not old.places or len(new.places) != len(old.places):
        return {}
    starts = [here.to_world(old.slots[place].point) for place in old.places]
    ends = [there.to_world(new.slots[place].point) for place in new.places]
    # The old places are no claims on the new ones: those of one name may be far from each other.
    team = [Peer(k, start, None) for k, start in enumerate(starts)]
    column_of = {place: column for column, place in enumerate(new.places)}
    found = allocate(team, new.places, ends, hysteresis_m2=0.0)
    columns = [column_of[place] for place in found.values() if place is not None]
    columns = shortened(columns, starts, ends, move.spacing_m)
    return {place: new.places[k] for place, k in zip(old.places, columns, strict=True)}


def _taken(move: _Move, here: Frame, there: Frame) -> frozenset[Place]:
    """Return the new places at those of old that are blocked: the vehicles there stay."""
    slots = [move.before.slot(place, move.members) for place in sorted(move.blocked)]
    points = [here.to_world(slot.point) for slot in slots if slot is not None]
    mission = Flown(0, move.after, there)
    return PlacePoints(move.spacing_m).taken_by(mission, move.members, points)


def _later(frame: Frame, after_s: float) -> Frame:
    """Return a frame after a time in which it went on as it did."""
    (x, y, z), (u, v, w) = frame.origin, frame.velocity
    origin = (x + after_s * u, y + after_s * v, z + after_s * w)
    return Frame(origin, frame.yaw + after_s * frame.yaw_rate, frame.velocity, frame.yaw_rate)


def _is_same(a: Frame, b: Frame) -> bool:
    return dist(a.origin, b.origin) < SAME_M and abs(remainder(a.yaw - b.yaw, tau)) < SAME_RAD
