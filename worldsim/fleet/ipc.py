"""Typed messages between the launcher, the zygote and the world, over socket pairs.

Each direction is a tagged union of frozen structs, encoded as msgpack. A message that does not
decode raises :class:`MessageError`, which names its sender.
"""

import socket
from collections.abc import Iterable
from typing import Annotated, Generic, Literal, NamedTuple, TypeVar

import msgspec
from msgspec import Meta

from worldsim.fleet.fork import ProcessExit
from worldsim.judge.event import By
from worldsim.results.progress_line import pace_text
from worldsim.scenario.selectors import ProcessName

MAX_MESSAGE_B = 64 * 1024

ProcessAction = Literal["start", "kill", "pause", "resume"]
"""What can be done to an agent's process."""
Natural = Annotated[int, Meta(ge=0)]
Pid = Annotated[int, Meta(ge=1)]


class MessageError(ValueError):
    """A message that cannot be sent or decoded; the text names the other process and the reason."""


class AgentProcess(NamedTuple):
    """One process of an agent."""

    agent: Natural
    incarnation: Natural  # counts the agent's processes, from 0

    def __str__(self) -> str:
        return f"agent-{self.agent}"


def names_of(processes: Iterable[AgentProcess]) -> str:
    """Return the processes' names, as part of a sentence."""
    return ", ".join(map(str, processes))


class Message(msgspec.Struct, frozen=True, tag=True, tag_field="kind", forbid_unknown_fields=True):
    """A message between two processes of one run."""


class ActionRequest(Message, frozen=True):
    """Start, kill, pause or resume agents' processes."""

    action: ProcessAction
    processes: tuple[AgentProcess, ...]
    after_s: float = 0.0  # wall time that a started process sleeps first [s]
    by: By = None  # who asked for it


class ActionDone(Message, frozen=True):
    """An action has taken effect on all of its processes."""

    action: ProcessAction
    processes: tuple[AgentProcess, ...]


class OtherProcessRequest(Message, frozen=True):
    """Kill, pause, resume or start netem's processes, or kill or pause the world."""

    process: ProcessName
    action: ProcessAction
    for_s: float = 0.0  # wall time after which the world is woken from a pause [s]
    by: By = None  # who asked for it


class WorldWoken(Message, frozen=True):
    """The world's pause is over."""


class IntruderRequest(Message, frozen=True):
    """Start the intruder of a fault; its process is named after the fault's number."""

    number: Natural
    agents: tuple[Natural, ...]  # whose passwords it has; none: it has no password
    per_s: float  # messages on each key, or connections [1/s; wall time]


class IntruderEndRequest(Message, frozen=True):
    """Kill the intruder of a fault, where there is one."""

    number: Natural


class EndRequest(Message, frozen=True):
    """End all agents, then exit."""


class AgentStarted(Message, frozen=True):
    """An agent's process was forked."""

    process: AgentProcess
    pid: Pid


class AgentExited(Message, frozen=True):
    """An agent's process has ended, as waitpid reports it."""

    process: AgentProcess
    pid: Pid
    exit: ProcessExit
    log_end: str = ""  # the last line of its log, and which log; "" where it reported no error


class IntruderStarted(Message, frozen=True):
    """An intruder's process was forked."""

    number: Natural
    pid: Pid


class IntruderExited(Message, frozen=True):
    """An intruder's process has ended by itself."""

    number: Natural
    exit: ProcessExit


class RunFailed(Message, frozen=True):
    """The run cannot go on: netem, the zygote or the messages between processes failed."""

    reason: str


class ProcessesMissing(Message, frozen=True):
    """These processes have not reported to the world yet; no names: all have."""

    names: tuple[str, ...]


class Progress(Message, frozen=True):
    """The state of a running fleet."""

    time_s: float  # simulated time [s]
    duration_s: float  # simulated time at the run's end [s]
    agents: int  # number of agents that are running
    in_place: int  # number of agents within 0.12 m of their slots
    min_separation_m: float | None  # least separation so far [m]; None before the first tick
    late_fraction: float | None  # share of late ticks; None where there are none
    slowed_to: float | None = None  # speed of simulated time, while below the requested one
    real_time_factor: float | None = None  # simulated seconds in a second of wall time so far
    formation: str = ""  # that is asked for
    faults: tuple[str, ...] = ()  # kinds of those in force, each once

    def __str__(self) -> str:
        separation = "-" if self.min_separation_m is None else f"{self.min_separation_m:.2f} m"
        late = "-" if self.late_fraction is None else f"{self.late_fraction:.1%}"
        of = f"{self.formation}: " if self.formation else ""
        slowed = "" if self.slowed_to is None else f"   slowed to {self.slowed_to:.2f} x"
        faults = f"   in force: {', '.join(self.faults)}" if self.faults else ""
        return (
            f"{pace_text(self.time_s, self.duration_s, self.real_time_factor)}"
            f"   {of}in place {self.in_place}/{self.agents}"
            f"   minimum separation {separation}   late ticks {late}{slowed}{faults}"
        )


class Stalled(Message, frozen=True):
    """Simulated time has stood still for a while."""

    waiting_for: str


class Notice(Message, frozen=True):
    """Something that a person should know at once."""

    text: str


class RunOver(Message, frozen=True):
    """The run has ended; every exit from now on is expected."""


ToZygote = ActionRequest | IntruderRequest | IntruderEndRequest | EndRequest
FromZygote = AgentStarted | AgentExited | ActionDone | IntruderStarted | IntruderExited
ToWorld = AgentExited | ActionDone | WorldWoken | RunFailed
Report = Progress | Stalled | Notice
Request = ActionRequest | OtherProcessRequest | IntruderRequest | IntruderEndRequest
FromWorld = Request | ProcessesMissing | Report | RunOver

Sent = TypeVar("Sent", bound=Message)
Received = TypeVar("Received", bound=Message)


class MessageSocket(Generic[Sent, Received]):
    """One end of a socket pair; messages arrive whole and in order.

    ``closed`` is set once the other end is gone. Reading never waits: wait until ``fileno`` is
    readable.
    """

    def __init__(
        self, end: socket.socket, peer: str, decoder: msgspec.msgpack.Decoder[Received]
    ) -> None:
        self.closed = False
        self._end = end
        self._peer = peer
        self._decoder = decoder

    def fileno(self) -> int:
        """Return the descriptor to wait for."""
        return self._end.fileno()

    def send(self, message: Sent) -> None:
        """Send a message, waiting for room; if the other end is gone, set ``closed`` instead.

        Raises MessageError when the message is longer than MAX_MESSAGE_B.
        """
        self._send(message, 0)

    def offer(self, message: Sent) -> None:
        """Send a message, or drop it when the other end has fallen far behind in reading.

        Raises MessageError when the message is longer than MAX_MESSAGE_B.
        """
        self._send(message, socket.MSG_DONTWAIT)

    def receive(self) -> list[Received]:
        """Return the messages that have arrived.

        Raises MessageError at one that does not decode; those read before it are lost.
        """
        messages: list[Received] = []
        while data := self._read():
            messages.append(self._decoded(data))
        return messages

    def close(self) -> None:
        """Close this end."""
        self.closed = True
        self._end.close()

    def _send(self, message: Sent, flags: int) -> None:
        if self.closed:
            return
        data = msgspec.msgpack.encode(message)
        if len(data) > MAX_MESSAGE_B:
            raise MessageError(
                f"message to {self._peer} not sent: {len(data)} B; at most {MAX_MESSAGE_B} B"
            )
        try:
            self._end.send(data, flags)
        except BlockingIOError:
            return
        except (BrokenPipeError, ConnectionResetError):
            self.closed = True

    def _read(self) -> bytes:
        """Return the next message's bytes, or none; at the end of the stream set ``closed``."""
        if self.closed:
            return b""
        try:
            # One byte more than allowed: the kernel truncates a longer message silently.
            data = self._end.recv(MAX_MESSAGE_B + 1, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return b""
        except ConnectionResetError:
            data = b""
        self.closed = not data
        return data

    def _decoded(self, data: bytes) -> Received:
        if len(data) > MAX_MESSAGE_B:
            raise MessageError(
                f"{self._peer} sent a message of over {MAX_MESSAGE_B} B, the most allowed"
            )
        try:
            return self._decoder.decode(data)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise MessageError(
                f"{self._peer} sent a message that cannot be decoded: {error}"
            ) from error


LauncherToZygote = MessageSocket[ToZygote, FromZygote]
ZygoteToLauncher = MessageSocket[FromZygote, ToZygote]
LauncherToWorld = MessageSocket[ToWorld, FromWorld]
WorldToLauncher = MessageSocket[FromWorld, ToWorld]


def zygote_sockets() -> tuple[LauncherToZygote, ZygoteToLauncher]:
    """Return the launcher's end and the zygote's end of a new socket pair."""
    launcher_end, zygote_end = _pair()
    return (
        MessageSocket(launcher_end, "zygote", msgspec.msgpack.Decoder(FromZygote)),
        MessageSocket(zygote_end, "launcher", msgspec.msgpack.Decoder(ToZygote)),
    )


def world_sockets() -> tuple[LauncherToWorld, WorldToLauncher]:
    """Return the launcher's end and the world's end of a new socket pair."""
    launcher_end, world_end = _pair()
    return (
        MessageSocket(launcher_end, "world", msgspec.msgpack.Decoder(FromWorld)),
        MessageSocket(world_end, "launcher", msgspec.msgpack.Decoder(ToWorld)),
    )


def _pair() -> tuple[socket.socket, socket.socket]:
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
