"""The lockstep shell: one inbox in, one command and one transmission out."""

from collections import defaultdict
from pathlib import Path

import pytest

from agent.codec import decode_command, encode
from agent.lockstep import LockstepAgent
from agent.messages import Observation
from netem.wire.barrier import LockstepError
from netem.wire.frame import Batch, Frame, Inbox, pack, unpack_transmission
from worldsim.scenario.file import load

WEDGE = Path("deploy/scenarios/wedge-9.toml")
STILL = (0.0, 0.0, 0.0)
JUNK = Frame(source=1, incarnation=0, channel=0, count=5, payload=b"junk")


class FakeBus:
    """Holds what an agent publishes by topic."""

    def __init__(self):
        self.published = defaultdict(list)

    def subscriber(self, _topic, _agent, _size):
        return []

    def publisher(self, topic, _agent, *, lockstep):
        assert lockstep
        return self.published[topic].append


@pytest.fixture
def bus():
    return FakeBus()


@pytest.fixture
def shell(bus):
    return LockstepAgent(bus, load(WEDGE, {}).agent_setup(0, 2, 1))


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


def inbox(slot, *batches, holds=None):
    return pack(Inbox(slot, observation(slot) if holds is None else holds, batches))


def test_an_inbox_gives_one_command_and_one_transmission(shell, bus):
    for slot in (0, 4):
        shell.observe(inbox(slot))
    commands = [decode_command(data) for data in bus.published["command"]]
    sent = [unpack_transmission(data) for data in bus.published["tx"]]
    assert [(each.slot, each.incarnation) for each in commands] == [(0, 2), (4, 2)]
    assert [(each.slot, each.incarnation) for each in sent] == [(0, 2), (4, 2)]


def test_all_batches_of_an_inbox_are_taken(shell, bus):
    shell.observe(inbox(8, pack(Batch(4, (JUNK,))), pack(Batch(8, (JUNK, JUNK)))))
    (command,) = map(decode_command, bus.published["command"])
    assert sum(count for _, count in command.telemetry.rejected) == 3


@pytest.mark.parametrize(
    ("data", "error"),
    [
        (b"junk", "an inbox: malformed"),
        (inbox(4, holds=b"junk"), "the inbox of slot 4: its observation cannot be decoded"),
        (inbox(4, b"junk"), "the inbox of slot 4: malformed"),
        (inbox(4, holds=observation(8)), "the inbox of slot 4 is of slot 8; expected slot 4"),
    ],
    ids=("inbox", "observation", "batch", "slot"),
)
def test_what_does_not_fit_ends_the_run_without_a_command(shell, bus, data, error):
    with pytest.raises(LockstepError, match=error):
        shell.observe(data)
    assert not bus.published["command"]
