"""What a flight and the process that watches it share: a few numbers and an error, in memory.

Memory outlives closed descriptors, ignored signals and the flight itself.
"""

import fcntl
import mmap
import os
from contextlib import suppress
from typing import NamedTuple

from agent.controller import FaultyControllerError
from worldsim.scenario.tables import Scenario

TEXT_B = 32 * 1024
NOBODY = -1

_STEPS, _AGENT, _SLOT, _STOP, _DEBUGGED, _ENDED, _TEXT = range(7)
_NUMBERS_B = 64


class ClosedFilesError(FaultyControllerError):
    """A controller closed descriptors of its process: nothing can be written any more."""


class Place(NamedTuple):
    """Where a flight is, or was when it ended."""

    steps: int
    """Number of times that an agent's code was entered or left."""
    agent: int | None
    """The agent whose code runs; None: none."""
    slot: int


class Pulse:
    """The shared page of one flight.

    descriptor: of the memory of an existing pulse; None: a new one.
    """

    def __init__(self, descriptor: int | None = None) -> None:
        self.descriptor = os.memfd_create("qswarm-pulse") if descriptor is None else descriptor
        os.ftruncate(self.descriptor, _NUMBERS_B + TEXT_B)
        self._page = mmap.mmap(self.descriptor, _NUMBERS_B + TEXT_B)
        self._numbers = memoryview(self._page)[:_NUMBERS_B].cast("q")
        self._numbers[_AGENT] = NOBODY

    def close(self) -> None:
        """Close the descriptor; what was written can still be read."""
        os.close(self.descriptor)

    @property
    def place(self) -> Place:
        """Where the flight is."""
        agent = self._numbers[_AGENT]
        return Place(
            self._numbers[_STEPS], agent if agent != NOBODY else None, self._numbers[_SLOT]
        )

    @property
    def stop_requested(self) -> bool:
        """Whether the flight is asked to end between two slots."""
        return bool(self._numbers[_STOP])

    def request_stop(self) -> None:
        """Ask the flight to end between two slots."""
        self._numbers[_STOP] = 1

    @property
    def debugged(self) -> bool:
        """Whether a breakpoint was hit: a person takes their time."""
        return bool(self._numbers[_DEBUGGED])

    def note_breakpoint(self) -> None:
        """Note that a breakpoint was hit."""
        self._numbers[_DEBUGGED] = 1

    @property
    def ended(self) -> bool:
        """Whether the flight has ended by itself, with a summary or an error."""
        return bool(self._numbers[_ENDED])

    def note_end(self, error: str = "", details: str = "") -> None:
        """Note that the flight has ended by itself, with an error and its traceback if any."""
        line = error.replace("\0", "\\0")
        data = f"{line}\0{details}".encode("utf-8", "backslashreplace")[:TEXT_B]
        self._page[_NUMBERS_B : _NUMBERS_B + len(data)] = data
        self._numbers[_TEXT] = len(data)
        self._numbers[_ENDED] = 1

    @property
    def error(self) -> tuple[str, str]:
        """The error that ended the flight, and its traceback; empty without one."""
        data = self._page[_NUMBERS_B : _NUMBERS_B + self._numbers[_TEXT]]
        error, _, details = data.decode("utf-8", "replace").partition("\0")
        return error, details

    def move(self, agent: int, slot: int) -> None:
        """Write where the flight is."""
        numbers = self._numbers
        numbers[_AGENT] = agent
        numbers[_SLOT] = slot
        numbers[_STEPS] += 1


class Guard:
    """Watches the steps of a flight from within: who runs, and what it does to its process."""

    def __init__(self, pulse: Pulse, scenario: Scenario) -> None:
        self._pulse = pulse
        self._scenario = scenario
        self._pid = os.getpid()
        self._sentinel = os.open(os.devnull, os.O_RDONLY)
        self._agent, self._slot = NOBODY, 0

    def enter(self, agent: int, slot: int) -> None:
        """Note that an agent's code is entered."""
        self._agent, self._slot = agent, slot
        self._pulse.move(agent, slot)

    def leave(self) -> None:
        """Note that it has returned. Raises FaultyControllerError where it closed descriptors.

        A copy of this process that a controller has forked ends here.
        """
        if os.getpid() != self._pid:
            self._end_copy()
        try:
            fcntl.fcntl(self._sentinel, fcntl.F_GETFD)
        except OSError as error:
            blamed = blame(self._scenario, self._agent, self._slot)
            raise ClosedFilesError(f"{blamed}: it closed the files of its process") from error
        self._pulse.move(NOBODY, self._slot)

    def _end_copy(self) -> None:
        time_s = self._slot / self._scenario.slot_hz
        line = f"agent {self._agent}'s controller forked at {time_s:g} s; the copy ends here\n"
        with suppress(OSError):
            os.write(2, line.encode())
        os._exit(1)


def blame(scenario: Scenario, agent: int, slot: int) -> str:
    """Return whose controller failed and when, as the beginning of a sentence."""
    name, time_s = scenario.control.controller, slot / scenario.slot_hz
    return f"controller {name!r} of agent {agent} failed at {time_s:g} s"
