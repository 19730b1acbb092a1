"""A phase of a run: one formation and frame, from the mission that asked for it to the next one.

The frame may rest or move on its path. Of an agent's telemetry, only the place that it claims and
the mission that it flies are used; the position of that place is computed here.
"""

from collections import Counter
from math import degrees, isfinite, remainder, tau
from typing import Final, NamedTuple

import numpy as np

from agent.messages import AT_HOME, FramePath, Place
from agent.qstructure.formation import NO_PLACES, Formation, Slot
from agent.qstructure.frame_path import Track
from agent.qstructure.target_frame import Frame
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import CONVERGED_M, CONVERGED_S
from worldsim.truth.vehicle import Floats

NO_CLAIM = (-1, -1)
TIME_SLACK_S: Final = 1e-9

SlotsByRow = dict[int, Slot]


class ConvergenceTimer:
    """Finds the first CONVERGED_S seconds that agents are in place without interruption."""

    def __init__(self) -> None:
        self._since_s: float | None = None
        self.converged_s: float | None = None
        """The start of those seconds, in simulated time [s]; None before they are over."""

    def see(self, time_s: float, in_place: bool) -> None:
        """Take a tick; ticks come in order."""
        if not in_place:
            self._since_s = None
            return
        if self._since_s is None:
            self._since_s = time_s
        if self.converged_s is None and time_s - self._since_s >= CONVERGED_S - TIME_SLACK_S:
            self.converged_s = self._since_s


class _SlotPositions(NamedTuple):
    """The slots' positions in the world, and what they were computed from."""

    slots: SlotsByRow
    frame: Frame | None
    position: Floats  # (N, 3) [m; world frame], infinite without a slot


class Phase:
    """One formation in one frame, and how the team converges into it.

    mission: its key; an agent that flies an older mission has no slot in this phase.
    """

    def __init__(
        self, formation: Formation, from_s: float, path: FramePath = AT_HOME, mission: int = 0
    ) -> None:
        self.formation = formation
        self.from_s = from_s
        self.mission = mission
        self.residual_m: float | None = None
        """The largest slot error at the last tick [m]; None where an agent has no valid slot."""
        self._track = Track(path)
        self._timer = ConvergenceTimer()
        self._known_slots: dict[tuple[int, int, int], Slot | None] = {}
        self._own: SlotsByRow = {}
        self._own_key: tuple[object, ...] | None = None
        self._blocked = NO_PLACES
        self._positions = _SlotPositions(slots={}, frame=None, position=np.empty(0))

    @property
    def converge_s(self) -> float | None:
        """Time from the phase's start until all were in place for 2 s, less those 2 s [s]."""
        at_s = self._timer.converged_s
        return None if at_s is None else at_s - self.from_s

    def frame(self, time_s: float) -> Frame:
        """Return the target's frame at a time [s]."""
        return self._track.at(time_s)

    def slot_error(self, tick: Tick, blocked: frozenset[Place] = NO_PLACES) -> Floats:
        """Return the distances (N,) [m] of agents to the slots they claim; infinite if not valid.

        A slot that two agents claim is valid for neither: none of them counts as arrived. blocked:
        places in which other vehicles hover; a team that has to leave them out stands elsewhere on
        a closed queue.
        """
        self._blocked = blocked
        away = tick.position - self._slot_positions(tick)
        square = away * away
        error: Floats = np.sqrt(square[:, 0] + square[:, 1] + square[:, 2])
        return error

    def attitude_error_deg(self, tick: Tick) -> float | None:
        """Return the largest difference between an agent's attitude and its slot's [deg].

        Angles that a queue leaves free do not count; None where all are free.
        """
        return max(self.attitude_errors_deg(tick).values(), default=None)

    def attitude_errors_deg(self, tick: Tick) -> dict[int, float]:
        """Return for each row the difference between the agent's attitude and its slot's [deg].

        It is the largest of the angles that the queue does not leave free; without any such angle,
        or without a valid slot, a row is left out.
        """
        turned = (self.frame(tick.time_s).yaw, 0.0, 0.0)
        found: dict[int, float] = {}
        for row, slot in self.own_slots(tick).items():
            errors = [
                abs(remainder(wanted + turn - float(flown), tau))
                for wanted, turn, flown in zip(
                    slot.attitude, turned, tick.attitude[row], strict=True
                )
                if wanted is not None
            ]
            if errors and tick.alive[row]:
                found[row] = degrees(max(errors))
        return found

    def claims(self, tick: Tick) -> list[tuple[int, int]]:
        """Return each agent's claim in this phase, queue and rank; NO_CLAIM without one."""
        flies_this = (tick.mission >= self.mission).tolist()
        return [
            (queue, rank) if flies else NO_CLAIM
            for (queue, rank), flies in zip(tick.place.tolist(), flies_this, strict=True)
        ]

    def see(self, time_s: float, error: Floats) -> bool:
        """Take the living agents' slot errors [m] at a tick; return whether all are in place."""
        worst = float(np.fmax.reduce(error, initial=-np.inf))
        self.residual_m = worst if isfinite(worst) else None
        in_place = 0.0 <= worst <= CONVERGED_M
        self._timer.see(time_s, in_place)
        return in_place

    def _slot_positions(self, tick: Tick) -> Floats:
        """Return where each agent's slot is (N, 3) [m; world frame], infinite without one.

        The result is kept while slots and frame stay the same.
        """
        slots, frame = self.own_slots(tick), self.frame(tick.time_s)
        if slots is not self._positions.slots or frame is not self._positions.frame:
            position = np.full(tick.position.shape, np.inf)
            for row, slot in slots.items():
                position[row] = frame.to_world(slot.point)
            self._positions = _SlotPositions(slots=slots, frame=frame, position=position)
        return self._positions.position

    def own_slots(self, tick: Tick) -> SlotsByRow:
        """Return the slot of each agent that is the only one to claim a valid one.

        The result is kept until a claim changes, or an agent goes.
        """
        rows = (tick.place, tick.alive, tick.mission)
        key = (*(each.tobytes() for each in rows), self._blocked)
        if key != self._own_key:
            self._own_key, self._own = key, self._find_slots(tick)
        return self._own

    def _find_slots(self, tick: Tick) -> SlotsByRow:
        claims = self.claims(tick)
        holders = Counter(claim for claim, alive in zip(claims, tick.alive, strict=True) if alive)
        team = int(np.sum(tick.alive))
        filled = self.formation.layout(team, self._blocked).slots if self._blocked else {}
        found = {
            row: filled.get(Place(*claim)) or self._slot(*claim, team)
            for row, claim in enumerate(claims)
            if holders[claim] <= 1
        }
        return {row: slot for row, slot in found.items() if slot is not None}

    def _slot(self, queue: int, rank: int, team: int) -> Slot | None:
        key = (queue, rank, team)
        if key not in self._known_slots:
            self._known_slots[key] = self.formation.slot(Place(queue, rank), team)
        return self._known_slots[key]
