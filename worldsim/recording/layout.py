"""Entity paths, component names and file names of a recording: the contract for every reader.

Row i of every batch entity is agent i. The number of rows never changes; NaN means that the
vehicle is not in the world.
"""

RECORDING_FILE = "run.rrd"
SUMMARY_FILE = "summary.json"
"""Names in a run's folder."""

SIM_TIME = "sim_time"
TICK = "tick"

WORLD = "/world"
AGENTS = f"{WORLD}/agents"
VEHICLES = f"{WORLD}/vehicles"
TARGETS = f"{WORLD}/targets"
CAST_ZONES = f"{WORLD}/guidance/cast_zones"
BOBBERS = f"{WORLD}/guidance/bobbers"
WAYS = f"{WORLD}/guidance/ways"
GUIDING_LINES = f"{WORLD}/guidance/guiding_lines"
CONSTELLATION = f"{WORLD}/guidance/constellation"
RAYS = f"{WORLD}/sensing/rays"
BELIEFS = f"{WORLD}/beliefs"
LINKS = f"{WORLD}/links"
"""Pairs of agents of which one hears the other; below it, those of which one does not."""
LINKS_LOST = f"{LINKS}/lost"
LINKS_CUT = f"{LINKS}/cut"
LINKS_OUT_OF_RANGE = f"{LINKS}/out_of_range"
JAMS = f"{WORLD}/jams"
SIDES = f"{WORLD}/sides"
PAUSED = f"{WORLD}/paused"
DEAD = f"{WORLD}/dead"
HIERARCHY = f"{WORLD}/hierarchy"
FORMATION = f"{WORLD}/formation"
"""The transform from the target's frame to the world; what is below it is in the target's frame."""
FORMATION_BEFORE = f"{WORLD}/formation_before"
"""The same of the mission before, while some agents still fly it."""
SLOTS_PART, SPHERES_PART, QUEUES_PART = "slots", "arrived", "queues"
"""What is below the entity of a formation."""
TEAM = f"{WORLD}/team"
"""The camera's frame: amid the running agents, its unit the distance of the farthest one."""
GROUND = f"{WORLD}/ground"
OBSTACLES = f"{WORLD}/obstacles"
MOVING_OBSTACLES = f"{OBSTACLES}/moving"

METRICS = "/metrics"
FORCE = f"{METRICS}/force"
SEPARATION = f"{METRICS}/separation"
TURN_DEG = f"{METRICS}/turn_deg"
SLOT_ERROR = f"{METRICS}/slot_error"
OBSTACLE_DISTANCE = f"{METRICS}/obstacle_distance"
TIER = f"{METRICS}/tier"
RECORD_AGE = f"{METRICS}/record_age"
NEIGHBOURS = f"{METRICS}/neighbours"
BELIEF_ERROR = f"{METRICS}/belief_error"
SAFETY_FILTER = f"{METRICS}/safety_filter"
QUEUE_RESIDUAL = f"{METRICS}/queue_residual"
PACKETS = f"{METRICS}/packets"
LAMBDA2 = f"{METRICS}/lambda2"
LINK_COUNTS = f"{METRICS}/links"

SIGNALS = "/signals"
"""Below it: what controllers state of themselves, by its name."""
DATAGRAMS_SENT = f"{METRICS}/datagrams/sent"
DATAGRAMS_RECEIVED = f"{METRICS}/datagrams/received"
DATAGRAM_AGE = f"{METRICS}/datagrams/age"

EVENTS = "/log/events"
ROLES = "/roles"
PHASE = "/phase"
TEAM_PHASE = f"{PHASE}/team"
CONDITIONS = "/conditions"
RADIO_CONDITION = f"{CONDITIONS}/radio"
SCENARIO = "/run/scenario"
VERDICT = "/run/verdict"
PANELS = "/run/about"
RUN_PROPERTIES = "/__properties/run"

AGENT_STATE = "/state/agents"
MISSION_STATE = "/state/missions"
LINK_STATE = "/state/links"
"""Entities of a part of the state in older recordings; now all of it has one."""

POSITIONS = "Points3D:positions"
SCALARS = "Scalars:scalars"
SERIES_NAMES = "SeriesLines:names"
"""Components of rerun's own archetypes that a reader needs."""
POSITION = "position"
PLACE = "place"
ALIVE = "alive"
ATTITUDE = "attitude"
MISSION = "mission"
HEARS = "hears"
EVENT = "event"
MODE = "mode"
"""Components of qswarm's own: read back, but not shown."""

FEW_MAX = 25
"""With more agents, what takes time for each agent or pair of them, or more, has half its rate."""
NAMED_MAX = 50
"""With more agents, vehicles have no visible labels and roles are not recorded."""


def agent_name(agent: int) -> str:
    """Return the name of an agent as the viewer shows it."""
    return f"a{agent}"


def agent_names(agents: int) -> list[str]:
    """Return the names of agents 0 to ``agents`` - 1."""
    return [agent_name(agent) for agent in range(agents)]


def agent_metrics(obstacles: bool) -> tuple[str, ...]:
    """Return the metrics with one series for each agent; obstacles: whether there are any."""
    measured = (FORCE, SEPARATION, TURN_DEG, SLOT_ERROR)
    distance = (OBSTACLE_DISTANCE,) if obstacles else ()
    reported = (TIER, RECORD_AGE, NEIGHBOURS, BELIEF_ERROR, SAFETY_FILTER)
    return (*measured, *distance, *reported)


def role_entity(agent: int) -> str:
    """Return the entity that holds an agent's role over time."""
    return f"{ROLES}/{agent_name(agent)}"


def condition_entity(agent: int) -> str:
    """Return the entity that holds what is wrong with an agent over time."""
    return f"{CONDITIONS}/{agent_name(agent)}"


def panel_entity(question: str) -> str:
    """Return the entity that holds the panel of words of a tab of the layout."""
    return f"{PANELS}/{question}"


def limit_entity(metric: str) -> str:
    """Return the entity that holds a metric's reference lines."""
    return f"{metric}/limit"


def signal_entity(name: str) -> str:
    """Return the entity that holds one of the controllers' signals."""
    return f"{SIGNALS}/{name}"


def signal_name(entity: str) -> str | None:
    """Return the name of the signal that an entity holds; None for other entities."""
    prefix = f"{SIGNALS}/"
    return entity.removeprefix(prefix) if entity.startswith(prefix) else None


def packet_entity(counter: str) -> str:
    """Return the entity that holds one of the medium's packet counters."""
    return f"{PACKETS}/{counter}"


def packet_counter(entity: str) -> str | None:
    """Return the name of the packet counter that an entity holds; None for other entities."""
    prefix = f"{PACKETS}/"
    return entity.removeprefix(prefix) if entity.startswith(prefix) else None
