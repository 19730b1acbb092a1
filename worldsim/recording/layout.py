"""Where everything stands in a recording: the contract between who writes and who reads.

Row i of every batch is agent i; the number of rows never changes; NaN is no vehicle in the world.
"""

SIM_TIME = "sim_time"
TICK = "tick"

AGENTS = "/world/agents"
VEHICLES = "/world/vehicles"
TARGETS = "/world/targets"
LINKS = "/world/links"
HIERARCHY = "/world/hierarchy"
SLOTS = "/world/formation/slots"
ARRIVED = "/world/formation/arrived"
QUEUES = "/world/formation/queues"
OBSTACLES = "/world/obstacles"
MOVING = "/world/obstacles/moving"

FORCE = "/metrics/force"
SEPARATION = "/metrics/separation"
TURN_DEG = "/metrics/turn_deg"
SLOT_ERROR = "/metrics/slot_error"
OBSTACLE_DISTANCE = "/metrics/obstacle_distance"
TIER = "/metrics/tier"
RECORD_AGE = "/metrics/record_age"
NEIGHBOURS = "/metrics/neighbours"
QUEUE_RESIDUAL = "/metrics/queue_residual"
PACKETS = "/metrics/packets"

EVENTS = "/log/events"
EVENT = "event"

STATE = "/state/agents"
PLACE, ALIVE, ATTITUDE, MISSION = "place", "alive", "attitude", "mission"
MISSIONS = "/state/missions"
HEARD = "/state/links"
HEARS = "hears"

ROLES = "/roles"
NAMED_MAX = 50
"""Of more agents, no names are shown beside the vehicles, and no lanes of roles kept."""

SCENARIO = "/run/scenario"


def names_of(agents: int) -> list[str]:
    """Return agents' names."""
    return [f"a{agent}" for agent in range(agents)]


def role_of(agent: int) -> str:
    """Return where an agent's role is told, change by change."""
    return f"{ROLES}/a{agent}"


def limit_of(metric: str) -> str:
    """Return where a metric's reference line stands."""
    return f"{metric}/limit"


PER_AGENT = (FORCE, SEPARATION, TURN_DEG, SLOT_ERROR)
"""Metrics with one series for each agent."""
TOLD = (TIER, RECORD_AGE, NEIGHBOURS)
"""The same, of what agents tell of themselves."""
NEAR_OBSTACLES = (*PER_AGENT, OBSTACLE_DISTANCE)
"""The same, where there are obstacles."""
