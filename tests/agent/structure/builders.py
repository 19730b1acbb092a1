"""Builders for the Q-structure's tests: a test names only the fields that matter to it."""

from operator import attrgetter

import msgspec

from agent.config import AgentSetup, Comms, Control, Vehicle
from agent.controller import Heard, Link
from agent.heard_beacon import HeardStanding
from agent.messages import ZERO, LeaderSummary, RootKey, Standing, Subtree
from agent.qstructure.formation import Formation, FormationSpec, QueueSpec
from agent.qstructure.shape import Ray
from agent.qstructure.target_frame import Frame
from agent.structure.gathering import Gathering
from agent.structure.label_code import FIRST_QUEUE, UNPLACED, of_vertex
from agent.structure.link_timing import Timing
from agent.structure.queue_map import QueueMap
from agent.structure.view import View
from worldsim.scenario.file import formation_tables
from worldsim.scenario.library import FORMATIONS

LIBRARY = sorted(FORMATIONS.glob("*.toml"))
BEACON_S = 0.05


def rays(*directions, capacities=None):
    """Return the map of open queues that begin at one vertex in the origin."""
    capacities = capacities or [1.0 / len(directions)] * len(directions)
    queues = tuple(
        QueueSpec(f"Q{j}", ("V",), Ray(direction), capacity)
        for j, (direction, capacity) in enumerate(zip(directions, capacities, strict=True))
    )
    return QueueMap(Formation(FormationSpec("rays", {"V": ZERO}, queues), 1.0))


def lines(*vertices):
    """Return the map of open queues along -x, each from a vertex of its own [m]."""
    share = 1.0 / len(vertices)
    queues = tuple(
        QueueSpec(f"Q{j}", (f"V{j}",), Ray((-1.0, 0.0, 0.0)), share) for j in range(len(vertices))
    )
    points = {f"V{j}": point for j, point in enumerate(vertices)}
    return QueueMap(Formation(FormationSpec("lines", points, queues), 1.0))


LINE = lines(ZERO)
TWO = rays((-1.0, 1.0, 0.0), (-1.0, -1.0, 0.0))


def library(path):
    """Return the map of a formation of the library."""
    spec = msgspec.convert(formation_tables(path), FormationSpec)
    return QueueMap(Formation(spec, 1.0))


def standing(**fields):
    """Return a standing; by default of a member of the first queue that knows no root."""
    leads, queue = fields.get("leads", -1), fields.get("queue", 0)
    code = of_vertex(leads) if leads >= 0 else FIRST_QUEUE + queue if queue >= 0 else UNPLACED
    defaults = {
        "branches": (),
        "leads": -1,
        "queue": 0,
        "heard": 1,
        "pushes": False,
        "proposal": None,
        "reservation": None,
        "code": code,
    }
    return Standing(**{**defaults, **fields})


def heard(
    agent, at=ZERO, place=None, *, velocity=ZERO, age_s=0.0, cost_m=0.0, hears_me=True, **fields
):
    """Return a neighbour; the other fields are those of its standing."""
    return Heard(
        id=agent,
        age_s=age_s,
        position=at,
        velocity=velocity,
        target=at,
        place=place,
        cost_m=cost_m,
        standing=HeardStanding(standing(**fields)),
        hears_me=hears_me,
    )


def leader_summary(**fields):
    """Return a leader's summary; by default of a steady team of nobody."""
    defaults = {
        "root": RootKey(0, 0),
        "version": 0,
        "total": 0,
        "counts": (),
        "highest": (),
        "histogram": b"",
        "go": True,
        "order": 0,
        "orders": (),
        "blocked": (),
    }
    return LeaderSummary(**{**defaults, **fields})


def subtree(**fields):
    """Return what came up the tiers; by default of nobody."""
    return Subtree(**{"highest": (), "histogram": b"", "candidates": (), "blocked": (), **fields})


def view(formation, now_s, neighbours=(), *, at=ZERO, link=None, summaries=None, blocked=()):
    """Return an agent's view. link: of a radio without loss or latency if left out."""
    made = View(now_s, at, sorted(neighbours, key=attrgetter("id")), 0, formation, Frame())
    made.timing = Timing(link or Link(0.0, 0.0, 100.0), BEACON_S)
    made.summaries = summaries if summaries is not None else [None] * formation.vertices
    made.blocked = frozenset(blocked)
    return made


def gathering(formation=LINE, own_id=1):
    """Return an agent's part in gathering."""
    setup = AgentSetup(
        id=own_id,
        incarnation=0,
        tick_hz=20.0,
        slots_per_tick=4,
        command_ticks=2,
        vehicle=Vehicle(),
        fleet_max_speed_mps=0.5,
        control=Control(gather=True),
        comms=Comms(),
        formation=FormationSpec("f", {}, ()),
    )
    return Gathering(setup, formation)


def replace(struct, **fields):
    """Return a copy of a message with other values of some fields."""
    return msgspec.structs.replace(struct, **fields)
