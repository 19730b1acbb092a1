"""The tables of a scenario file: their keys, units, bounds and defaults.

These structures are the format. The unit of every number is in its key, and positions are in the
world frame. The docstrings explain the keys to users: they become the comments of ``qswarm new``
and the descriptions of the JSON Schema. The conditions between keys are in ``rules``.
"""

from typing import Annotated, Any, Literal, get_type_hints

import msgspec
from msgspec import Meta

from agent.config import (
    LEAST,
    AgentSetup,
    Comms,
    Control,
    Hertz,
    Positive,
    ProgramCommand,
    Sensors,
    Table,
    Vehicle,
)
from agent.guidance.bobber import lemma_7_bound_m
from agent.guidance.potential import TARGET_FLOOR_M
from agent.messages import AT_HOME, AgentId
from agent.qstructure.formation import FormationSpec
from netem.link_parameters import Conditions
from netem.messages import MediumSetup
from worldsim.scenario.events import EventTable, Name
from worldsim.scenario.obstacle_tables import ObstacleField, Obstacles
from worldsim.scenario.properties import Property
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.target_frame import FrameTable, path_of

SLOTS_PER_TICK = 4
MAX_AGENTS = 1000
CONVERGED_M = 0.12
"""An agent within this distance of its slot [m] is in place."""
CONVERGED_S = 2.0
"""A team in place for this time [s] has converged."""

Briefed = Annotated[
    Literal["all"] | Annotated[tuple[AgentId, ...], Meta(max_length=MAX_AGENTS)],
    Meta(description="'all', or a list of ids"),
]


class Fleet(Table, frozen=True):
    """The number of agents, their control rate and their start.

    boot_s: simulated time from a restart or join to the agent's first step. spare: how many agents
    may join by ``qswarm fault RUN join``, besides those that join by events. briefed: who knows the
    formation and the frame at the start, as from a flight plan; the others hear of them by radio,
    as everybody does who joins or restarts later.
    """

    agents: Annotated[int, Meta(ge=1, le=MAX_AGENTS)]
    tick_hz: Hertz = 20.0
    start: BoxStart | ListStart = BoxStart()
    boot_s: Annotated[float, Meta(ge=0, le=3600)] = 1.0
    spare: Annotated[int, Meta(ge=0, le=MAX_AGENTS)] = 0
    briefed: Briefed = "all"


def _optional(table: type[Table]) -> list[tuple[str, Any, None]]:
    """Return the fields of a table with None as their default."""
    hints = get_type_hints(table, include_extras=True)
    return [(name, hints[name] | None, None) for name in table.__struct_fields__]


VehicleChange = msgspec.defstruct(
    "VehicleChange",
    _optional(Vehicle),
    bases=(Table,),
    frozen=True,
    namespace={"__doc__": "Keys of [vehicle] with other values for some agents."},
)


class AgentTable(Table, frozen=True):
    """Some agents that differ: their ``ids``, and the keys of ``vehicle`` with their own values.

    command: a program and its arguments that is started in place of each of these agents, and
    speaks with the others over Zenoh by itself (docs/wire.md); not in virtual time.
    """

    ids: Annotated[tuple[AgentId, ...], Meta(min_length=1, max_length=MAX_AGENTS)]
    vehicle: VehicleChange = VehicleChange()  # type: ignore[valid-type]  # made by defstruct
    command: ProgramCommand | None = None


class Expectations(Table, frozen=True):
    """What a run must show to pass.

    converge_within_s: from each formation's start. reform_within_s: from each fault, and from the
    end of what parts the team, until it has re-formed the whole formation. in_formation_fraction,
    max_slot_error_m: of the time from convergence on, without reform_within_s, or 10 s, after each
    beginning and end of a fault. min_lambda2: the algebraic connectivity of the team's network in
    that time, 0 where it is parted. converge: false where no formation is to be formed,
    as with a controller that knows none. min_separation_m: between centres; left out:
    control.separation_m. min_obstacle_distance_m: from a vehicle's centre to a surface; left out:
    control.clearance_m. attitude_within_deg: how far an agent's attitude may be from its queue's
    orientation, at the end and from the formation's convergence on. idle_faults: whether the run
    may pass though a fault struck nothing. property: what else it must show.
    """

    converge_within_s: Positive | None = None
    reform_within_s: Positive | None = None
    in_formation_fraction: Annotated[float, Meta(ge=0, le=1)] | None = None
    max_slot_error_m: Annotated[float, Meta(ge=0, le=1e4)] | None = None
    min_lambda2: Annotated[float, Meta(ge=0, le=1e4)] | None = None
    converge: bool = True
    min_separation_m: Annotated[float, Meta(ge=0, le=1e4)] | None = None
    min_obstacle_distance_m: Annotated[float, Meta(ge=0, le=1e4)] | None = None
    attitude_within_deg: Annotated[float, Meta(ge=LEAST, le=180)] | None = None
    idle_faults: bool = False
    property: Annotated[tuple[Property, ...], Meta(max_length=64)] = ()


class Scenario(Table, frozen=True, omit_defaults=False):
    """A resolved scenario: every default filled in, and the formation in place."""

    fleet: Fleet
    formation: Annotated[
        FormationSpec, Meta(description="a table of file, or of name, vertices, queue")
    ]
    schema: Annotated[int, Meta(ge=1, le=1)] = 1
    name: Name = "unnamed"
    seed: Annotated[int, Meta(ge=0, lt=2**53)] = 1
    duration_s: Annotated[float, Meta(ge=LEAST, le=86_400)] = 20.0
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
        """Slots of the whole run."""
        return round(self.duration_s * self.slot_hz)

    @property
    def rows(self) -> int:
        """The number of agents in all: those at the start, and all that may join."""
        joiners = sum(event.joiners for event in self.event)
        return self.fleet.agents + joiners + self.fleet.spare

    @property
    def separation_bound_m(self) -> float:
        """The least separation of two vehicles' centres that a run must keep [m]."""
        expected_m = self.expect.min_separation_m
        return self.control.separation_m if expected_m is None else expected_m

    @property
    def obstacle_bound_m(self) -> float:
        """The least distance from a vehicle's centre to a surface that a run must keep [m]."""
        expected_m = self.expect.min_obstacle_distance_m
        return self.control.clearance_m if expected_m is None else expected_m

    @property
    def min_slot_distance_m(self) -> float:
        """The least distance between slots that leaves the potential an equilibrium [m], E1."""
        return self.control.separation_m + TARGET_FLOOR_M

    @property
    def local_range_m(self) -> float | None:
        """The radio range of the local channel [m]; None without a limit."""
        own_m = self.netem.local.range_m
        return self.netem.range_m if own_m is None else own_m

    @property
    def lemma_7_bound_m(self) -> float | None:
        """The largest d_c2 that keeps neighbours in range [m], Lemma 7; None without a limit."""
        range_m = self.local_range_m
        return None if range_m is None else lemma_7_bound_m(range_m, self.control.spacing_m)

    @property
    def vehicles(self) -> list[Vehicle]:
        """Every agent's vehicle, by id."""
        return [self.vehicle_of(agent) for agent in range(self.rows)]

    def vehicle_of(self, agent: int) -> Vehicle:
        """Return one agent's vehicle: [vehicle], changed by each [[agent]] table with its id."""
        vehicle = self.vehicle
        for table in self.agent:
            if agent in table.ids:
                keys = msgspec.structs.asdict(table.vehicle)
                changes = {key: value for key, value in keys.items() if value is not None}
                vehicle = msgspec.structs.replace(vehicle, **changes)
        return vehicle

    @property
    def commands(self) -> dict[int, tuple[str, ...]]:
        """The command of each foreign agent, by id: that of the last [[agent]] table with one."""
        return {
            agent: table.command
            for table in self.agent
            if table.command is not None
            for agent in table.ids
        }

    def medium_setup(self) -> MediumSetup:
        """Return the setup of the medium."""
        return MediumSetup(
            seed=self.seed,
            agents=self.rows,
            slots_per_tick=SLOTS_PER_TICK,
            slot_hz=self.slot_hz,
            conditions=self.netem,
        )

    def agent_setup(self, agent: int, incarnation: int, command_ticks: int) -> AgentSetup:
        """Return the setup of one agent; ``command_ticks``: for how many a command is valid."""
        briefed = self.is_briefed(agent, incarnation)
        return AgentSetup(
            id=agent,
            incarnation=incarnation,
            tick_hz=self.fleet.tick_hz,
            slots_per_tick=SLOTS_PER_TICK,
            command_ticks=command_ticks,
            vehicle=self.vehicle_of(agent),
            fleet_max_speed_mps=max(vehicle.max_speed_mps for vehicle in self.vehicles),
            control=self.control,
            comms=self.comms,
            sensor=self.sensor,
            formation=self.formation if briefed else None,
            frame=path_of(self.frame) if briefed else AT_HOME,
            team=self.fleet.agents,
            ids=self.rows,
            relays=self.relays,
        )

    @property
    def relays(self) -> bool:
        """Whether agents pass on a table of all members.

        The assignment needs it, and so does a fleet with a vehicle that senses no others: it has to
        know where each of them may be.
        """
        blind = any("proximity" not in vehicle.sensors for vehicle in self.vehicles)
        return blind or self.control.allocation == "assignment"

    def is_briefed(self, agent: int, incarnation: int) -> bool:
        """Return whether a process of an agent knows the mission from its start on."""
        takes_off = incarnation == 0 and agent < self.fleet.agents
        briefed = self.fleet.briefed
        return takes_off and (briefed == "all" or agent in briefed)
