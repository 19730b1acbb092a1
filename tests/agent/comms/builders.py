"""Builders of messages and members for tests: a test names only the fields that matter to it."""

from agent.controller import Peer
from agent.heard_beacon import HeardBeacon
from agent.messages import HOME, MAX_PLACES, Beacon, Gossip, Place, Record

ORIGIN = (0.0, 0.0, 0.0)
AT_REST = (0.0, 0.0, 0.0)
GREATEST = 2**53 - 1
FAR = -999_999.9
LATE_S = 999_999_999.9


def beacon(sender, sequence, stamp_s, *, at=ORIGIN, echoes=(), **fields):
    """Return a beacon; by default of an agent at rest at the origin that claims nothing."""
    defaults = {
        "incarnation": 0,
        "velocity": AT_REST,
        "target": ORIGIN,
        "queue": -1,
        "rank": -1,
        "cost_mm": 0,
        "speed_cap": 0.5,
        "mission": 0,
        "frame_key": 0,
        "frame": HOME,
        "drift": None,
        "blocked": (),
        "standing": None,
    }
    return Beacon(
        id=sender,
        sequence=sequence,
        stamp_s=stamp_s,
        position=at,
        echoes=tuple(echoes),
        **{**defaults, **fields},
    )


def heard_beacon(sender, sequence, stamp_s, **fields):
    """Return a beacon as its receivers use it."""
    return HeardBeacon(beacon(sender, sequence, stamp_s, **fields))


def record(subject, version, stamp_s=0.0, *, incarnation=0, at=ORIGIN, queue=-1, rank=-1):
    """Return a record; by default of an agent at the origin without a place."""
    return Record(
        id=subject,
        incarnation=incarnation,
        version=version,
        stamp_s=stamp_s,
        position=at,
        queue=queue,
        rank=rank,
        cost_mm=0,
        mission=0,
        blocked=(),
    )


def greatest_record(subject):
    """Return a record whose numbers have the longest encoding of their types."""
    return Record(
        id=subject,
        incarnation=GREATEST,
        version=GREATEST,
        stamp_s=LATE_S,
        position=(FAR, FAR, FAR),
        queue=2**15 - 1,
        rank=2**15 - 1,
        cost_mm=2**31 - 1,
        mission=GREATEST,
        blocked=(Place(2**15 - 1, 2**15 - 1),) * MAX_PLACES,
    )


def gossip(sender, stamp_s, records=(), piece=None, summary=None):
    """Return a frame of the multihop channel."""
    return Gossip(id=sender, stamp_s=stamp_s, records=tuple(records), piece=piece, summary=summary)


def peer(agent_id, at=ORIGIN, place=None):
    """Return a member of the team."""
    return Peer(id=agent_id, position=at, place=place)


def places(count):
    """Return the first ``count`` places of one queue."""
    return [Place(0, rank) for rank in range(count)]
