"""Messages and members as the tests need them: only what matters is named."""

from agent.controller import Peer
from agent.messages import HOME, Beacon, Place, Record

ORIGIN = (0.0, 0.0, 0.0)
AT_REST = (0.0, 0.0, 0.0)
GREATEST = 2**53 - 1
FAR = -999_999.9
LATE_S = 999_999_999.9
UNLED = (0, 0, HOME, None, -1, -1, 0, ())
"""The tail of a beacon without a new mission or a parent."""


def beacon(who, sequence, stamp_s, *, incarnation=0, at=ORIGIN, velocity=AT_REST, echoes=()):
    """Return a beacon of an agent at rest at the origin that claims no place."""
    told = (at, velocity, ORIGIN, -1, -1, 0, 0.5, tuple(echoes), *UNLED)
    return Beacon(who, incarnation, sequence, stamp_s, *told)


def record(who, version, stamp_s=0.0, *, incarnation=0, at=ORIGIN, queue=-1, rank=-1):
    """Return a record of an agent at the origin that claims no place."""
    return Record(who, incarnation, version, stamp_s, at, queue, rank, 0, 0, ())


def greatest_record(who):
    """Return a record whose numbers take as many bytes as numbers of their type can."""
    at = (FAR, FAR, FAR)
    blocked = (Place(2**15 - 1, 2**15 - 1),) * 8
    claim = (2**15 - 1, 2**15 - 1, 2**31 - 1)
    return Record(who, GREATEST, GREATEST, LATE_S, at, *claim, GREATEST, blocked)


def peer(who, at=ORIGIN, place=None):
    """Return a member of the team."""
    return Peer(who, at, place)


def places(count):
    """Return so many places, all of one queue."""
    return [Place(0, rank) for rank in range(count)]
