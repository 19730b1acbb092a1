"""A phase of a run: one formation and frame, from the mission that asked for it to the next one.

The frame may rest or move on its path. Of an agent's telemetry, only the place that it claims and
the mission that it flies are used; the position of that place is computed here. Together, the
team's places must be those that ``expected_places`` finds by itself.
"""

from collections import Counter
from collections.abc import Sequence
from math import degrees, inf, isfinite, isnan, nan, remainder, sqrt, tau
from typing import Final, NamedTuple

import numpy as np

from agent.messages import AT_HOME, FramePath, Place, Vector
from agent.qstructure.formation import NO_PLACES, Formation, Slot
from agent.qstructure.frame_path import Track
from agent.qstructure.target_frame import Frame
from worldsim.judge.asked_time import AskedTime
from worldsim.judge.expected_places import ExpectedPlaces
from worldsim.judge.tick import Tick, same_claims
from worldsim.scenario.tables import CONVERGED_M, CONVERGED_S

NO_CLAIM: Final = (-1, -1)
TIME_SLACK_S: Final = 1e-9

SlotsByRow = dict[int, Slot]


class ConvergenceTimer:
    """Finds the first CONVERGED_S seconds that agents are in place without interruption."""

    def __init__(self) -> None:
        self.since_s: float | None = None
        """Since when they have been in place [s]; None where they are not."""
        self.converged_s: float | None = None
        """The start of those seconds, in simulated time [s]; None before they are over."""

    def see(self, time_s: float, in_place: bool) -> None:
        """Take a tick; ticks come in order."""
        if not in_place:
            self.since_s = None
            return
        if self.since_s is None:
            self.since_s = time_s
        if self.converged_s is None and time_s - self.since_s >= CONVERGED_S - TIME_SLACK_S:
            self.converged_s = self.since_s


class _SlotPositions(NamedTuple):
    """The slots' positions in the world, and what they were computed from."""

    slots: SlotsByRow
    frame: Frame | None
    position: list[Vector | None]  # row i = agent i [m; world frame], None without a slot


class Phase:
    """One formation in one frame, and how the team converges into it.

    mission: its key; an agent that flies an older mission has no slot in this phase. expected: the
    places that the team must fill; None: any slots will do.
    """

    def __init__(
        self,
        formation: Formation,
        from_s: float,
        path: FramePath = AT_HOME,
        mission: int = 0,
        expected: ExpectedPlaces | None = None,
    ) -> None:
        self.formation = formation
        self.from_s = from_s
        self.mission = mission
        self.residual_m: float | None = None
        """The largest slot error at the last tick [m]; None where an agent has no valid slot."""
        self.at_slots = False
        """Whether each running agent is near its own slot, as sides of a partition may be too."""
        self._track = Track(path)
        self._timer = ConvergenceTimer()
        self._asked = AskedTime(from_s)
        self._known_slots: dict[tuple[int, int, int], Slot | None] = {}
        self._own: SlotsByRow = {}
        self._own_of: Tick | None = None
        """The tick that they were found in, with ``_own_blocked``."""
        self._own_blocked = self._blocked = NO_PLACES
        self._expected = expected
        self._filled = expected is None
        """Whether the running agents' own slots are exactly the expected places."""
        self._positions = _SlotPositions(slots={}, frame=None, position=[])

    @property
    def converge_s(self) -> float | None:
        """Time from the phase's start until all were in place for 2 s, less those 2 s [s]."""
        at_s = self._timer.converged_s
        return None if at_s is None else at_s - self.from_s

    @property
    def in_place_from_s(self) -> float | None:
        """Since when all have been in place, for less than 2 s so far [s; simulated time].

        None where they are not, and once the team has converged.
        """
        return self._timer.since_s if self._timer.converged_s is None else None

    @property
    def timed_from_s(self) -> float | None:
        """From when the time to converge counts [s; simulated time]; None while a fault forbids it.

        It is the start, or the end of the last fault that forbade it before the convergence. It
        stays None where the team converged though a fault forbade it: that was not timed.
        """
        return self._asked.from_s

    def note(self, t_s: float, *, forbidden: bool) -> None:
        """Take from a time on whether a fault in force forbids converging [s; simulated time]."""
        if self._timer.converged_s is None:
            self._asked.note(t_s, forbidden=forbidden, standing_since_s=self._timer.since_s)

    def asked_s(self, until_s: float) -> float:
        """Return how long the team has been asked to converge, and did not stand, until a time [s].

        It is the longest time that no fault broke off which forbids it.
        """
        converged_s, since_s = self._timer.converged_s, self._timer.since_s
        standing_s = converged_s if converged_s is not None else since_s
        return self._asked.until(until_s if standing_s is None else standing_s)

    def frame(self, time_s: float) -> Frame:
        """Return the target's frame at a time [s]."""
        return self._track.at(time_s)

    def slot_error(self, tick: Tick, blocked: frozenset[Place] = NO_PLACES) -> list[float]:
        """Return how far each agent is from the slot that it claims [m]; infinite if not valid.

        A slot that two agents claim is valid for neither: none of them counts as arrived. blocked:
        places in which other vehicles hover; a team that has to leave them out stands elsewhere on
        a closed queue.
        """
        self._blocked = blocked
        return [
            _distance(here, slot)
            for here, slot in zip(tick.position.tolist(), self._slot_positions(tick), strict=True)
        ]

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
        return [
            (queue, rank) if mission >= self.mission else NO_CLAIM
            for (queue, rank), mission in zip(
                tick.place.tolist(), tick.mission.tolist(), strict=True
            )
        ]

    def see(self, time_s: float, error: Sequence[float]) -> bool:
        """Take the running agents' slot errors [m] at a tick; return whether all are in place.

        All are where each is near its slot, and their slots are exactly the expected places.
        """
        worst = -inf
        for error_m in error:
            worst = max(worst, error_m)
        self.residual_m = worst if isfinite(worst) else None
        self.at_slots = 0.0 <= worst <= CONVERGED_M
        in_place = self.at_slots and self._filled
        self._timer.see(time_s, in_place)
        if self._timer.converged_s is not None:
            self._asked.settle(self._timer.converged_s)
        return in_place

    def _slot_positions(self, tick: Tick) -> list[Vector | None]:
        """Return where each agent's slot is; it is kept while slots and frame stay the same."""
        slots, frame = self.own_slots(tick), self.frame(tick.time_s)
        if slots is not self._positions.slots or frame is not self._positions.frame:
            position: list[Vector | None] = [None] * len(tick.alive)
            for row, slot in slots.items():
                position[row] = frame.to_world(slot.point)
            self._positions = _SlotPositions(slots=slots, frame=frame, position=position)
        return self._positions.position

    def own_slots(self, tick: Tick) -> SlotsByRow:
        """Return the slot of each agent that is the only one to claim a valid one.

        The result is kept until a claim changes, or an agent goes.
        """
        of = self._own_of
        if of is None or self._blocked != self._own_blocked or not same_claims(of, tick):
            self._own_of, self._own_blocked = tick, self._blocked
            self._own = self._find_slots(tick)
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
        slots = {row: slot for row, slot in found.items() if slot is not None}
        if self._expected is not None:
            alive = tick.alive.tolist()
            held = [slot.point for row, slot in slots.items() if alive[row]]
            self._filled = len(held) == team and self._expected.are(held, self._blocked)
        return slots

    def _slot(self, queue: int, rank: int, team: int) -> Slot | None:
        key = (queue, rank, team)
        if key not in self._known_slots:
            self._known_slots[key] = self.formation.slot(Place(queue, rank), team)
        return self._known_slots[key]


def _distance(here: Sequence[float], slot: Vector | None) -> float:
    x, y, z = here
    if slot is None:
        return nan if isnan(x) else inf
    a, b, c = slot
    u, v, w = x - a, y - b, z - c
    return sqrt(u * u + v * v + w * w)
