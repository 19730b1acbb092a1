"""A run as its clock leaves it: the loop, the radio's counters, and what the host did to it."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypedDict

from netem.messages import MediumCounters
from netem.sender_counts import SenderRow
from worldsim.engine.step import SlotLoop

TOO_LATE_FRACTION = 0.01
"""From this share of late ticks on, the host is too slow for a verdict."""

Mode = Literal["processes", "lockstep", "virtual"]


class ChannelDeliveryRow(TypedDict):
    """The extra delay of one channel's frames."""

    frames: int
    within_fraction: float
    excess_ms: dict[str, float]


class DeliveryRow(ChannelDeliveryRow):
    """The extra delay of all frames."""

    bound_ms: float  # one slot and one tick
    channels: dict[str, ChannelDeliveryRow | None]


class OverloadRow(TypedDict):
    """What was to be done when ticks are late, and what was done."""

    policy: Literal["go", "slow", "abort"]  # as in --on-overload
    least_speed: float  # simulated seconds in a second of wall time; as requested: never slowed


class ResourcesRow(TypedDict):
    """What the processes of a launched fleet used."""

    start_up_s: float | None  # wall time from the launcher's start until all were present
    agent_steps: int  # how often an agent was to step
    cpu_us_per_agent_step: dict[str, float]  # by part, without the start: agents, netem, world
    agent_private_mb: float | None  # memory shared with no other process, the median agent


@dataclass(frozen=True, slots=True, kw_only=True)
class FinishedRun:
    """A run as its clock leaves it; None for what that clock cannot measure."""

    mode: Mode
    loop: SlotLoop
    medium_counters: MediumCounters | None
    late_tick_fraction: float | None
    real_time_factor: float | None  # simulated seconds in a second of wall time
    cut_off_by: str | None = None  # what ended the run before its time; None: it is complete
    failure: str | None = None  # an error during the run
    late_because: str | None = None  # the process that made ticks late, if not the host
    late_detail: str | None = None  # whose ticks were late on a slow host, and what to do
    unsafe_on_time: bool = True  # whether agents that were on time broke I1, if it is broken
    late_spell: str | None = None  # when the host was too slow for a while; None: it never was
    violated_in_time: Collection[str] | None = None  # while no tick was late; None: all that are
    overload: OverloadRow | None = None  # None under a clock where no tick can be late
    resources: ResourcesRow | None = None  # of the processes of a launched fleet
    rejected_by_world: Mapping[str, int] = field(default_factory=dict)  # messages by cause
    commands: Sequence[SenderRow] = ()  # of each agent, accepted and rejected; free-running
    delivery: DeliveryRow | None = None  # of frames that agents used
    messages: Mapping[int, int] = field(default_factory=dict)  # of intruders, by a fault's number

    @property
    def duration_s(self) -> float:
        """How much was simulated [s]."""
        return self.loop.world.time_s

    @property
    def host_too_slow(self) -> bool:
        """Whether so many ticks were late that the run proves nothing."""
        late = self.late_tick_fraction
        return late is not None and late >= TOO_LATE_FRACTION
