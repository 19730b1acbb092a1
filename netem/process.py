"""The medium as a process: this host's Zenoh router, and the radio between the agents of one run.

The world decides when a slot is played. Several processes may divide the receivers as shards of the
medium; shard 0 is the router, and the others are its clients.
"""

import sys
from math import inf
from typing import NamedTuple

import msgspec
import zenoh
from zenoh.handlers import RingChannel

from netem.free_running import FreeRunningMedium
from netem.lockstep import LockstepMedium
from netem.messages import MAX_CONDITIONS_B, MediumSetup
from netem.sender_counts import FrameCheck
from netem.wire.access import AccessControl, AccessError
from netem.wire.barrier import LockstepError, RunOverError
from netem.wire.bus import Bus, Handler, Subscriber, drain, receive
from netem.wire.connections import ConnectionLimiter
from netem.wire.keys import Keys, medium_name
from netem.wire.session import SessionError, open_client, open_router
from netem.wire.shutdown import RunEnd, StopRequest

WAIT_S = 0.2
SILENCE_S = 30.0
"""The world counts as gone after so long without a message [s]."""
TRUTH_RING = 16
MAX_QUERIES = 16
OTHER_SOCKETS = 16
"""Connections besides the agents' below which none is looked up."""
USUAL_BY_HAND = 512
"""The same for a router without passwords, to which one process may connect many agents."""


class SilenceError(RuntimeError):
    """No message from the world has arrived for SILENCE_S."""


class ServingOptions(NamedTuple):
    """How a medium treats other processes: those that are silent, and those of another make."""

    patient: bool = False
    """Whether it waits for the world without end: a launcher ends it."""
    check: FrameCheck | None = None
    """Of foreign agents' frames."""


BY_HAND = ServingOptions()


class SetupServer:
    """Accepts the setup of the first run that asks, and refuses every other run.

    shard: this process's number among the shards of the medium; 0 is the router.
    """

    def __init__(self, session: zenoh.Session, shard: int = 0) -> None:
        self.shard = shard
        self.run: str | None = None
        self.setup: MediumSetup | None = None
        key = Keys.any_run("shard", shard) if shard else Keys.any_run("medium")
        self._queries: Handler[zenoh.Query] = session.declare_queryable(
            key, RingChannel(MAX_QUERIES)
        )

    def wait(self, timeout_s: float) -> None:
        """Answer the next query that arrives within ``timeout_s`` [s]."""
        query = receive(self._queries, timeout_s)
        if query is not None:
            self._answer(query)

    def answer_waiting(self) -> None:
        """Answer the queries that have arrived."""
        for query in drain(self._queries, MAX_QUERIES):
            self._answer(query)

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            refusal = self._accept(query)
            if refusal is None:
                query.reply(query.key_expr, b"")
            else:
                query.reply_err(refusal)

    def _accept(self, query: zenoh.Query) -> str | None:
        """Take a run's setup; return why it is refused, or None where it is accepted."""
        run = Keys.run_of(str(query.key_expr))
        if self.run not in (None, run):
            return f"this medium serves run {self.run!r} already; a second run needs its own netem"
        payload = query.payload.to_bytes() if query.payload is not None else b""
        if len(payload) > MAX_CONDITIONS_B:
            return f"conditions: {len(payload)} B; at most {MAX_CONDITIONS_B} B are allowed"
        try:
            setup = msgspec.json.decode(payload, type=MediumSetup)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            return f"conditions: {error}"
        if self.run is None:
            self.run, self.setup = run, setup
        return None


def run(
    endpoint: str,
    shard: int = 0,
    options: ServingOptions = BY_HAND,
    access: AccessControl | None = None,
) -> int:
    """Serve at an endpoint; print an error as one line. Return the exit status."""
    try:
        return serve(endpoint, shard, options, access)
    except (AccessError, SessionError) as error:
        return _failed(shard, error, 2)
    except (SilenceError, LockstepError) as error:
        return _failed(shard, error, 1)


def _failed(shard: int, error: Exception, status: int) -> int:
    print(f"{medium_name(shard)}: {error}", file=sys.stderr)
    return status


def serve(
    endpoint: str,
    shard: int = 0,
    options: ServingOptions = BY_HAND,
    access: AccessControl | None = None,
) -> int:
    """Serve as the medium of the first run that asks; return 0 at its end.

    Shard 0 listens as the router at the endpoint; the others connect to it. access: None allows
    everything.

    Raises SessionError when it cannot listen or connect, AccessError without a password,
    SilenceError when the world is gone, LockstepError when a message is missing or of another slot.
    """
    with _opened(endpoint, shard, access) as session:
        stop = StopRequest()
        state = "is connected to" if shard else "listens at"
        print(f"{medium_name(shard)} {state} {endpoint}, for one run", flush=True)
        server = SetupServer(session, shard)
        usual = access.agents + OTHER_SOCKETS if access is not None else USUAL_BY_HAND
        limiter = ConnectionLimiter(usual)
        while server.run is None and not stop.requested:
            limiter.enforce()
            server.wait(WAIT_S)
        if server.run is not None and server.setup is not None:
            _serve_run(Bus(session, Keys(server.run)), server, limiter, stop, options)
    return 0


def _opened(endpoint: str, shard: int, access: AccessControl | None) -> zenoh.Session:
    if not shard:
        return open_router(endpoint, access)
    login = access.login(medium_name(shard)) if access is not None else None
    return open_client(endpoint, login=login)


def _serve_run(
    bus: Bus,
    server: SetupServer,
    limiter: ConnectionLimiter,
    stop: StopRequest,
    options: ServingOptions,
) -> None:
    name, setup = medium_name(server.shard), server.setup
    assert setup is not None  # as the server serves a run
    print(
        f"{name} serves run {server.run!r} of {setup.agents} agents, seed {setup.seed}", flush=True
    )
    truths, ending = bus.subscriber("truth", size=TRUTH_RING), RunEnd(bus.subscriber("over"), stop)
    medium = (
        LockstepMedium(bus, setup, server.shard, ending, options.check)
        if setup.lockstep
        else FreeRunningMedium(bus, setup, options.check)
    )
    bus.declare_alive(name)
    silence_s = inf if options.patient else SILENCE_S
    try:
        _play(medium, truths, server, limiter, ending, silence_s)
    except RunOverError:
        print(f"{name}: the run is over, within a slot", flush=True)
    else:
        medium.report()
        print(f"{name}: the run is over", flush=True)
    if limiter.closed:
        print(f"{name}: closed {limiter.closed} connections of processes with too many", flush=True)


def _play(
    medium: LockstepMedium | FreeRunningMedium,
    truths: Subscriber,
    server: SetupServer,
    limiter: ConnectionLimiter,
    ending: RunEnd,
    most_silence_s: float,
) -> None:
    """Play slots until the run is over, those that arrived before its end included."""
    silent_s = 0.0
    ended = False
    while not ended:
        server.answer_waiting()
        limiter.enforce()
        ended = ending()
        first = truths.wait(WAIT_S) if not ended else None
        medium.play(([first] if first is not None else []) + truths.drain(TRUTH_RING))
        silent_s = 0.0 if first is not None else silent_s + WAIT_S
        if silent_s > most_silence_s:
            raise SilenceError(
                f"no message from the world of run {server.run!r} for {most_silence_s:g} s"
            )
