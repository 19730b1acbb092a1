"""One agent among honest, late and hostile frames, clock jumps and restarts, in any order.

Whatever it hears, it raises nothing and commands within its limits; its own beacons never repeat a
number; what is not its sender's, torn or from another time counts as rejected, and changes nothing
of whom it hears.
"""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from agent.codec import add_checksum, decode_beacon, encode
from agent.messages import Beacon, Gossip
from netem.wire.channels import LOCAL, MULTIHOP, Channel
from tests.agent.comms.builders import FAR, GREATEST, beacon, gossip, record
from tests.agent.test_core import TICK_S, agent, checked_command, observation

OTHERS = (1, 2, 3)
GONE_S = 10.0
"""Nobody counts as heard so long after its last frame."""
others = st.sampled_from(OTHERS)
picks = st.integers(0, 60)
metres = st.sampled_from([0.0, 0.3, -2.0, FAR])


class OneAgent(RuleBasedStateMachine):
    """An agent, and the frames that are on the air."""

    def __init__(self) -> None:
        super().__init__()
        self.tick, self.start_s, self.incarnation = 0, 200.0, 0
        self.core = agent()
        self.rejected = 0
        self.numbers = dict.fromkeys(OTHERS, 0)
        self.frames: list[tuple[int, Channel, bytes, float]] = []
        """Sender, channel, payload, and the stamp in it."""
        self.heard_s: dict[int, float] = {}
        """When something that may count was last heard of each other agent, in its own time."""
        self.last_own = (-1, -1)
        self.step(1)

    @property
    def now_s(self) -> float:
        return self.start_s + self.tick * TICK_S

    def put(self, message: Beacon | Gossip) -> None:
        channel = LOCAL if isinstance(message, Beacon) else MULTIHOP
        payload = add_checksum(encode(message))
        self.frames.append((message.id, channel, payload, message.stamp_s))
        self.hear(*self.frames[-1])

    def hear(self, sender: int, channel: Channel, payload: bytes, stamp_s: float) -> None:
        self.core.receive(sender, channel, payload, self.now_s)
        if channel == LOCAL and abs(self.now_s - stamp_s) <= GONE_S:
            self.heard_s[sender] = self.now_s

    @rule(sender=others, x=metres, y=metres, queue=st.integers(-1, 5), rank=st.integers(-1, 9))
    def hear_a_beacon(self, sender: int, x: float, y: float, queue: int, rank: int) -> None:
        self.numbers[sender] += 1
        at = (float(sender) + x, 1.0 + y, 0.0)
        self.put(beacon(sender, self.numbers[sender], self.now_s, at=at, queue=queue, rank=rank))

    @rule(
        sender=others,
        incarnation=st.sampled_from([0, 1, GREATEST]),
        ahead_s=st.sampled_from([-9.0, -3.0, 0.0, 9.0]),
    )
    def hear_gossip(self, sender: int, incarnation: int, ahead_s: float) -> None:
        told = [record(each, 5, self.now_s, incarnation=incarnation, queue=0) for each in range(5)]
        self.put(gossip(sender, self.now_s + ahead_s, told))

    @rule(
        sender=others, sequence=st.sampled_from([0, GREATEST]), ahead_s=st.sampled_from([-9.0, 9.0])
    )
    def hear_of_another_time(self, sender: int, sequence: int, ahead_s: float) -> None:
        before = self.core.rejected.total()
        lie = beacon(sender, sequence, self.now_s + ahead_s)
        self.core.receive(sender, LOCAL, add_checksum(encode(lie)), self.now_s)
        assert self.core.rejected.total() == before + 1

    @precondition(lambda self: self.frames)
    @rule(number=picks)
    def hear_again(self, number: int) -> None:
        """Doubled, late, or after others that were sent later."""
        self.hear(*self.frames[number % len(self.frames)])

    @precondition(lambda self: self.frames)
    @rule(number=picks)
    def hear_it_from_another(self, number: int) -> None:
        sender, channel, payload, _ = self.frames[number % len(self.frames)]
        before = self.core.rejected["spoofed"]
        self.core.receive(sender + 1, channel, payload, self.now_s)
        assert self.core.rejected["spoofed"] == before + 1

    @precondition(lambda self: self.frames)
    @rule(number=picks, at=picks, bit=st.integers(0, 7))
    def hear_it_torn(self, number: int, at: int, bit: int) -> None:
        sender, channel, payload, _ = self.frames[number % len(self.frames)]
        torn = bytearray(payload)
        torn[at % len(torn)] ^= 1 << bit
        before = self.core.rejected.total()
        self.core.receive(sender, channel, bytes(torn), self.now_s)
        assert self.core.rejected.total() == before + 1

    @rule(ticks=st.sampled_from([1, 2, 20, 120]))
    def step(self, ticks: int) -> None:
        for _ in range(ticks):
            self.tick += 1
            outbox = self.core.step(observation(self.tick, start_s=self.start_s))
            self.command = checked_command(outbox, self.tick)
            for channel, payload in outbox.frames:
                if channel == LOCAL:
                    own = decode_beacon(payload)
                    assert (own.id, own.stamp_s) == (0, self.now_s)
                    assert (own.incarnation, own.sequence) > self.last_own
                    self.last_own = own.incarnation, own.sequence

    @rule(by_s=st.sampled_from([-30.0, -1.0, 1.0, 30.0]))
    def jump(self, by_s: float) -> None:
        self.start_s += by_s
        self.heard_s.clear()
        self.step(1)
        assert self.command.telemetry.heard == ()

    @rule()
    def restart(self) -> None:
        self.incarnation += 1
        self.core = agent(incarnation=self.incarnation)
        self.heard_s.clear()
        self.rejected = 0
        self.step(1)

    @invariant()
    def only_who_was_heard_lately_counts_as_heard(self) -> None:
        late = {each for each, at_s in self.heard_s.items() if self.now_s - at_s > GONE_S}
        assert set(self.command.telemetry.heard) <= self.heard_s.keys() - late

    @invariant()
    def what_is_rejected_stays_counted(self) -> None:
        assert self.core.rejected.total() >= self.rejected
        self.rejected = self.core.rejected.total()


TestOneAgent = OneAgent.TestCase
TestOneAgent.settings = settings(
    derandomize=True, deadline=None, max_examples=25, stateful_step_count=30
)
