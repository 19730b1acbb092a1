"""Recoveries: how long a team that changed takes until it stands in a whole formation again.

Whole: the living hold exactly the places that the formation has for so many, and those that a dead
vehicle hovers in are not among them (E18). Standing: each within 0.12 m of its own, for 2 s.
"""

from dataclasses import dataclass

import numpy as np

from agent.messages import Place
from worldsim.judge.hovering_vehicles import HoveringVehicles
from worldsim.judge.phase import Phase
from worldsim.judge.run_events import LOSS_KINDS, LossEvent, ReturnEvent
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import CONVERGED_S


@dataclass(slots=True)
class Recovery:
    """One change of the team: at ``t_s`` [s] these agents went, or came.

    reformed_s: from then to the start of the 2 s [s]; None as long as there were none.
    """

    t_s: float
    kind: str
    agents: list[int]
    reformed_s: float | None = None


class Recoveries:
    """Every change of the team in a run, and what became of it; bodies: shown every tick."""

    def __init__(self, bodies: HoveringVehicles) -> None:
        self.all: list[Recovery] = []
        self._open: list[Recovery] = []
        self._since_s: float | None = None
        self._bodies = bodies
        self._seen: tuple[bytes, ...] = ()
        self._whole = False

    def note(self, event: LossEvent | ReturnEvent) -> None:
        """Note that an agent went or came; without an agent, that a start was refused."""
        self._since_s = None
        last = self.all[-1] if self.all else None
        if last is None or (last.t_s, last.kind) != (event.t_s, event.kind):
            last = Recovery(event.t_s, event.kind, [])
            self.all.append(last)
            self._open.append(last)
        if event.agent is None:
            self._open.remove(last)
        else:
            last.agents.append(event.agent)

    def see(self, tick: Tick, phase: Phase, in_place: bool) -> None:
        """Take a tick; in_place: whether all the living are in their places."""
        if not self._open:
            return
        if not (in_place and self._all_back(tick) and self._is_whole(tick, phase)):
            self._since_s = None
            return
        if self._since_s is None:
            self._since_s = tick.time_s
        if tick.time_s - self._since_s >= CONVERGED_S - 1e-9:
            for recovery in self._open:
                recovery.reformed_s = max(0.0, self._since_s - recovery.t_s)
            self._open = []

    def _all_back(self, tick: Tick) -> bool:
        """Whether those who came, and did not go again, have booted."""
        gone: set[int] = set()
        for recovery in reversed(self.all):
            if recovery.kind in LOSS_KINDS:
                gone.update(recovery.agents)
            elif any(agent not in gone and not tick.alive[agent] for agent in recovery.agents):
                return False
        return True

    def _is_whole(self, tick: Tick, phase: Phase) -> bool:
        rows = (tick.place, tick.alive, tick.mission, self._bodies.hovering(tick))
        seen = tuple(each.tobytes() for each in rows)
        if seen != self._seen:
            self._seen = seen
            held = [claim for claim in phase.claims(tick) if claim[0] >= 0]
            self._whole = set(held) == self._places(tick, phase)
        return self._whole

    def _places(self, tick: Tick, phase: Phase) -> set[Place]:
        """Return the places that the living must hold."""
        team = np.flatnonzero(tick.alive).tolist()
        return set(self._bodies.layout(tick, phase, team).places)
