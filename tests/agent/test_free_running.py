"""An agent's process between two rings: what it takes when, and what it tells of that."""

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
JUNK = Frame(1, 0, 0, 5, b"junk")


class Waiting(list):
    def drain(self, quota):
        taken, self[:quota] = self[:quota], []
        return taken


class FakePost:
    """What an agent hears, and what it says, by topic."""

    def __init__(self):
        self.heard = Waiting()
        self.said = defaultdict(list)

    def subscriber(self, _topic, _who, _size):
        return self.heard

    def publisher(self, topic, _who):
        return self.said[topic].append


@pytest.fixture
def bus():
    return FakePost()


@pytest.fixture
def shell(bus):
    return FreeRunningAgent(bus, load(WEDGE, {}).agent_setup(0, 2, 2))


def seen(slot):
    return encode(Observation(slot, slot / 80.0, STILL, STILL, 0.0, (), (), (), ()))


def told(shell, bus):
    shell.report()
    return unpack_report(bus.said["arrivals"][-1])


def test_frames_are_counted_from_when_they_were_due_to_when_they_are_used(shell, bus):
    bus.heard.append(pack(Delivery(4, (JUNK, JUNK), (0, 25_000))))
    shell.see(seen(8))
    counts = told(shell, bus).counts[0]
    assert [at for at, count in enumerate(counts) if count] == [
        4 * BINS_PER_SLOT,
        6 * BINS_PER_SLOT,
    ]
    assert told(shell, bus).incarnation == 2


def test_what_is_of_a_later_slot_waits_for_its_observation(shell, bus):
    bus.heard += [pack(Delivery(slot, (JUNK,), (0,))) for slot in (4, 8)]
    shell.see(seen(4))
    assert sum(told(shell, bus).counts[0]) == 1
    shell.see(seen(8))
    counts = told(shell, bus).counts[0]
    assert counts[0] == sum(counts) == 2


def test_it_tells_about_once_a_second(shell, bus):
    for tick in range(201):
        shell.see(seen(4 * tick))
    assert len(bus.said["command"]) == len(bus.said["tx"]) == 201
    assert len(bus.said["arrivals"]) == 10


def test_what_is_no_delivery_is_counted_and_hurts_nothing(shell, bus):
    bus.heard += [b"junk", pack(Batch(4, (JUNK,))), pack(Delivery(4, (JUNK,), ()))]
    shell.see(seen(4))
    shell.see(b"junk")
    assert shell._controls.core.rejected == {"batch": 3, "observation": 1}
    assert len(bus.said["command"]) == 1
