"""A file of all that one agent is given, step by step: with it, its controller can be asked again.

The file holds msgpack values one after the other: the setup as JSON, and for each step a list of
the frames heard since the step before and the encoded observation, followed by the command that
the agent answered. The last step of a process that was killed may be cut off or lack its command.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import msgpack
import msgspec

from agent.codec import decode_command, decode_observation, encode
from agent.config import AgentSetup
from agent.messages import Command, Observation
from agent.rejection import RejectedError
from netem.wire.frame import Frame

MAX_VALUE_B = 16 * 1024**2
"""A longer value in such a file is not read."""


class InputLogError(Exception):
    """A file that is no log of inputs; the text says why."""


class StepInputs(NamedTuple):
    """What an agent was given before and at one step, and what it answered."""

    frames: tuple[Frame, ...]  # heard since the step before
    observation: Observation
    command: Command | None = None  # None where it is not known


class Life(NamedTuple):
    """What one process of an agent was given, from its start to its end."""

    setup: AgentSetup
    steps: list[StepInputs]
    cut: bool = False  # whether its log ends amid a step


def log_path(folder: Path, agent: int, incarnation: int) -> Path:
    """Return the file of one process of an agent in a folder of inputs."""
    return folder / f"agent-{agent}.{incarnation}.msgpack"


class InputLog:
    """Writes the file of one process. A failure to write ends the file, and not the agent."""

    def __init__(self, folder: Path, setup: AgentSetup) -> None:
        self._frames: list[Frame] = []
        self._file = log_path(folder, setup.id, setup.incarnation).open("xb", buffering=0)
        self._write(msgspec.json.encode(setup))

    def hear(self, frames: tuple[Frame, ...]) -> None:
        """Note frames that were heard."""
        self._frames.extend(frames)

    def step(self, observation: Observation) -> None:
        """Note a step."""
        self._write((self._frames, encode(observation)))
        self._frames.clear()

    def answer(self, command: bytes) -> None:
        """Note the encoded command that the agent answers at a step."""
        self._write(command)

    def close(self) -> None:
        """End the file."""
        self._file.close()

    def _write(self, value: object) -> None:
        if self._file.closed:
            return
        try:
            self._file.write(msgspec.msgpack.encode(value))
        except OSError as error:
            self._file.close()
            print(f"the log of inputs ends here: {error.strerror}", file=sys.stderr)


def logged_lives(folder: Path, agent: int) -> list[Life]:
    """Return what the processes of an agent were given, in order. Raises InputLogError."""
    lives: list[Life] = []
    while (file := log_path(folder, agent, len(lives))).is_file():
        lives.append(_life(file))
    return lives


def _life(file: Path) -> Life:
    try:
        with file.open("rb") as opened:
            unpacker: Any = msgpack.Unpacker(  # type: ignore[attr-defined, no-untyped-call]
                opened, max_buffer_size=MAX_VALUE_B
            )
            values = _values(unpacker)
            setup = msgspec.json.decode(msgspec.convert(next(values, b""), bytes), type=AgentSetup)
            steps = list(_steps(values))
            return Life(setup, steps, cut=unpacker.tell() < file.stat().st_size)
    except (OSError, ValueError, TypeError, RejectedError, msgspec.MsgspecError) as error:
        raise InputLogError(f"{file}: no log of inputs: {error}") from error


def _values(unpacker: Any) -> Iterator[object]:
    """Yield the whole values of a file."""
    while True:
        try:
            yield unpacker.unpack()
        except msgpack.exceptions.OutOfData:
            return


def _steps(values: Iterator[object]) -> Iterator[StepInputs]:
    step: StepInputs | None = None
    for value in values:
        if isinstance(value, bytes) and step is not None:
            yield step._replace(command=decode_command(value))
            step = None
            continue
        if step is not None:
            yield step
        heard, observation = msgspec.convert(value, tuple[list[Frame], bytes])
        step = StepInputs(tuple(heard), decode_observation(observation))
    if step is not None:
        yield step
