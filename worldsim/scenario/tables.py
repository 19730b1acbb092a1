"""The tables of a scenario file: their keys, units, bounds and defaults.

These structures are the format; every number's unit is in its key. What a file leaves out gets the
value written here. What must hold between keys is said in ``rules``.
"""

from typing import Annotated, Any, get_type_hints

import msgspec
from msgspec import Meta

from agent.config import (
    DEFAULT_CAST_FAR_M,
    AgentSetup,
    Comms,
    Control,
    Hertz,
    Positive,
    Sensors,
    Table,
    Vehicle,
)
from agent.messages import AgentId
from agent.qstructure.formation import FormationSpec
from netem.link_keys import Conditions
from netem.messages import MediumSetup
from worldsim.scenario.events import EventTable
from worldsim.scenario.obstacle_tables import ObstacleField, Obstacles
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.target_frame import FrameTable, path_of

SLOTS_PER_TICK = 4
MAX_AGENTS = 1000
"""d_c2 where the range allows it; the paper's value."""

RunName = Annotated[
    str,
    Meta(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*\Z",
        max_length=80,
        description="a name of letters, digits, '.', '_' and '-', at most 80, no '.' first",
    ),
]


class Fleet(Table, frozen=True):
    """How many agents, how fast they think, and where they start.

    boot_s: simulated time from a restart or a join to the agent's first step. spare: how many may
    join besides the timeline's, told by ``qswarm fault RUN join``.
    """

    agents: Annotated[int, Meta(ge=1, le=MAX_AGENTS)]
    tick_hz: Hertz = 20.0
    start: BoxStart | ListStart = BoxStart()
    boot_s: Annotated[float, Meta(ge=0, le=3600)] = 1.0
    spare: Annotated[int, Meta(ge=0, le=MAX_AGENTS)] = 0


def _optional(table: type[Table]) -> list[tuple[str, Any, None]]:
    """Return the fields of a table, each to be left out."""
    hints = get_type_hints(table, include_extras=True)
    return [(name, hints[name] | None, None) for name in table.__struct_fields__]


VehicleChange = msgspec.defstruct(
    "VehicleChange",
    _optional(Vehicle),
    bases=(Table,),
    frozen=True,
    namespace={"__doc__": "Keys of [vehicle] that differ for some agents."},
)


class AgentTable(Table, frozen=True):
    """What differs for some agents: ``ids``, and the keys of ``vehicle`` that they have instead."""

    ids: Annotated[tuple[AgentId, ...], Meta(min_length=1, max_length=MAX_AGENTS)]
    vehicle: VehicleChange  # type: ignore[valid-type]


class Expectations(Table, frozen=True):
    """What a run must show; ``converge_within_s`` counts from each formation's start.

    min_obstacle_distance_m: from a vehicle's centre to a surface; left out: control.clearance_m.
    reform_within_s: from each change of the team until all stand in a whole formation again.
    converge: false where no formation is to be formed, as with a controller that knows none.
    """

    converge_within_s: Positive | None = None
    reform_within_s: Positive | None = None
    converge: bool = True
    min_separation_m: Annotated[float, Meta(ge=0, le=1e4)] | None = None
    min_obstacle_distance_m: Annotated[float, Meta(ge=0, le=1e4)] | None = None


class Scenario(Table, frozen=True, omit_defaults=False):
    """A whole scenario, resolved: every default filled in, the formation in place."""

    fleet: Fleet
    formation: FormationSpec
    schema: Annotated[int, Meta(ge=1, le=1)] = 1
    name: RunName = "unnamed"
    seed: Annotated[int, Meta(ge=0, lt=2**53)] = 1
    duration_s: Annotated[float, Meta(gt=0, le=86_400)] = 20.0
    vehicle: Vehicle = Vehicle()
    agent: tuple[AgentTable, ...] = ()
    sensor: Sensors = Sensors()
    control: Control = Control()
    comms: Comms = Comms()
    netem: Conditions = Conditions()
    frame: FrameTable = FrameTable()
    obstacle: Obstacles = ()
    obstacle_field: ObstacleField | None = None
    event: tuple[EventTable, ...] = ()
    expect: Expectations = Expectations()

    @property
    def slot_hz(self) -> float:
        """Slots per second of simulated time."""
        return self.fleet.tick_hz * SLOTS_PER_TICK

    @property
    def slots(self) -> int:
        """How many slots the run lasts."""
        return round(self.duration_s * self.slot_hz)

    @property
    def obstacle_bound_m(self) -> float:
        """How near a vehicle's centre may come to a surface [m]."""
        wanted = self.expect.min_obstacle_distance_m
        return self.control.clearance_m if wanted is None else wanted

    @property
    def rows(self) -> int:
        """How many agents there may be in all: those at the start, and all that join."""
        joiners = sum(event.joiners for event in self.event)
        return self.fleet.agents + joiners + self.fleet.spare

    def vehicle_of(self, agent: int) -> Vehicle:
        """Return one agent's vehicle: [vehicle], with what [[agent]] says differs."""
        vehicle = self.vehicle
        for table in self.agent:
            if agent in table.ids:
                told = msgspec.structs.asdict(table.vehicle)
                changes = {key: value for key, value in told.items() if value is not None}
                vehicle = msgspec.structs.replace(vehicle, **changes)
        return vehicle

    @property
    def vehicles(self) -> list[Vehicle]:
        """Every agent's vehicle, by id."""
        return [self.vehicle_of(agent) for agent in range(self.rows)]

    def _control(self) -> Control:
        """Return [control] with the bobber's reach that the radio's range allows (Lemma 7, E20)."""
        if self.control.cast_far_m is not None:
            return self.control
        reach = DEFAULT_CAST_FAR_M
        range_m = self.netem.local.range_m or self.netem.range_m
        if range_m is not None:
            reach = min(reach, 0.25 * (range_m - self.control.spacing_m))
        reach = max(reach, 2.0 * self.control.cast_near_m)
        return msgspec.structs.replace(self.control, cast_far_m=reach)

    def medium_setup(self) -> MediumSetup:
        """Return what the medium is told."""
        return MediumSetup(self.seed, self.rows, SLOTS_PER_TICK, self.slot_hz, self.netem)

    def agent_setup(self, agent: int, incarnation: int, command_ticks: int) -> AgentSetup:
        """Return what one agent is told; ``command_ticks`` is the clock's (one, or two)."""
        return AgentSetup(
            id=agent,
            incarnation=incarnation,
            tick_hz=self.fleet.tick_hz,
            slots_per_tick=SLOTS_PER_TICK,
            command_ticks=command_ticks,
            vehicle=self.vehicle_of(agent),
            fleet_max_speed_mps=max(vehicle.max_speed_mps for vehicle in self.vehicles),
            control=self._control(),
            comms=self.comms,
            sensor=self.sensor,
            formation=self.formation,
            frame=path_of(self.frame),
        )
