"""How an agent's cost grows with its team: bytes on each channel, CPU time of a step.

Wedges of all sizes start at one density and hear about eight others each. The start phase counts:
agents find each other there, and choose their places for the first time.
"""

from functools import lru_cache
from math import ceil
from time import process_time
from typing import NamedTuple

from msgspec.structs import replace

from netem.wire.channels import CHANNELS, LOCAL, MULTIHOP
from worldsim.bench.fleets import EIGHT_IN_RANGE_M, wedge
from worldsim.engine.virtual import VirtualFleet

START_S = 6.0
"""The start phase that is flown [s; simulated time]."""
MOST_CPU_S = 20.0
"""A flight that takes more CPU time ends early [s]: then a step costs far too much anyway."""
DEAREST = 0.01
"""The share of the steps that counts as the dearest ones."""


class AgentCost(NamedTuple):
    """What one agent of a team costs, on average over team and flight."""

    beacon_b: float
    """Size of an encoded beacon with its checksum [B]."""
    local_bps: float
    """Payload on the local channel, checksums included [B/s]."""
    multihop_bps: float
    """The same on the multihop channel [B/s]."""
    step_us: float
    """CPU time of a step, without the decoding of what was heard [us]."""
    dearest_us: float
    """The mean over the dearest DEAREST of all steps [us]."""
    worst_us: float
    """The dearest step [us]."""
    heard_by: float
    """How many others hear a frame: fewer of a small team, most of which flies at its edge."""
    flight_us: float
    """CPU time of the whole flight for each step of an agent, radio and world included [us]."""

    @property
    def sent_bps(self) -> float:
        """Payload on both channels [B/s]."""
        return self.local_bps + self.multihop_bps


class StepTimes:
    """Takes the CPU time of each step of a flight [s]."""

    def __init__(self) -> None:
        self.all_s: list[float] = []
        self._since_s = 0.0

    def enter(self, agent: int, slot: int) -> None:
        """Note that a step begins."""
        self._since_s = process_time()

    def leave(self) -> None:
        """Note that it has ended."""
        self.all_s.append(process_time() - self._since_s)


@lru_cache(maxsize=16)
def agent_cost(agents: int, start_s: float = START_S, together: int = 0) -> AgentCost:
    """Return what an agent of a team costs in its start phase; measured once for each size.

    together: so many agents fly in all, in teams of this size side by side. Each step then finds
    the processor's caches as cold, whatever the size of the team.
    """
    scenario, times = wedge(agents, start_s, EIGHT_IN_RANGE_M), StepTimes()
    fleets = [
        VirtualFleet(replace(scenario, seed=1 + k), watch=times)
        for k in range(max(1, together // agents))
    ]
    times.all_s.clear()  # making an agent is no step
    began_s = process_time()
    while fleets[0].loop.world.slot < scenario.slots and process_time() - began_s < MOST_CPU_S:
        for fleet in fleets:
            fleet.slot()
    spent_s = process_time() - began_s
    steps = sorted(times.all_s)
    dearest = steps[-ceil(DEAREST * len(steps)) :]
    agent_seconds = len(steps) / scenario.fleet.tick_hz
    counters = [fleet.medium_counters for fleet in fleets]
    local_bps, multihop_bps = (
        sum(sum(each.sent_b[channel :: len(CHANNELS)]) for each in counters) / agent_seconds
        for channel in (LOCAL, MULTIHOP)
    )
    return AgentCost(
        beacon_b=local_bps / scenario.comms.local_hz,
        local_bps=local_bps,
        multihop_bps=multihop_bps,
        step_us=1e6 * sum(steps) / len(steps),
        dearest_us=1e6 * sum(dearest) / len(dearest),
        worst_us=1e6 * steps[-1],
        heard_by=sum(e.fates["delivered"] for e in counters) / sum(e.sent for e in counters),
        flight_us=1e6 * spent_s / len(steps),
    )
