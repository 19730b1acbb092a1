"""A phase: one formation in one frame, from the mission that asked for it to the next.

The frame may be at rest or on its path.

Of an agent's telemetry only the place that it means to hold is taken, and which mission it flies;
where that place is, is computed here.
"""

from collections import Counter
from math import degrees, isfinite, remainder, tau

import numpy as np

from agent.messages import AT_HOME, FramePath, Place
from agent.qstructure.formation import Formation, Slot
from agent.qstructure.frame_path import Track
from agent.qstructure.target_frame import Frame
from worldsim.judge.metrics import Floats
from worldsim.judge.tick import Tick

CONVERGED_M = 0.12
CONVERGED_S = 2.0
NO_CLAIM = (-1, -1)


class Phase:
    """The time of one formation in one frame, and how the team came into it.

    mission: its key; an agent that flies an older one has no slot in this phase.
    """

    def __init__(
        self, formation: Formation, from_s: float, path: FramePath = AT_HOME, mission: int = 0
    ) -> None:
        self.formation = formation
        self.from_s = from_s
        self._track = Track(path)
        self.mission = mission
        self.converge_s: float | None = None
        self.residual_m: float | None = None
        self._since_s: float | None = None
        self._slots: dict[tuple[int, int, int], Slot | None] = {}
        self._owned: dict[int, Slot] = {}
        self._stood: tuple[dict[int, Slot], Frame | None, Floats] = ({}, None, np.empty(0))
        self._owned_by: tuple[bytes, bytes, bytes] | None = None

    def frame(self, time_s: float) -> Frame:
        """Return where the target's frame is at a time [s]."""
        return self._track.at(time_s)

    def slot_error(self, tick: Tick) -> Floats:
        """Return each agent's distance to the slot it claims [m]; infinite without a valid one.

        Two that claim the same slot have none: neither counts as arrived.
        """
        off = tick.position - self._stands(tick)
        square = off * off
        error: Floats = np.sqrt(square[:, 0] + square[:, 1] + square[:, 2])
        return error

    def _stands(self, tick: Tick) -> Floats:
        """Return where each agent's slot is (N, 3) [m; world frame], infinitely far without one.

        Remembered while slots and frame stay.
        """
        slots, frame = self._own_slots(tick), self.frame(tick.time_s)
        if slots is not self._stood[0] or frame is not self._stood[1]:
            stands = np.full(tick.position.shape, np.inf)
            for row, slot in slots.items():
                stands[row] = frame.to_world(slot.point)
            self._stood = slots, frame, stands
        return self._stood[2]

    def attitude_error_deg(self, tick: Tick) -> float | None:
        """Return the largest angle by which an agent misses its slot's orientation [deg].

        Angles that a queue leaves free do not count; None where all are free.
        """
        frame = self.frame(tick.time_s)
        wanted = [
            (angle + (frame.yaw if axis == 0 else 0.0), float(tick.attitude[row, axis]))
            for row, slot in self._own_slots(tick).items()
            for axis, angle in enumerate(slot.attitude)
            if angle is not None and tick.alive[row]
        ]
        missed = [abs(remainder(angle - flown, tau)) for angle, flown in wanted]
        return degrees(max(missed)) if missed else None

    def claims(self, tick: Tick) -> list[tuple[int, int]]:
        """Return each agent's claim in this phase, queue and rank; (-1, -1) without one."""
        flown = (tick.mission >= self.mission).tolist()
        return [
            (queue, rank) if flies else NO_CLAIM
            for (queue, rank), flies in zip(tick.place.tolist(), flown, strict=True)
        ]

    def _own_slots(self, tick: Tick) -> dict[int, Slot]:
        """Return the slot of each agent that claims a valid one alone, by row.

        What was found holds until a claim changes, or an agent goes.
        """
        claimed = tick.place.tobytes(), tick.alive.tobytes(), tick.mission.tobytes()
        if claimed != self._owned_by:
            self._owned_by, self._owned = claimed, self._find_slots(tick)
        return self._owned

    def _find_slots(self, tick: Tick) -> dict[int, Slot]:
        claims = self.claims(tick)
        holders = Counter(claim for claim, alive in zip(claims, tick.alive, strict=True) if alive)
        team = int(np.sum(tick.alive))
        return {
            row: slot
            for row, claim in enumerate(claims)
            if holders[claim] <= 1 and (slot := self._slot(*claim, team)) is not None
        }

    def _slot(self, queue: int, rank: int, team: int) -> Slot | None:
        key = (queue, rank, team)
        if key not in self._slots:
            self._slots[key] = self.formation.slot(Place(queue, rank), team)
        return self._slots[key]

    def see(self, time_s: float, error: Floats) -> bool:
        """Take the living agents' slot errors [m] at a tick; return whether all are in place."""
        worst = float(np.fmax.reduce(error, initial=-np.inf))
        self.residual_m = worst if isfinite(worst) else None
        if not 0.0 <= worst <= CONVERGED_M:
            self._since_s = None
            return False
        if self._since_s is None:
            self._since_s = time_s
        if self.converge_s is None and time_s - self._since_s >= CONVERGED_S - 1e-9:
            self.converge_s = self._since_s - self.from_s
        return True
