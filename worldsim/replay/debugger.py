"""The debugger in a replay: it stops at the first line of ``decide``, and where that fails."""

import pdb

from agent.controller import Controller, Intent, Senses


class ReplayLeftError(Exception):
    """The user has quit the debugger."""


class StepDebugger:
    """Asks a controller under pdb; breakpoints last from step to step.

    It stops in ``decide`` of each step: ``continue`` goes on to the next one, ``quit`` ends the
    replay.
    """

    def __init__(self) -> None:
        self._pdb = _StepPdb()

    @property
    def left(self) -> bool:
        """Whether the user has quit."""
        return self._pdb.left

    def ask(self, controller: Controller, senses: Senses) -> Intent:
        """Return the controller's intent. Raises ReplayLeftError, and what the controller does."""
        try:
            intent = self._pdb.runcall(controller.decide, senses)
        except Exception as error:
            self._pdb.message(f"{type(error).__name__}: {error}")
            self._pdb.reset()
            self._pdb.interaction(None, error.__traceback__)
            raise
        if self._pdb.left or intent is None:
            raise ReplayLeftError
        return intent


class _StepPdb(pdb.Pdb):
    left = False

    def set_quit(self) -> None:
        self.left = True
        super().set_quit()
