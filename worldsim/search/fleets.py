"""Random fleets: number, start, vehicles, sensors, control and rates."""

from math import ceil

from agent.guidance.potential import TARGET_FLOOR_M
from worldsim.search.draws import Draw, Tables

TICK_HZ = (10.0, 12.5, 20.0, 20.0, 20.0, 25.0, 30.0, 40.0, 50.0)
COMMAND_TICKS = 2
MAX_STEP_M = 0.1
"""No vehicle moves farther while a command is valid, or ``check`` warns."""
KINDS = ("kinematic", "accelerating", "forward")
SENSORS: tuple[list[str], ...] = (
    ["proximity"],
    [],
    ["laser"],
    ["sonar"],
    ["laser", "sonar"],
    ["proximity", "laser"],
    ["proximity", "sonar"],
    ["proximity", "laser", "sonar"],
)


def control(draw: Draw) -> Tables:
    """Return the control table of a scenario."""
    separation = draw.among((0.25, 0.25, draw.number(0.12, 0.6)))
    least = separation + TARGET_FLOOR_M
    table: Tables = {
        "separation_m": separation,
        "spacing_m": draw.among((max(1.0, least), draw.number(least + 0.01, least + 1.2))),
    }
    if draw.chance(0.15):
        table["controller"] = "flocking"
    if draw.chance(0.3):
        table["avoidance"] = draw.among(("constellation", "direct", "none"))
    for key, low, high in (("safety_m", 0.3, 1.2), ("clearance_m", 0.15, 0.8)):
        if draw.chance(0.25):
            table[key] = draw.number(low, high)
    if draw.chance(0.2):
        table["cast_near_m"] = draw.number(0.01, 0.12)
    if draw.chance(0.1):
        table["cast_far_m"] = draw.number(0.1, 1.2)
    return table


def fleet(draw: Draw, agents: int, separation: float) -> Tables:
    """Return the fleet table: number, start and rates."""
    table: Tables = {"agents": agents, "start": start(draw, agents, separation)}
    table["tick_hz"] = draw.among(TICK_HZ)
    if draw.chance(0.3):
        table["boot_s"] = draw.among((0.0, 0.1, draw.number(0.0, 3.0)))
    if draw.chance(0.2):
        table["spare"] = draw.whole(0, 3)
    return table


def start(draw: Draw, agents: int, separation: float) -> Tables:
    """Return a start: drawn in a box, listed at random, or listed as densely as allowed."""
    centre = draw.among(([0.0, 0.0, 0.0], draw.point(6.0), draw.point(300.0, 40.0)))
    if draw.chance(0.5):
        spacing = round(separation * draw.number(1.0, 3.0), 3)
        edge = round(spacing * draw.number(1.6, 4.0) * ceil(agents ** (1 / 3)), 1)
        size = [edge, edge, draw.among((edge, round(0.6 * edge, 1)))]
        return {"kind": "box", "centre_m": centre, "size_m": size, "spacing_m": spacing}
    pitch = draw.among((1.0, 1.01, draw.number(1.0, 4.0))) * separation
    table: Tables = {"kind": "list", "positions_m": lattice(draw, agents, pitch, centre)}
    if draw.chance(0.6):
        table["yaws_deg"] = [draw.number(-180.0, 180.0, 0) for _ in range(agents)]
    return table


def lattice(draw: Draw, agents: int, pitch: float, centre: list[float]) -> list[list[float]]:
    """Return places of a cubic lattice, in a cube, a plane or a line, in random order."""
    side = draw.among((ceil(agents ** (1 / 3)), ceil(agents**0.5), agents))
    cells = [(k % side, k // side % side, k // side // side) for k in range(agents)]
    turned = draw.some(range(3), 3)
    places = [
        [round(c + pitch * cell[axis], 6) for c, axis in zip(centre, turned, strict=True)]
        for cell in cells
    ]
    return draw.some(places, agents)


def vehicle(draw: Draw, tick_hz: float) -> Tables:
    """Return the vehicle table of a fleet."""
    fastest = MAX_STEP_M * tick_hz / COMMAND_TICKS
    table: Tables = {"kind": draw.among(KINDS), "sensors": sensors(draw)}
    table["max_speed_mps"] = draw.among((min(0.5, fastest), draw.number(0.2, fastest)))
    choices = (
        ("max_climb_mps", 0.1, 2.0),
        ("max_accel_mps2", 0.3, 8.0),
        ("max_yaw_rate_dps", 20.0, 720.0),
        ("max_turn_deg", 10.0, 90.0),
        ("max_turn_left_deg", 5.0, 90.0),
        ("max_turn_right_deg", 5.0, 90.0),
        ("max_tilt_deg", 5.0, 90.0),
        ("radius_m", 0.02, 0.12),
    )
    for key, low, high in choices:
        if draw.chance(0.2):
            table[key] = draw.scale(low, high)
    return table


def sensors(draw: Draw) -> list[str]:
    """Return the sensors that a vehicle carries."""
    return list(SENSORS[0] if draw.chance(0.45) else draw.among(SENSORS))


def agents_that_differ(draw: Draw, agents: int, tick_hz: float) -> list[Tables]:
    """Return [[agent]] tables, which may name an agent twice."""
    tables = []
    for _ in range(draw.among((0, 0, 0, 1, 2))):
        change = vehicle(draw, tick_hz)
        kept = draw.some(sorted(change), draw.whole(1, 3))
        ids = sorted(draw.some(range(agents), draw.whole(1, 3)))
        tables.append({"ids": ids, "vehicle": {key: change[key] for key in kept}})
    return tables


def sensor(draw: Draw, carried: set[str]) -> Tables:
    """Return the properties of the sensors that some vehicle carries."""
    tables = {
        "proximity": {"noise_m": draw.among((0.0, 0.0, 0.01, draw.number(0.0, 0.08)))},
        "laser": laser(draw),
        "sonar": sonar(draw),
    }
    found: Tables = {kind: table for kind, table in tables.items() if kind in carried}
    if carried & {"laser", "sonar"} and draw.chance(0.1):
        found["coverage"] = "planar"
    return found


def carried(vehicle: Tables, differing: list[Tables]) -> set[str]:
    """Return the sensors of [vehicle] and of the [[agent]] tables."""
    changes = [each["vehicle"].get("sensors", []) for each in differing]
    return {kind for kinds in (vehicle["sensors"], *changes) for kind in kinds}


def laser(draw: Draw) -> Tables:
    """Return the properties of a laser scanner."""
    table: Tables = {"range_m": draw.number(1.0, 8.0), "field_deg": draw.among((90, 180, 270, 350))}
    table["rays"] = draw.whole(21, 121)
    if draw.chance(0.7):
        table |= {"elevation_deg": draw.number(10.0, 80.0, 0), "rings": draw.whole(2, 11)}
    return table | scanner(draw)


def sonar(draw: Draw) -> Tables:
    """Return the properties of a sonar."""
    table: Tables = {"range_m": draw.number(0.8, 4.0), "ring": draw.whole(4, 24)}
    if draw.chance(0.5):
        table |= {"beam_deg": draw.number(10.0, 90.0, 0), "up_down": draw.chance(0.6)}
    return table | scanner(draw)


def scanner(draw: Draw) -> Tables:
    """Return the properties that laser and sonar share."""
    table: Tables = {}
    for key, low, high in (("rate_hz", 2, 20), ("noise_m", 0, 0.05), ("dropout_percent", 0, 20)):
        if draw.chance(0.3):
            table[key] = draw.number(low, high)
    return table


def comms(draw: Draw, tick_hz: float) -> Tables:
    """Return the rates of both channels."""
    table: Tables = {"local_hz": draw.among((tick_hz, min(20.0, tick_hz), draw.number(2, tick_hz)))}
    if draw.chance(0.4):
        table["multihop_hz"] = draw.among((0.0, draw.number(0.2, tick_hz)))
    return table
