"""I5: the mission that an agent flies never goes back to an older one while its process lives."""

from worldsim.judge.finding import InvariantTally
from worldsim.judge.tick import Tick


class MissionOrder:
    """Follows the key of each agent's mission: keys are ordered, and none is the least."""

    def __init__(self) -> None:
        self.tally = InvariantTally()
        self._newest: dict[int, int] = {}
        """The newest key that each agent's process has flown."""
        self._last: Tick | None = None

    def forget(self, agent: int) -> None:
        """Take the start of an agent's new process, which knows no mission."""
        self._newest.pop(agent, None)
        self._last = None

    def see(self, tick: Tick) -> None:
        """Take a tick; ticks come in order, after the events of their time."""
        last, self._last = self._last, tick
        if last is not None and last.mission is tick.mission and last.alive is tick.alive:
            self.tally.count(0)
            return
        went_back = 0
        rows = zip(tick.alive.tolist(), tick.mission.tolist(), strict=True)
        for agent, (alive, key) in enumerate(rows):
            if alive:
                newest = self._newest.get(agent, key)
                went_back += key < newest
                self._newest[agent] = max(key, newest)
        self.tally.count(went_back)
