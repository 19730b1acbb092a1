"""A controller in any language: one child process for each agent, asked by lines of JSON.

In virtual time and in lockstep, time waits for its answers, and the same child gives the same
flight. In a free-running fleet an answer that comes late stops the vehicle for that tick.
"""

import sys

from agent.child import Child, ProgramError
from agent.config import AgentSetup
from agent.controller import Intent, Senses
from agent.controller_log import Logging
from agent.lines import SensesLines, hover, intent_of, setup_line

START_WITHIN_S = 5.0
"""A child reads its first line within this time."""
ANSWER_WITHIN_S = 8.0
"""Where time waits, an answer comes within this time."""
SHARE_OF_TICK = 0.5
"""Where time does not wait, an answer comes within this share of a tick."""
SILENT_S = 5.0
"""A child whose answer does not come at all for this time has failed [s; simulated time]."""


class NoAnswerError(ProgramError):
    """A child that does not answer."""


class CommandController(Logging):
    """Asks a child for one agent's intents."""

    Parameters = dict
    """Any, unchecked: they are in the setup that the child is told."""

    def __init__(self, setup: AgentSetup, parameters: dict[str, object]) -> None:
        self._real_time = setup.real_time
        self._within_s = SHARE_OF_TICK / setup.tick_hz if self._real_time else ANSWER_WITHIN_S
        self._lines = SensesLines(setup.team)
        self._missed = 0
        self._answered = 0
        """How many answers had come when one was last missed."""
        self._silent_from_s = 0.0
        """Since when no answer has come."""
        self._child = Child(setup.control.command or ())
        self._child.tell(setup_line(setup), START_WITHIN_S)

    def decide(self, senses: Senses) -> Intent:
        """Return what the child wants; where it is late, to stop."""
        answer = self._child.ask(self._lines.line(senses), self._within_s)
        if answer is not None:
            intent, lines = intent_of(answer, senses)
            for line in lines:
                self.log(line)
            return intent
        if not self._real_time:
            raise NoAnswerError(f"no answer within {self._within_s:g} s")
        self._count_missed(senses.now_s)
        return hover(senses)

    def _count_missed(self, now_s: float) -> None:
        """Count a tick without an answer, and tell of the 1st, 10th, 100th ... in the agent's log.

        Raises NoAnswerError where none has come for SILENT_S, not even a late one.
        """
        self._missed += 1
        if self._missed == 1 or self._child.answered != self._answered:
            self._answered, self._silent_from_s = self._child.answered, now_s
        if now_s - self._silent_from_s >= SILENT_S:
            raise NoAnswerError(f"no answer since {self._silent_from_s:.2f} s")
        if str(self._missed).rstrip("0") == "1":
            print(f"{now_s:.2f} s: no answer in time, {self._missed} so far", file=sys.stderr)
