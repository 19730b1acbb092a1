"""A whole agent: what is not to be believed is counted, and whatever it hears it flies on."""

import time
from math import dist, hypot, isfinite, pi
from random import Random

import msgspec
import pytest

from agent.codec import decode_command, encode, sealed, unsealed
from agent.config import AgentSetup, Comms, Control, Vehicle
from agent.core import Agent
from agent.messages import Beacon, Gossip, Observation
from agent.qstructure.formation import FormationSpec
from netem.wire.channels import LOCAL, MAX_PAYLOAD_B, MULTIHOP
from netem.wire.frame import Outgoing, Transmission, pack, unpack_transmission
from tests.agent.comms.making import FAR, GREATEST, ORIGIN, UNLED, beacon, greatest_record, record

TICK_S = 0.05
SPEED = Vehicle().max_speed_mps
WEDGE = msgspec.convert(
    {
        "name": "wedge",
        "vertices": {"V1": [0, 0, 0]},
        "queue": [
            {"name": f"Q{k}", "vertices": ["V1"], "shape": {"kind": "ray", "direction": way}}
            for k, way in enumerate([[-1, 1, 1], [-1, -1, 1], [-1, 1, -1], [-1, -1, -1]])
        ],
    },
    FormationSpec,
)


def agent(who=0, sensors=("proximity",), incarnation=0):
    return Agent(
        AgentSetup(
            id=who,
            incarnation=incarnation,
            tick_hz=1.0 / TICK_S,
            slots_per_tick=4,
            command_ticks=2,
            vehicle=Vehicle(sensors=sensors),
            fleet_max_speed_mps=0.5,
            control=Control(),
            comms=Comms(),
            formation=WEDGE,
        )
    )


def seen(tick, at=(2.0, 1.0, 0.5), vehicles=(), start_s=0.0):
    return Observation(
        4 * tick, start_s + tick * TICK_S, at, ORIGIN, 0.3, tuple(vehicles), (), (), ()
    )


def airworthy(outbox, tick):
    """Whether an outbox may leave: the command is decodable and within limits, the frames fit."""
    command = decode_command(encode(outbox.command))
    assert command == outbox.command
    assert (command.slot, command.expires_slot) == (4 * tick, 4 * tick + 8)
    assert all(map(isfinite, (*command.velocity, command.yaw, command.telemetry.force)))
    assert hypot(*command.velocity[:2]) <= SPEED + 1e-9
    assert abs(command.velocity[2]) <= SPEED + 1e-9
    assert 0.0 <= command.yaw < 2.0 * pi + 1e-9
    assert all(len(payload) <= MAX_PAYLOAD_B for _, payload in outbox.frames)
    outgoing = tuple(Outgoing(channel, payload) for channel, payload in outbox.frames)
    transmission = Transmission(4 * tick, GREATEST, outgoing)
    assert unpack_transmission(pack(transmission)) == transmission
    return command


def hear(core, message, now_s, source=None):
    channel = LOCAL if isinstance(message, Beacon) else MULTIHOP
    core.receive(message.id if source is None else source, channel, sealed(encode(message)), now_s)


def test_junk_is_counted_and_the_agent_flies_as_if_it_had_heard_nothing():
    random, bothered, alone = Random(1), agent(), agent()
    for tick in range(100):
        for _ in range(50):
            size = random.choice((3, 20, 80, 1201))
            junk = random.randbytes(size)
            whole = sealed(junk) if random.random() < 0.5 else junk
            bothered.receive(1, random.randrange(2), whole, tick * TICK_S)
        one = airworthy(bothered.step(seen(tick)), tick)
        other = airworthy(alone.step(seen(tick)), tick)
        assert (one.velocity, one.yaw) == (other.velocity, other.yaw)
        assert sum(dict(one.telemetry.rejected).values()) == 50 * (tick + 1)
    assert bothered.rejected.total() == 5000
    assert set(bothered.rejected) == {"garbage", "invalid", "oversize", "corrupt"}
    assert alone.rejected.total() == 0


def test_mutated_frames_never_bring_it_down():
    random, speaker, listener = Random(2), agent(1), agent()
    for tick in range(200):
        now_s = tick * TICK_S
        for channel, payload in speaker.step(seen(tick, (0.0, 0.0, 1.0))).frames:
            for _ in range(10):
                data = bytearray(unsealed(payload))
                for _ in range(random.randrange(1, 4)):
                    data[random.randrange(len(data))] = random.randrange(256)
                listener.receive(1, channel, sealed(bytes(data)), now_s)
        airworthy(listener.step(seen(tick)), tick)
    assert listener.rejected.total() > 500


CASES = {
    "spoofed": (beacon(2, 1, 1.0), 3),
    "spoofed by gossip": (Gossip(2, 1.0, (record(2, 1, 1.0),), None), 3),
    "spoofed own": (beacon(0, 1, 1.0), 0),
    "future": (beacon(2, 1, 1.2), 2),
    "old": (beacon(2, 1, 20.0), 2),
    "speed": (beacon(2, 1, 1.0, velocity=(1.5, -1.5, 0.5)), 2),
}


@pytest.mark.parametrize(("message", "source"), CASES.values(), ids=CASES)
def test_what_cannot_be_is_counted_by_its_cause(message, source, request):
    core = agent()
    now_s = 30.0 if "old" in request.node.callspec.id else 1.0
    hear(core, message, now_s, source)
    assert dict(core.rejected) == {request.node.callspec.id.split()[0]: 1}
    assert core.step(seen(20)).command.telemetry.heard == ()


def test_replays_are_counted_and_not_believed():
    core, told = agent(), [beacon(1, k, k * TICK_S, at=(k * 1.0, 0.0, 0.0)) for k in range(1, 11)]
    for each in told:
        hear(core, each, 10 * TICK_S)
    before = core.step(seen(10))
    for each in told:
        hear(core, each, 11 * TICK_S)
    assert dict(core.rejected) == {"replay": 10}
    after = core.step(seen(11))
    assert before.command.telemetry.heard == after.command.telemetry.heard == (1,)


@pytest.mark.parametrize("sensors", [("proximity",), ()], ids=["ranging", "blind"])
@pytest.mark.parametrize(
    "at", [(2.0, 1.0, 0.5), (2.0, 1.0, 0.5 + 1e-12), (1e6, 1e6, 1e6), (-1e6, 0.0, 0.0)]
)
def test_a_neighbour_may_say_it_is_anywhere(at, sensors):
    """Also just here, where the direction to it is undefined."""
    core = agent(sensors=sensors)
    for tick in range(60):
        now_s = tick * TICK_S
        claim = (2**15 - 1, 2**15 - 1, 2**31 - 1)
        odd = Beacon(1, 0, tick, now_s, at, (1.0,) * 3, at, *claim, 100.0, (), *UNLED)
        hear(core, odd, now_s)
        airworthy(core.step(seen(tick, vehicles=[ORIGIN] if sensors else ())), tick)
    assert core.rejected.total() == 0


@pytest.mark.parametrize("neighbours", [0, 1, 90, 300])
def test_however_many_are_heard_what_it_says_can_be_said(neighbours):
    random, core = Random(3), agent()
    for tick in range(8):
        now_s = tick * TICK_S
        for who in range(1, neighbours + 1):
            at = tuple(random.uniform(-30.0, 30.0) for _ in range(3))
            hear(core, beacon(who, 2**40 + tick, now_s, at=at), now_s)
        command = airworthy(core.step(seen(tick)), tick)
        assert len(command.telemetry.heard) == min(neighbours, 256)
    assert core.rejected.total() == 0


def test_however_much_is_passed_on_what_it_says_can_be_said():
    core = agent()
    for first in range(1, 3000, 8):
        records = (greatest_record(who) for who in range(first, first + 8))
        fresh = tuple(msgspec.structs.replace(each, stamp_s=0.0) for each in records)
        hear(core, Gossip(1, 0.0, fresh, None), 0.0, 1)
    outbox = core.step(seen(0, at=(FAR, FAR, FAR)))
    airworthy(outbox, 0)
    assert sum(channel == MULTIHOP for channel, _ in outbox.frames) > 50


def conversation(ticks=80, start_s=0.0, speak=agent):
    """Two agents that hear each other a tick later; return all that both say."""
    pair, positions = (speak(0), speak(1)), ((2.0, 1.0, 0.5), (-1.0, 0.5, 0.0))
    said, frames = [], ((), ())
    for tick in range(ticks):
        now_s = start_s + tick * TICK_S
        for me, core in enumerate(pair):
            for channel, payload in frames[1 - me]:
                core.receive(1 - me, channel, payload, now_s)
        outboxes = [
            core.step(seen(tick, at, start_s=start_s))
            for core, at in zip(pair, positions, strict=True)
        ]
        frames = tuple(outbox.frames for outbox in outboxes)
        said.append([(outbox.command, outbox.frames) for outbox in outboxes])
    assert pair[0].rejected.total() == pair[1].rejected.total() == 0
    return said


def encoded(said):
    return [[(encode(command), frames) for command, frames in each] for each in said]


def test_equal_inputs_give_equal_bytes():
    assert encoded(conversation()) == encoded(conversation())


def test_no_clock_is_read(monkeypatch):
    for clock in ("time", "time_ns", "monotonic", "monotonic_ns", "perf_counter", "process_time"):
        with monkeypatch.context() as patch:
            patch.setattr(time, clock, lambda: pytest.fail("a clock was read"))
            conversation(ticks=4)


def test_only_differences_of_time_matter():
    for early, late in zip(conversation(), conversation(start_s=4096.0), strict=True):
        for (one, _), (other, _) in zip(early, late, strict=True):
            assert dist(one.velocity, other.velocity) < 1e-6
            assert one.telemetry.place == other.telemetry.place
            assert one.telemetry.heard == other.telemetry.heard


def test_two_that_hear_each_other_share_out_the_places():
    commands = [command for command, _ in conversation()[-1]]
    assert [command.telemetry.heard for command in commands] == [(1,), (0,)]
    assert len({command.telemetry.place for command in commands}) == 2


def test_who_falls_silent_is_forgotten_and_its_place_is_free():
    core = agent()
    for tick in range(40):
        hear(core, beacon(1, tick, tick * TICK_S, at=(0.5, -0.5, -0.5)), tick * TICK_S)
        held = core.step(seen(tick)).command.telemetry
    assert held.heard == (1,)
    assert held.place != (0, 0)
    for tick in range(40, 40 + 60):
        alone = core.step(seen(tick)).command.telemetry
    assert alone.heard == ()
    assert alone.place == (0, 0)


def test_after_a_pause_it_goes_on_with_what_is_true_now():
    """A process that was stopped for a minute knows nobody, and says so."""
    core = agent()
    hear(core, beacon(1, 1, 0.0), 0.0)
    core.step(seen(0))
    outbox = core.step(seen(1200))
    airworthy(outbox, 1200)
    assert outbox.command.telemetry.heard == ()


def test_a_restart_is_believed_at_once():
    listener, old, new = agent(0), agent(1), agent(1, incarnation=1)
    for tick in range(30):
        for channel, payload in old.step(seen(tick)).frames:
            listener.receive(1, channel, payload, tick * TICK_S)
        listener.step(seen(tick))
    for channel, payload in new.step(seen(31, at=(9.0, 9.0, 9.0))).frames:
        listener.receive(1, channel, payload, 31 * TICK_S)
    assert listener.rejected.total() == 0
    for channel, payload in old.step(seen(32)).frames:
        listener.receive(1, channel, payload, 32 * TICK_S)
    assert listener.rejected["replay"] == 1
