"""The medium as a process: this host's Zenoh router, and the radio between the agents of one run.

The world conducts. Several of them may share the agents out by receiver; then one is the router,
and the others are its clients.
"""

import sys

import msgspec
import zenoh
from zenoh.handlers import RingChannel

from netem.free_running import FreeRunningMedium
from netem.lockstep import LockstepMedium
from netem.messages import MAX_CONDITIONS_B, MediumSetup
from netem.wire.access import AccessControl, AccessError
from netem.wire.barrier import LockstepError, RunOverError
from netem.wire.bus import Bus, Handler, Subscriber, drain, receive
from netem.wire.keys import Keys, medium_name
from netem.wire.session import SessionError, open_client, open_router
from netem.wire.shutdown import RunEnd, StopRequest

WAIT_S = 0.2
SILENCE_S = 30.0
TRUTH_RING = 16


class SilenceError(RuntimeError):
    """The world has said nothing for so long that it must be gone."""


class SetupServer:
    """Gives the medium to the run that asks first, and refuses every other.

    shard: which of several mediums it is; 0 is the router's own.
    """

    def __init__(self, session: zenoh.Session, shard: int = 0) -> None:
        self.shard = shard
        self.run: str | None = None
        self.setup: MediumSetup | None = None
        key = Keys.any_run("shard", shard) if shard else Keys.any_run("medium")
        self._questions: Handler[zenoh.Query] = session.declare_queryable(key, RingChannel(16))

    def wait(self, timeout_s: float) -> None:
        """Answer the next question that comes within ``timeout_s`` [s]."""
        query = receive(self._questions, timeout_s)
        if query is not None:
            self._answer(query)

    def attend(self) -> None:
        """Answer the questions that are there."""
        for query in drain(self._questions, 16):
            self._answer(query)

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            reason = self._refusal(query)
            if reason is None:
                query.reply(query.key_expr, b"")
            else:
                query.reply_err(reason)

    def _refusal(self, query: zenoh.Query) -> str | None:
        run = Keys.run_of(str(query.key_expr))
        if self.run not in (None, run):
            return f"this medium serves run {self.run!r} already; a second run needs its own netem"
        payload = query.payload.to_bytes() if query.payload is not None else b""
        if len(payload) > MAX_CONDITIONS_B:
            return f"{len(payload)} B of conditions where {MAX_CONDITIONS_B} B are allowed"
        try:
            setup = msgspec.json.decode(payload, type=MediumSetup)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            return f"conditions: {error}"
        if self.run is None:
            self.run, self.setup = run, setup
        return None


def run(
    endpoint: str, shard: int = 0, patient: bool = False, guard: AccessControl | None = None
) -> int:
    """Serve at an endpoint, and say in one line what stood in its way; return the exit status."""
    try:
        return serve(endpoint, shard, patient, guard)
    except (AccessError, SessionError, SilenceError, LockstepError) as error:
        print(f"{medium_name(shard)}: {error}", file=sys.stderr)
        return 2 if isinstance(error, AccessError | SessionError) else 1


def serve(
    endpoint: str, shard: int = 0, patient: bool = False, guard: AccessControl | None = None
) -> int:
    """Be the medium of the first run that asks; return 0 at its end.

    Shard 0 is the router at the endpoint, too; the others connect to it. patient: whether who is
    silent for long is still there. guard: who may do what. Raises SessionError when it cannot
    listen or connect there, AccessError when it has no password, SilenceError when the world is
    gone, LockstepError when somebody speaks out of turn.
    """
    with _opened(endpoint, shard, patient, guard) as session:
        stop = StopRequest()
        at = "is connected to" if shard else "listens at"
        print(f"{medium_name(shard)} {at} {endpoint}, for one run", flush=True)
        server = SetupServer(session, shard)
        while server.run is None and not stop.requested:
            server.wait(WAIT_S)
        if server.run is not None and server.setup is not None:
            _serve_run(Bus(session, Keys(server.run)), server, server.setup, stop)
    return 0


def _opened(endpoint: str, shard: int, patient: bool, guard: AccessControl | None) -> zenoh.Session:
    if not shard:
        return open_router(endpoint, patient, guard)
    login = guard.login(medium_name(shard)) if guard is not None else None
    return open_client(endpoint, long_lease=patient, login=login)


def _serve_run(bus: Bus, server: SetupServer, setup: MediumSetup, stop: StopRequest) -> None:
    name = medium_name(server.shard)
    print(
        f"{name} serves run {server.run!r} of {setup.agents} agents, seed {setup.seed}", flush=True
    )
    truths, ending = bus.subscriber("truth", size=TRUTH_RING), RunEnd(bus.subscriber("over"), stop)
    radio = (
        LockstepMedium(bus, setup, server.shard, ending)
        if setup.lockstep
        else FreeRunningMedium(bus, setup)
    )
    bus.declare_alive(name)
    try:
        _play(radio, truths, server, ending)
    except RunOverError:
        print(f"{name}: the run is over, within a slot", flush=True)
    else:
        radio.report()
        print(f"{name}: the run is over", flush=True)


def _play(
    radio: LockstepMedium | FreeRunningMedium,
    truths: Subscriber,
    server: SetupServer,
    ending: RunEnd,
) -> None:
    """Play slots until the run is over; what came before its end is played still."""
    silent_s = 0.0
    ended = False
    while not ended:
        server.attend()
        ended = ending()
        first = truths.wait(WAIT_S) if not ended else None
        radio.hear(([first] if first is not None else []) + truths.drain(TRUTH_RING))
        silent_s = 0.0 if first is not None else silent_s + WAIT_S
        if silent_s > SILENCE_S:
            raise SilenceError(
                f"the world of run {server.run!r} has been silent for {SILENCE_S:g} s"
            )
