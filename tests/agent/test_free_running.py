"""The free-running shell: which frames it uses when, and what it reports about that."""

from collections import defaultdict
from pathlib import Path

import pytest

from agent.codec import encode
from agent.free_running import FreeRunningAgent
from agent.messages import Observation
from netem.wire.frame import Batch, Delivery, Frame, pack
from netem.wire.latency import BINS_PER_SLOT, unpack_report
from worldsim.scenario.file import load

WEDGE = Path("deploy/scenarios/wedge-9.toml")
STILL = (0.0, 0.0, 0.0)
JUNK = Frame(source=1, incarnation=0, channel=0, count=5, payload=b"junk")


class FakeSubscriber(list):
    def drain(self, quota):
        taken, self[:quota] = self[:quota], []
        return taken


class FakeBus:
    """Holds what an agent receives, and what it publishes by topic."""

    def __init__(self):
        self.received = FakeSubscriber()
        self.published = defaultdict(list)

    def subscriber(self, topic, _agent, _size=1):
        return self.received if topic == "rx" else FakeSubscriber()

    def publisher(self, topic, _agent):
        return self.published[topic].append


@pytest.fixture
def bus():
    return FakeBus()


@pytest.fixture
def shell(bus):
    return FreeRunningAgent(bus, load(WEDGE, {}).agent_setup(0, 2, 2))


def observation(slot):
    return encode(
        Observation(
            slot=slot,
            time_s=slot / 80.0,
            position=STILL,
            velocity=STILL,
            yaw=0.0,
            vehicles=(),
            obstacles=(),
            orders=(),
            scans=(),
        )
    )


def last_report(shell, bus):
    shell.report()
    return unpack_report(bus.published["arrivals"][-1])


def test_a_frames_delay_is_counted_from_its_due_time_to_its_use(shell, bus):
    bus.received.append(pack(Delivery(4, (JUNK, JUNK), (0, 25_000))))
    shell.observe(observation(8))
    counts = last_report(shell, bus).counts[0]
    assert [at for at, count in enumerate(counts) if count] == [
        4 * BINS_PER_SLOT,
        6 * BINS_PER_SLOT,
    ]
    assert last_report(shell, bus).incarnation == 2


def test_a_batch_of_a_later_slot_waits_for_its_observation(shell, bus):
    bus.received += [pack(Delivery(slot, (JUNK,), (0,))) for slot in (4, 8)]
    shell.observe(observation(4))
    assert sum(last_report(shell, bus).counts[0]) == 1
    shell.observe(observation(8))
    counts = last_report(shell, bus).counts[0]
    assert counts[0] == sum(counts) == 2


def test_it_reports_about_once_a_second(shell, bus):
    for tick in range(201):
        shell.observe(observation(4 * tick))
    assert len(bus.published["command"]) == len(bus.published["tx"]) == 201
    assert len(bus.published["arrivals"]) == 10


def test_an_invalid_message_is_counted_and_changes_nothing(shell, bus):
    bus.received += [b"junk", pack(Batch(4, (JUNK,))), pack(Delivery(4, (JUNK,), ()))]
    shell.observe(observation(4))
    shell.observe(b"junk")
    assert shell._stepper.core.rejected == {"batch": 3, "observation": 1}
    assert len(bus.published["command"]) == 1
