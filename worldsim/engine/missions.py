"""Missions for the team: each is given to one agent, which spreads it by radio."""

from collections.abc import Sequence
from typing import Literal, assert_never

from agent.codec import encode_formation
from agent.comms.mission import KEYS_PER_VERSION, is_plausible
from agent.messages import NO_MISSION, Mission
from agent.qstructure.formation import FormationSpec
from worldsim.engine.operations import GiveMission
from worldsim.scenario.faults import MissionChange
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import FrameChange, changed_frame, path_of


class Missions:
    """The newest formation and frame, and the newest mission while no running agent flies it.

    A mission is given again until a running agent reports that it flies it. So it is not lost with
    the agent that got it, nor with an observation, nor when all agents restart.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.formation = scenario.formation
        self.frame = scenario.frame
        self.to: int | None = None
        """The agent that gets the newest mission; None: the running agent with the lowest id."""
        self._order: Mission | None = None
        """The newest mission issued here."""
        self._issued = 0
        """The version of the newest mission issued here."""
        self._flown = [NO_MISSION] * scenario.rows
        """The key of the mission that each agent flies, as reported; row i = agent i."""

    @property
    def newest(self) -> int:
        """The version of the newest mission that was issued here or reported by an agent."""
        return max(self._issued, max(self._flown) // KEYS_PER_VERSION)

    def changed(self, change: MissionChange, at_s: float) -> GiveMission:
        """Return the mission that changes the formation or the frame at a time [s]."""
        match change:
            case FormationSpec():
                self.formation = change
                return self._given("formation")
            case FrameChange():
                self.frame = changed_frame(self.frame, change, at_s)
                return self._given("frame")
        assert_never(change)

    def issue(self, mission: GiveMission) -> int:
        """Give a mission to the team; return its key, which is above all keys reported so far."""
        self._issued = mission.version or self.newest + 1
        self.to = mission.to
        key = self._issued * KEYS_PER_VERSION
        formation = encode_formation(mission.formation)
        self._order = Mission(key=key, frame=mission.path, formation=formation)
        return key

    def report(self, agent: int, key: int, time_s: float) -> None:
        """Record the key of the mission that an agent flies at a time [s]; NO_MISSION at its start.

        A key that no team can have reached by then is invented, and ignored.
        """
        if not is_plausible(key, time_s):
            return
        self._flown[agent] = key

    def unknown(self, running: Sequence[bool]) -> Mission | None:
        """Return the newest mission while no running agent flies it or a newer one, else None.

        running: for each agent, whether it takes part.
        """
        order = self._order
        if order is None:
            return None
        known = any(
            runs and key >= order.key for runs, key in zip(running, self._flown, strict=True)
        )
        return None if known else order

    def _given(self, kind: Literal["formation", "frame"]) -> GiveMission:
        return GiveMission(kind=kind, formation=self.formation, path=path_of(self.frame))
