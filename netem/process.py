"""The medium as a process: this host's Zenoh router, and the radio between the agents of one run.

The world conducts. Each slot's truth makes the medium take in what was sent so far and hand out
the batches of the next slot, so a frame never arrives in the slot in which it was sent.
"""

import sys
import time
from collections import Counter, deque
from statistics import median

import msgspec
import zenoh
from zenoh.handlers import RingChannel

from netem.medium import Medium
from netem.messages import MAX_CONDITIONS_B, MAX_TRUTH_B, MediumSetup, Truth, Verdicts
from netem.orders import OrderBook
from netem.wire.frame import Batch, Transmission, WireError, pack, unpack, unpack_transmission
from netem.wire.keys import Keys
from netem.wire.post import Post, Waiting, drained, receive
from netem.wire.session import SessionError, open_router
from netem.wire.stop import Stop

WAIT_S = 0.2
SILENCE_S = 30.0
TRUTH_RING = 16
ORDERS_RING = 256
SENDER_RING = 4
SENDER_QUOTA = 2
"""How many of one sender's messages are taken a slot: a flooder evicts only its own."""
LATENESS_KEPT = 4096


class SilenceError(RuntimeError):
    """The world has said nothing for so long that it must be gone."""


class Desk:
    """Gives the medium to the run that asks first, and refuses every other."""

    def __init__(self, session: zenoh.Session) -> None:
        self.run: str | None = None
        self.setup: MediumSetup | None = None
        self._questions: Waiting[zenoh.Query] = session.declare_queryable(
            Keys.any_run("medium"), RingChannel(16)
        )

    def wait(self, timeout_s: float) -> None:
        """Answer the next question that comes within ``timeout_s`` [s]."""
        query = receive(self._questions, timeout_s)
        if query is not None:
            self._answer(query)

    def attend(self) -> None:
        """Answer the questions that are there."""
        for query in drained(self._questions, 16):
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
        except msgspec.DecodeError as error:
            return f"conditions: {error}"
        if self.run is None:
            self.run, self.setup = run, setup
        return None


class Lateness:
    """How much later than due batches left [simulated s]: the median of the last ones, the worst.

    The present simulated time is that of the newest truth, and what has passed since it was read.
    """

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._kept: deque[float] = deque(maxlen=LATENESS_KEPT)
        self._worst_s = 0.0

    def note(self, due_s: float, newest_s: float, read_at: float) -> None:
        """Note a batch due at ``due_s``, leaving now; the newest truth is of ``newest_s``."""
        now_s = newest_s + (time.monotonic() - read_at) * self._speed
        late_s = max(0.0, now_s - due_s)
        self._kept.append(late_s)
        self._worst_s = max(self._worst_s, late_s)

    def summary(self) -> tuple[float, float] | None:
        """Return median and worst [s], or None before the first batch."""
        return (median(self._kept), self._worst_s) if self._kept else None


class Intake:
    """Decides which of the senders' messages the medium takes, and counts the others by cause."""

    def __init__(self, setup: MediumSetup) -> None:
        self.rejected: Counter[str] = Counter()
        self._slots_per_tick = setup.slots_per_tick
        self._last: list[tuple[int, int]] = [(-1, -1)] * setup.agents

    def take(self, sender: int, data: bytes, slot: int) -> Transmission | None:
        """Return a sender's message as it arrived by ``slot``, or None where it is refused.

        A process that was stopped for a while answers old observations when it goes on; a copy of
        an earlier message may come at any time. Neither reaches the air.
        """
        try:
            transmission = unpack_transmission(data)
        except WireError as error:
            self.rejected[str(error).split(" ", 1)[0].rstrip(":")] += 1
            return None
        cause = self._cause(sender, transmission, slot)
        if cause is not None:
            self.rejected[cause] += 1
            return None
        self._last[sender] = (transmission.incarnation, transmission.slot)
        return transmission

    def _cause(self, sender: int, transmission: Transmission, slot: int) -> str | None:
        if transmission.slot > slot:
            return "ahead"
        if transmission.slot < slot - self._slots_per_tick:
            return "stale"
        if (transmission.incarnation, transmission.slot) <= self._last[sender]:
            return "repeated"
        return None


class Radio:
    """The medium between the agents of one run, slot by slot."""

    def __init__(self, post: Post, setup: MediumSetup) -> None:
        self._setup = setup
        self._medium = Medium(setup)
        self._intake = Intake(setup)
        self._lateness = Lateness(setup.speed)
        agents = range(setup.agents)
        self._senders = [post.ring("tx", agent, SENDER_RING) for agent in agents]
        self._receivers = [post.putter("rx", agent) for agent in agents]
        self._orders = post.ring("orders", size=ORDERS_RING)
        self._book = OrderBook()
        self._report = post.putter("verdicts")
        self._report_every = max(1, round(setup.slot_hz))
        self._slot = 0

    def hear(self, truths: list[bytes]) -> None:
        """Play the slots whose truths have come, oldest first."""
        read_at = time.monotonic()
        known = [truth for truth in map(self._truth, truths) if truth is not None]
        for truth in known:
            self._play(truth, known[-1].time_s, read_at)

    def report(self) -> None:
        """Tell the world the counters as they stand after the last slot played."""
        verdicts: Verdicts = msgspec.structs.replace(
            self._medium.verdicts(self._slot),
            rejected=dict(self._intake.rejected),
            late_s=self._lateness.summary(),
        )
        self._report(pack(verdicts))

    def _truth(self, data: bytes) -> Truth | None:
        try:
            truth = unpack(data, Truth, MAX_TRUTH_B)
        except WireError:
            self._intake.rejected["truth"] += 1
            return None
        if len(truth.positions) != self._setup.agents or truth.slot < self._slot:
            self._intake.rejected["truth"] += 1
            return None
        return truth

    def _play(self, truth: Truth, newest_s: float, read_at: float) -> None:
        self._obey(truth.slot)
        self._medium.place(truth.positions)
        self._ingest(truth.slot)
        self._deliver(truth.slot + 1, newest_s, read_at)
        self._slot = truth.slot + 1
        if self._slot % self._report_every == 0:
            self.report()

    def _obey(self, slot: int) -> None:
        """Carry out what was ordered for slots up to this one."""
        for data in self._orders.drain(ORDERS_RING):
            try:
                self._book.take(data)
            except WireError:
                self._intake.rejected["orders"] += 1
        for order in self._book.due(slot):
            self._medium.obey(order)

    def _ingest(self, slot: int) -> None:
        for sender, ring in enumerate(self._senders):
            for data in ring.drain(SENDER_QUOTA):
                transmission = self._intake.take(sender, data, slot)
                if transmission is not None:
                    sent_s = transmission.slot / self._setup.slot_hz
                    self._medium.transmit(sender, sent_s, transmission)

    def _deliver(self, slot: int, newest_s: float, read_at: float) -> None:
        due_s = slot / self._setup.slot_hz
        group = slot % self._setup.slots_per_tick
        for receiver in range(group, self._setup.agents, self._setup.slots_per_tick):
            frames = self._medium.collect(receiver, due_s)
            self._receivers[receiver](pack(Batch(slot, frames)))
        self._lateness.note(due_s, newest_s, read_at)


def run(listen: str) -> int:
    """Serve at an endpoint, and say in one line what stood in its way; return the exit status."""
    try:
        return serve(listen)
    except (SessionError, SilenceError) as error:
        print(f"netem: {error}", file=sys.stderr)
        return 2 if isinstance(error, SessionError) else 1


def serve(listen: str) -> int:
    """Be the router at an endpoint and the medium of the first run that asks; return 0 at its end.

    Raises SessionError when it cannot listen there, SilenceError when the world is gone.
    """
    with open_router(listen) as session:
        stop = Stop()
        print(f"netem listens at {listen}, for one run", flush=True)
        desk = Desk(session)
        while desk.run is None and not stop.asked:
            desk.wait(WAIT_S)
        if desk.run is not None and desk.setup is not None:
            _serve_run(Post(session, Keys(desk.run)), desk, desk.setup, stop)
    return 0


def _serve_run(post: Post, desk: Desk, setup: MediumSetup, stop: Stop) -> None:
    print(f"netem serves run {desk.run!r} of {setup.agents} agents, seed {setup.seed}", flush=True)
    truths, over = post.ring("truth", size=TRUTH_RING), post.ring("over")
    radio = Radio(post, setup)
    post.show_life("netem")
    silent_s = 0.0
    while not stop.asked:
        desk.attend()
        ended = bool(over.drain(1))
        first = truths.wait(WAIT_S) if not ended else None
        heard = [first] if first is not None else []
        radio.hear(heard + truths.drain(TRUTH_RING))
        if ended:
            radio.report()
            print("netem: the run is over", flush=True)
            break
        silent_s = 0.0 if first is not None else silent_s + WAIT_S
        if silent_s > SILENCE_S:
            raise SilenceError(f"the world of run {desk.run!r} has been silent for {SILENCE_S:g} s")
