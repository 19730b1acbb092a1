"""Configuration of one agent: the scenario's tables, as they stand there."""

from typing import Annotated, Any, Literal, assert_never, get_args

import msgspec
from msgspec import Meta

from agent.messages import (
    AGENT_IDS,
    AT_HOME,
    MAX_SPEED_MPS,
    AgentId,
    AllocationKind,
    FramePath,
)
from agent.qstructure.formation import FormationSpec
from agent.services import Service

LEAST = 0.001
"""Least value of a quantity that must be above 0, in the unit of its key: smaller ones have no use,
and their squares and ratios leave the range of numbers."""
Positive = Annotated[float, Meta(ge=LEAST, le=1e4)]
Hertz = Annotated[float, Meta(ge=LEAST, le=1000)]
FrameSpeed = Annotated[float, Meta(ge=LEAST, le=MAX_SPEED_MPS)]
Noise = Annotated[float, Meta(ge=0, le=1)]
VehicleKind = Literal["kinematic", "accelerating", "forward"]
AvoidanceKind = Literal["constellation", "direct", "none"]
FilterMode = Literal["on", "watch", "off"]


ScannerKind = Literal["laser", "sonar"]
SCANNERS: tuple[ScannerKind, ...] = get_args(ScannerKind)
"""Scanning sensors; a Scan's ``kind`` is an index of this."""
SensorKind = Literal["proximity", ScannerKind]
"""Every kind of sensor that a vehicle may carry."""


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of the scenario's tables; unknown keys are rejected."""


class Vehicle(Table, frozen=True):
    """The vehicle's limits and sensors.

    kind: "kinematic" takes up any velocity at once; "accelerating" changes its velocity by at most
    max_accel_mps2; "forward" flies only where it points, climbs and turns.

    max_turn_deg: theta, half angle of the cast-zone in azimuth; each side may have its own value.
    max_tilt_deg: largest roll and pitch at its slot; 0: it stays level.
    """

    kind: VehicleKind = "kinematic"
    radius_m: Annotated[float, Meta(ge=LEAST, le=100)] = 0.1
    max_speed_mps: Annotated[float, Meta(ge=LEAST, le=50)] = 0.5
    max_climb_mps: Annotated[float, Meta(ge=LEAST, le=50)] = 0.5
    max_accel_mps2: Annotated[float, Meta(ge=LEAST, le=100)] = 2.0
    max_yaw_rate_dps: Annotated[float, Meta(ge=LEAST, le=10_000)] = 180.0
    max_turn_deg: Annotated[float, Meta(ge=LEAST, le=90)] = 45.0
    max_turn_left_deg: Annotated[float, Meta(ge=LEAST, le=90)] | None = None
    max_turn_right_deg: Annotated[float, Meta(ge=LEAST, le=90)] | None = None
    max_tilt_deg: Annotated[float, Meta(ge=0, le=90)] = 0.0
    sensors: tuple[SensorKind, ...] = ("proximity",)


class Proximity(Table, frozen=True):
    """Relative positions of vehicles and of obstacles' nearest points within 2 m.

    The noise is normal, per axis [m].
    """

    noise_m: Noise = 0.0


class Laser(Table, frozen=True):
    """A scanner: ``rays`` over ``field_deg`` ahead, in ``rings`` spread over +-elevation_deg.

    At most 30 000 rays in all. The defaults see all round; a sonar upwards and one downwards close
    the gaps at the poles.

    noise_m: normal, along the ray; dropout_percent: share of the echoes that are lost.
    """

    range_m: Annotated[float, Meta(ge=LEAST, le=60)] = 4.0
    field_deg: Annotated[float, Meta(ge=LEAST, le=350)] = 350.0
    rays: Annotated[int, Meta(ge=1, le=720)] = 61
    elevation_deg: Annotated[float, Meta(ge=0, le=85)] = 80.0
    rings: Annotated[int, Meta(ge=1, le=64)] = 17
    rate_hz: Hertz = 10.0
    noise_m: Noise = 0.0
    dropout_percent: Annotated[float, Meta(ge=0, le=100)] = 0.0


class Sonar(Table, frozen=True):
    """A level ring of sonars; with ``up_down`` one more looks upwards and one downwards.

    Each measures the distance to the nearest surface within its beam, not the direction.
    """

    range_m: Annotated[float, Meta(ge=LEAST, le=60)] = 2.0
    ring: Annotated[int, Meta(ge=1, le=64)] = 16
    up_down: bool = True
    beam_deg: Annotated[float, Meta(ge=LEAST, le=120)] = 22.5
    rate_hz: Hertz = 10.0
    noise_m: Noise = 0.0
    dropout_percent: Annotated[float, Meta(ge=0, le=100)] = 0.0


Coverage = Literal["full", "planar"]
PLANAR_FIELD_DEG = 180.0


class Sensors(Table, frozen=True):
    """The properties of each kind of sensor.

    coverage: "full" as given; "planar" as in the paper's simulations: the laser has one level ring
    of 180 degrees ahead, the sonars one level ring. It sees nothing above or below.
    """

    coverage: Coverage = "full"
    proximity: Proximity = Proximity()
    laser: Laser = Laser()
    sonar: Sonar = Sonar()

    def scanner(self, kind: ScannerKind) -> Laser | Sonar:
        """Return the properties of a scanning sensor."""
        match kind:
            case "laser":
                return self._laser
            case "sonar":
                return self._sonar
        assert_never(kind)

    @property
    def _laser(self) -> Laser:
        match self.coverage:
            case "full":
                return self.laser
            case "planar":
                field_deg = min(self.laser.field_deg, PLANAR_FIELD_DEG)
                return msgspec.structs.replace(
                    self.laser, field_deg=field_deg, elevation_deg=0.0, rings=1
                )
        assert_never(self.coverage)

    @property
    def _sonar(self) -> Sonar:
        match self.coverage:
            case "full":
                return self.sonar
            case "planar":
                return msgspec.structs.replace(self.sonar, up_down=False)
        assert_never(self.coverage)


DEFAULT_CAST_FAR_M = 0.5
"""d_c2 [m] where neither the scenario nor the range heard sets another (Lemma 7, E20)."""


Argument = Annotated[str, Meta(min_length=1, max_length=4096)]
ProgramCommand = Annotated[tuple[Argument, ...], Meta(min_length=1, max_length=64)]
"""A program and its arguments."""


class Control(Table, frozen=True):
    """The controller and the paper's distances [m]: d_ir, d_ob, d_s, d_c1, d_c2.

    avoidance: what leads round obstacles before the safety filter has to stop the vehicle: the bent
    lines of Algorithm 3, a direct repulsion from each near point, or only the escape manoeuvre.
    allocation: who takes which place: "structure" by leaders, trees and neighbours; "assignment",
    for comparison, by every agent alike, which knows all members (E24).
    clearance_m: distance from a vehicle's centre to an obstacle's surface that the safety filter
    keeps. ``cast_far_m`` left out follows from the range heard (E20).
    gather: whether the members of a queue form its line where they are, before it flies to its
    vertex; for the controller "q_structure" under the allocation "structure".
    parameters: what a user's own controller takes; see ``agent.parameters``.
    services: what the agent does beside the controller, instead of what that asks for; see
    ``agent.services``. safety_filter: "watch" computes what the filter would change, and flies what
    the controller wants; "off" computes nothing.
    command: a program and its arguments that decides instead, in any language (docs/lines.md);
    ``controller`` is then "command".
    """

    controller: Annotated[str, Meta(min_length=1, max_length=200)] = "q_structure"
    spacing_m: Positive = 1.0
    separation_m: Positive = 0.25
    safety_m: Positive = 0.6
    clearance_m: Positive = 0.5
    cast_near_m: Positive = 0.05
    cast_far_m: Positive | None = None
    avoidance: AvoidanceKind = "constellation"
    allocation: AllocationKind = "structure"
    gather: bool = False
    parameters: dict[str, Any] = {}
    services: tuple[Service, ...] | None = None
    safety_filter: FilterMode = "on"
    command: ProgramCommand | None = None


class Comms(Table, frozen=True):
    """Rate of each channel [Hz]; ``multihop_hz`` 0 is off."""

    local_hz: Hertz = 20.0
    multihop_hz: Annotated[float, Meta(ge=0, le=1000)] = 2.0


class AgentSetup(Table, frozen=True):
    """The whole configuration of one agent."""

    id: AgentId
    incarnation: Annotated[int, Meta(ge=0)]  # which process of this agent, counted from 0
    tick_hz: Hertz
    slots_per_tick: Annotated[int, Meta(ge=1, le=64)]
    command_ticks: Annotated[int, Meta(ge=1, le=10)]
    """Life of a command [ticks]; H of docs/method.md follows from it."""
    vehicle: Vehicle
    fleet_max_speed_mps: Positive  # limit of the fleet's fastest vehicle
    control: Control
    comms: Comms
    formation: FormationSpec | None = None
    """The formation of the mission that it was briefed with; None: it has to hear one by radio."""
    sensor: Sensors = Sensors()
    frame: FramePath = AT_HOME  # path of the target's frame in that mission
    team: Annotated[int, Meta(ge=0, le=AGENT_IDS)] = 0
    """Number of agents that the fleet started with; their ids are 0 to ``team`` - 1."""
    ids: Annotated[int, Meta(ge=1, le=AGENT_IDS)] = AGENT_IDS
    """Number of agent ids in use: 0 to ids - 1, joining agents included."""
    relays: bool = True
    """Whether it passes on a table of all members: for the assignment, and where vehicles cannot
    sense each other."""
    lockstep: bool = False  # whether the process waits for the inbox of each of its slots
    real_time: bool = False  # whether time goes on while the agent computes
