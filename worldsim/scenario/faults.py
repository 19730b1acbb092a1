"""What an event of the timeline does: to agents' processes, to sensors, to the team's mission.

Faults of the radio are in ``netem.faults``. An event decodes into one of these; who is meant is
found when it happens.
"""

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from agent.config import Table
from agent.qstructure.formation import FormationSpec
from netem.faults import RadioFault
from worldsim.scenario.start import BoxStart, ListStart
from worldsim.scenario.target_frame import FrameChange

Selector = Annotated[
    int | str,
    Meta(description="an id, 'vertex:V1', 'queue:Q1', 'random:2' or 'all'"),
]
Selectors = Annotated[tuple[Selector, ...], Meta(min_length=1, max_length=1000)]
Joiners = Annotated[int, Meta(ge=1, le=1000)]
FailureMode = Literal["stuck", "silent", "wrong"]
"""stuck: the last reading, for ever; silent: no reading; wrong: any reading."""


class _Selected(msgspec.Struct, frozen=True):
    selectors: Selectors


class Kill(_Selected, frozen=True):
    """The agents' processes die; their vehicles stop and hover."""


class Leave(_Selected, frozen=True):
    """The agents' processes die, and their vehicles leave the world."""


class Restart(_Selected, frozen=True):
    """Agents that died or left come back, each with the next incarnation."""


class Pause(_Selected, frozen=True):
    """The agents' processes are stopped; a vehicle hovers once its last command has expired."""


class Resume(_Selected, frozen=True):
    """The agents' paused processes go on."""


class Join(Table, frozen=True):
    """New agents come, under the next free ids."""

    count: Joiners
    start: BoxStart | ListStart | None = None
    """Where their vehicles are put; left out: by the [fleet]'s start."""


class SensorFault(Table, frozen=True):
    """Sensors of some agents fail; ``kind`` left out: every sensor that they have."""

    agents: Selectors
    mode: FailureMode
    kind: Literal["proximity", "laser", "sonar"] | None = None


ProcessFault = Kill | Leave | Restart | Pause | Resume | Join
MissionChange = FormationSpec | FrameChange
Action = RadioFault | ProcessFault | SensorFault | MissionChange
"""What one event does."""
