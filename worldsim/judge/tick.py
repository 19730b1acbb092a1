"""What is judged and recorded once a tick: the same rows for both, so that both can agree.

Rows are single precision, as the recording keeps them: a verdict recomputed from the recording
meets the very numbers that the first one met. (The trace hash covers every slot in full.)
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Singles = NDArray[np.float32]
Packets = dict[str, int]


@dataclass(frozen=True, slots=True)
class Standings:
    """How agents stand in their queues, as they say: shown, not judged. Row i = agent i.

    tier (N,), parent (N,): -1 for none; role (N,): index of ROLES, -1 for one who takes no part.
    record_age_s (N,): the age of the oldest record kept of a member, NaN for one who takes no part.
    """

    tier: NDArray[np.int16]
    parent: NDArray[np.int32]
    role: NDArray[np.int8]
    record_age_s: Singles


@dataclass(frozen=True, slots=True)
class Tick:
    """One tick of truth and telemetry; row i = agent i, NaN for no vehicle in the world.

    position (N, 3) [m; world frame]; attitude (N, 3): yaw, pitch, roll [rad]; target (N, 3) [m;
    world frame], the target-on-queue, NaN for none; place (N, 2): queue and rank, -1 for none;
    force (N,): |u_i| of (28); turn_deg (N,): azimuth of the wanted velocity against the heading on
    moving steps, else NaN; alive (N,): whether the agent's process takes part, and is not paused;
    links (L, 2): (hearer, heard). mission (N,): the key of the mission that each flies. packets:
    the newest counters of the medium, as in summary.json; empty before there are any. standings:
    as they were told, None where nobody records them.
    """

    index: int
    time_s: float
    position: Singles
    attitude: Singles
    target: Singles
    place: NDArray[np.int16]
    force: Singles
    turn_deg: Singles
    alive: NDArray[np.bool_]
    links: NDArray[np.int32]
    mission: NDArray[np.int64]
    packets: Packets = field(default_factory=dict)
    standings: Standings | None = None
