"""Where everything stands in a recording: the contract between who writes and who reads.

Row i of every batch is agent i; the number of rows never changes; NaN is no vehicle in the world.
"""

SIM_TIME = "sim_time"
TICK = "tick"

AGENTS = "/world/agents"
VEHICLES = "/world/vehicles"
TARGETS = "/world/targets"
LINKS = "/world/links"
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
PACKETS = "/metrics/packets"

EVENTS = "/log/events"
EVENT = "event"

STATE = "/state/agents"
PLACE, ALIVE, ATTITUDE, MISSION = "place", "alive", "attitude", "mission"
MISSIONS = "/state/missions"
HEARD = "/state/links"
HEARS = "hears"

SCENARIO = "/run/scenario"


def limit_of(metric: str) -> str:
    """Return where a metric's reference line stands."""
    return f"{metric}/limit"


PER_AGENT = (FORCE, SEPARATION, TURN_DEG, SLOT_ERROR)
"""Metrics with one series for each agent."""
NEAR_OBSTACLES = (*PER_AGENT, OBSTACLE_DISTANCE)
"""The same, where there are obstacles."""
