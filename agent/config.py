"""What an agent is told once, before it flies: tables of the scenario, as they stand there."""

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from agent.messages import AT_HOME, AgentId, FramePath
from agent.qstructure.formation import FormationSpec

Positive = Annotated[float, Meta(gt=0, le=1e4)]
Hertz = Annotated[float, Meta(gt=0, le=1000)]
Noise = Annotated[float, Meta(ge=0, le=1)]


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of the scenario: unknown keys are refused."""


class Vehicle(Table, frozen=True):
    """The vehicle's limits and senses.

    kind: "kinematic" takes up any velocity at once; "accelerating" changes it by max_accel_mps2 at
    most; "forward" flies where it points, climbs and turns, and cannot move sideways or back.

    max_turn_deg: theta, half angle of the cast-zone in azimuth; to the left and to the right it may
    differ. max_tilt_deg: how far it can roll and pitch at its slot; 0: it stays level.
    """

    kind: Literal["kinematic", "accelerating", "forward"] = "kinematic"
    radius_m: Annotated[float, Meta(gt=0, le=100)] = 0.1
    max_speed_mps: Annotated[float, Meta(gt=0, le=50)] = 0.5
    max_climb_mps: Annotated[float, Meta(gt=0, le=50)] = 0.5
    max_accel_mps2: Annotated[float, Meta(gt=0, le=100)] = 2.0
    max_yaw_rate_dps: Annotated[float, Meta(gt=0, le=10_000)] = 180.0
    max_turn_deg: Annotated[float, Meta(gt=0, le=90)] = 45.0
    max_turn_left_deg: Annotated[float, Meta(gt=0, le=90)] | None = None
    max_turn_right_deg: Annotated[float, Meta(gt=0, le=90)] | None = None
    max_tilt_deg: Annotated[float, Meta(ge=0, le=90)] = 0.0
    sensors: tuple[Literal["proximity", "laser", "sonar"], ...] = ("proximity",)


class Proximity(Table, frozen=True):
    """Relative positions of vehicles and of obstacles' nearest points within 2 m.

    The noise is normal, per axis [m].
    """

    noise_m: Noise = 0.0


class Laser(Table, frozen=True):
    """A scanner: ``rays`` over ``field_deg`` ahead, in ``rings`` spread over +-elevation_deg.

    noise_m: normal, along the ray; dropout_percent: rays that meet something and tell nothing.
    """

    range_m: Annotated[float, Meta(gt=0, le=60)] = 4.0
    field_deg: Annotated[float, Meta(gt=0, le=350)] = 180.0
    rays: Annotated[int, Meta(ge=1, le=720)] = 61
    elevation_deg: Annotated[float, Meta(ge=0, le=85)] = 0.0
    rings: Annotated[int, Meta(ge=1, le=64)] = 1
    rate_hz: Hertz = 10.0
    noise_m: Noise = 0.0
    dropout_percent: Annotated[float, Meta(ge=0, le=100)] = 0.0


class Sonar(Table, frozen=True):
    """A ring of sonars, and with ``up_down`` one upwards and one downwards.

    Each tells the distance to the nearest thing within its beam, not where in it.
    """

    range_m: Annotated[float, Meta(gt=0, le=60)] = 2.0
    ring: Annotated[int, Meta(ge=1, le=64)] = 16
    up_down: bool = False
    beam_deg: Annotated[float, Meta(gt=0, le=120)] = 22.5
    rate_hz: Hertz = 10.0
    noise_m: Noise = 0.0
    dropout_percent: Annotated[float, Meta(ge=0, le=100)] = 0.0


class Sensors(Table, frozen=True):
    """What each kind of sensor is like."""

    proximity: Proximity = Proximity()
    laser: Laser = Laser()
    sonar: Sonar = Sonar()


DEFAULT_CAST_FAR_M = 0.5
"""d_c2 [m] where neither the scenario nor the radio's range sets another (Lemma 7, E20)."""
AvoidanceKind = Literal["constellation", "direct", "none"]


class Control(Table, frozen=True):
    """The controller and the paper's distances [m]: d_ir, d_ob, d_s, d_c1, d_c2.

    avoidance: what leads round obstacles before the filter has to: the bent lines of Algorithm 3, a
    repulsion straight from what is near, or nothing but the dodge.
    clearance_m: from a vehicle's centre to an obstacle's surface, what the safety filter keeps.
    ``cast_far_m`` left out follows from the range (Lemma 7, E20).
    """

    controller: Annotated[str, Meta(min_length=1, max_length=200)] = "q_structure"
    spacing_m: Positive = 1.0
    separation_m: Positive = 0.25
    safety_m: Positive = 0.6
    clearance_m: Positive = 0.5
    cast_near_m: Positive = 0.05
    cast_far_m: Positive | None = None
    avoidance: AvoidanceKind = "constellation"


class Comms(Table, frozen=True):
    """How often each channel is used [Hz]; ``multihop_hz`` 0 is off."""

    local_hz: Hertz = 20.0
    multihop_hz: Annotated[float, Meta(ge=0, le=1000)] = 2.0


class AgentSetup(Table, frozen=True):
    """All that one agent is told.

    command_ticks: for how many ticks a command is valid; H of docs/method.md follows from it.
    fleet_max_speed_mps: the fastest vehicle's limit, which is what the others must reckon with.
    frame: where the target's frame goes, until a mission says otherwise. lockstep: whether its
    process waits for what each of its slots brings.
    """

    id: AgentId
    incarnation: Annotated[int, Meta(ge=0)]
    tick_hz: Hertz
    slots_per_tick: Annotated[int, Meta(ge=1, le=64)]
    command_ticks: Annotated[int, Meta(ge=1, le=10)]
    vehicle: Vehicle
    fleet_max_speed_mps: Positive
    control: Control
    comms: Comms
    formation: FormationSpec
    sensor: Sensors = Sensors()
    frame: FramePath = AT_HOME
    lockstep: bool = False
