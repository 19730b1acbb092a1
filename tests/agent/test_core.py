"""The whole core: implausible messages are counted, and no message stops the agent."""

import time
from math import dist, hypot, isfinite, pi
from random import Random

import msgspec
import pytest

from agent.codec import add_checksum, decode_command, encode, encode_formation, strip_checksum
from agent.config import AgentSetup, Comms, Control, Vehicle
from agent.controller import Intent, Senses, Words
from agent.core import Agent
from agent.messages import AT_HOME, Beacon, Mission, Observation, Place
from agent.qstructure.formation import FormationSpec, formation_of
from netem.wire.channels import LOCAL, MAX_PAYLOAD_B, MULTIHOP
from netem.wire.frame import Outgoing, Transmission, pack, unpack_transmission
from tests.agent.comms.builders import (
    FAR,
    GREATEST,
    ORIGIN,
    beacon,
    gossip,
    greatest_record,
    record,
)

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


AGENT_SETUP = AgentSetup(
    id=0,
    incarnation=0,
    tick_hz=1.0 / TICK_S,
    slots_per_tick=4,
    command_ticks=2,
    vehicle=Vehicle(sensors=("proximity",)),
    fleet_max_speed_mps=0.5,
    control=Control(),
    comms=Comms(),
    formation=WEDGE,
)


def agent(agent_id=0, sensors=("proximity",), incarnation=0, allocation="structure"):
    setup = msgspec.structs.replace(
        AGENT_SETUP,
        id=agent_id,
        incarnation=incarnation,
        vehicle=Vehicle(sensors=sensors),
        control=Control(allocation=allocation),
    )
    return Agent(setup)


def observation(tick, at=(2.0, 1.0, 0.5), vehicles=(), start_s=0.0):
    return Observation(
        slot=4 * tick,
        time_s=start_s + tick * TICK_S,
        position=at,
        velocity=ORIGIN,
        yaw=0.3,
        vehicles=tuple(vehicles),
        obstacles=(),
        orders=(),
        scans=(),
    )


def checked_command(outbox, tick):
    """Return the command of an outbox; assert that it is within limits and that the frames fit."""
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


def deliver(core, message, now_s, source=None):
    channel = LOCAL if isinstance(message, Beacon) else MULTIHOP
    source = message.id if source is None else source
    core.receive(source, channel, add_checksum(encode(message)), now_s)


def test_junk_is_counted_and_changes_no_command():
    random, jammed, alone = Random(1), agent(), agent()
    for tick in range(100):
        for _ in range(50):
            size = random.choice((3, 20, 80, 1201))
            junk = random.randbytes(size)
            whole = add_checksum(junk) if random.random() < 0.5 else junk
            jammed.receive(1, random.randrange(2), whole, tick * TICK_S)
        one = checked_command(jammed.step(observation(tick)), tick)
        other = checked_command(alone.step(observation(tick)), tick)
        assert (one.velocity, one.yaw) == (other.velocity, other.yaw)
        assert sum(dict(one.telemetry.rejected).values()) == 50 * (tick + 1)
    assert jammed.rejected.total() == 5000
    assert set(jammed.rejected) == {"garbage", "invalid", "oversize", "corrupt"}
    assert alone.rejected.total() == 0


def test_mutated_frames_never_stop_the_agent():
    random, speaker, listener = Random(2), agent(1), agent()
    for tick in range(200):
        now_s = tick * TICK_S
        for channel, payload in speaker.step(observation(tick, (0.0, 0.0, 1.0))).frames:
            for _ in range(10):
                data = bytearray(strip_checksum(payload))
                for _ in range(random.randrange(1, 4)):
                    data[random.randrange(len(data))] = random.randrange(256)
                listener.receive(1, channel, add_checksum(bytes(data)), now_s)
        checked_command(listener.step(observation(tick)), tick)
    assert listener.rejected.total() > 500


CASES = {
    "spoofed": (beacon(2, 1, 1.0), 3),
    "spoofed by gossip": (gossip(2, 1.0, [record(2, 1, 1.0)]), 3),
    "spoofed own": (beacon(0, 1, 1.0), 0),
    "future": (beacon(2, 1, 1.2), 2),
    "future by gossip": (gossip(2, 1.2), 2),
    "old": (beacon(2, 1, 20.0), 2),
    "speed": (beacon(2, 1, 1.0, velocity=(1.5, -1.5, 0.5)), 2),
}


@pytest.mark.parametrize(("message", "source"), CASES.values(), ids=CASES)
def test_an_implausible_message_is_counted_by_its_cause(message, source, request):
    core = agent()
    now_s = 30.0 if "old" in request.node.callspec.id else 1.0
    deliver(core, message, now_s, source)
    assert dict(core.rejected) == {request.node.callspec.id.split()[0]: 1}
    assert core.step(observation(20)).command.telemetry.heard == ()


def test_replays_are_counted_and_ignored():
    core, beacons = (
        agent(),
        [beacon(1, k, k * TICK_S, at=(k * 1.0, 0.0, 0.0)) for k in range(1, 11)],
    )
    for each in beacons:
        deliver(core, each, 10 * TICK_S)
    before = core.step(observation(10))
    for each in beacons:
        deliver(core, each, 11 * TICK_S)
    assert dict(core.rejected) == {"replay": 10}
    after = core.step(observation(11))
    assert before.command.telemetry.heard == after.command.telemetry.heard == (1,)


@pytest.mark.parametrize("sensors", [("proximity",), ()], ids=["ranging", "blind"])
@pytest.mark.parametrize(
    "at", [(2.0, 1.0, 0.5), (2.0, 1.0, 0.5 + 1e-12), (1e6, 1e6, 1e6), (-1e6, 0.0, 0.0)]
)
def test_a_neighbour_may_report_any_position(at, sensors):
    """Also the own position, at which the direction to it is undefined."""
    core = agent(sensors=sensors)
    for tick in range(60):
        now_s = tick * TICK_S
        odd = beacon(
            1,
            tick,
            now_s,
            at=at,
            velocity=(1.0,) * 3,
            target=at,
            queue=2**15 - 1,
            rank=2**15 - 1,
            cost_mm=2**31 - 1,
            speed_cap=100.0,
        )
        deliver(core, odd, now_s)
        checked_command(core.step(observation(tick, vehicles=[ORIGIN] if sensors else ())), tick)
    assert core.rejected.total() == 0


@pytest.mark.parametrize("neighbours", [0, 1, 90, 300])
def test_the_output_is_valid_with_any_number_of_neighbours(neighbours):
    random, core = Random(3), agent()
    for tick in range(8):
        now_s = tick * TICK_S
        for sender in range(1, neighbours + 1):
            at = tuple(random.uniform(-30.0, 30.0) for _ in range(3))
            deliver(core, beacon(sender, 2**40 + tick, now_s, at=at), now_s)
        command = checked_command(core.step(observation(tick)), tick)
        assert len(command.telemetry.heard) == min(neighbours, 256)
    assert core.rejected.total() == 0


def test_the_output_is_valid_with_any_number_of_records():
    core = agent()
    for first in range(1, 3000, 7):
        records = (greatest_record(subject) for subject in range(first, first + 7))
        fresh = tuple(msgspec.structs.replace(each, stamp_s=0.0) for each in records)
        deliver(core, gossip(1, 0.0, fresh), 0.0, 1)
    outbox = core.step(observation(0, at=(FAR, FAR, FAR)))
    checked_command(outbox, 0)
    assert sum(channel == MULTIHOP for channel, _ in outbox.frames) > 50


def conversation(ticks=80, start_s=0.0, make=agent):
    """Fly two agents that hear each other a tick later; return the output of both."""
    pair, positions = (make(0), make(1)), ((2.0, 1.0, 0.5), (-1.0, 0.5, 0.0))
    output, frames = [], ((), ())
    for tick in range(ticks):
        now_s = start_s + tick * TICK_S
        for me, core in enumerate(pair):
            for channel, payload in frames[1 - me]:
                core.receive(1 - me, channel, payload, now_s)
        outboxes = [
            core.step(observation(tick, at, start_s=start_s))
            for core, at in zip(pair, positions, strict=True)
        ]
        frames = tuple(outbox.frames for outbox in outboxes)
        output.append([(outbox.command, outbox.frames) for outbox in outboxes])
    assert pair[0].rejected.total() == pair[1].rejected.total() == 0
    return output


def encoded(output):
    return [[(encode(command), frames) for command, frames in each] for each in output]


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


def test_two_agents_that_hear_each_other_take_different_places():
    commands = [command for command, _ in conversation()[-1]]
    assert [command.telemetry.heard for command in commands] == [(1,), (0,)]
    assert len({command.telemetry.place for command in commands}) == 2


@pytest.mark.parametrize("allocation", ["structure", "assignment"])
def test_a_silent_neighbour_is_forgotten_and_its_place_is_free(allocation):
    core, other = agent(allocation=allocation), agent(1, allocation=allocation)
    ways = ((core, (2.0, 1.0, 0.5)), (other, (0.5, -0.5, -0.5)))
    said = ((), ())
    for tick in range(40):
        for me, (receiver, _) in enumerate(ways):
            for channel, payload in said[1 - me]:
                receiver.receive(1 - me, channel, payload, tick * TICK_S)
        outboxes = [each.step(observation(tick, at)) for each, at in ways]
        said = tuple(outbox.frames for outbox in outboxes)
    held = outboxes[0].command.telemetry
    assert held.heard == (1,)
    assert held.place != (0, 0)
    for tick in range(40, 40 + 60):
        alone = core.step(observation(tick)).command.telemetry
    assert alone.heard == ()
    assert alone.place == (0, 0)


def test_after_a_pause_old_neighbours_are_forgotten():
    """A process that was stopped for a minute reports no neighbours."""
    core = agent()
    deliver(core, beacon(1, 1, 0.0), 0.0)
    core.step(observation(0))
    outbox = core.step(observation(1200))
    checked_command(outbox, 1200)
    assert outbox.command.telemetry.heard == ()


def test_a_restarted_neighbour_is_accepted_at_once():
    listener, old, new = agent(0), agent(1), agent(1, incarnation=1)
    for tick in range(30):
        for channel, payload in old.step(observation(tick)).frames:
            listener.receive(1, channel, payload, tick * TICK_S)
        listener.step(observation(tick))
    for channel, payload in new.step(observation(31, at=(9.0, 9.0, 9.0))).frames:
        listener.receive(1, channel, payload, 31 * TICK_S)
    assert listener.rejected.total() == 0
    for channel, payload in old.step(observation(32)).frames:
        listener.receive(1, channel, payload, 32 * TICK_S)
    assert listener.rejected["replay"] == 1


class Counting:
    """A controller that stays where it is, and says how large the team is; ``seen``: its senses."""

    agents = 0
    seen: Senses

    def __init__(self, setup):
        pass

    def decide(self, senses):
        type(self).seen = senses
        words = Words(agents=self.agents)
        return Intent(ORIGIN, ORIGIN, 0.0, 0.0, senses.position, words=words)


CLOSED = msgspec.convert(
    {
        "name": "closed",
        "vertices": {"V": [0, 0, 0], "W": [12, 0, 0]},
        "queue": [{"name": "Q", "vertices": ["V", "W"]}],
    },
    FormationSpec,
)


def counting_core(formation):
    """Return an agent with a vehicle that can be elsewhere a tick later."""
    control = Control(controller=f"{__name__}:Counting")
    swift = Vehicle(sensors=("proximity",), max_speed_mps=50, max_climb_mps=50)
    setup = msgspec.structs.replace(AGENT_SETUP, formation=formation, control=control)
    return Agent(msgspec.structs.replace(setup, vehicle=swift))


@pytest.mark.parametrize(("agents", "kept"), [(9, True), (5, False)])
def test_reported_places_of_a_closed_queue_are_those_of_the_team_that_is_counted(
    monkeypatch, agents, kept
):
    """Of a team of nine an agent hears one; the place that this one reports is one of nine."""
    monkeypatch.setattr(Counting, "agents", agents)
    core = counting_core(CLOSED)
    place = Place(0, 4)
    body = formation_of(CLOSED, 1.0).slot(place, 9).point
    x, _, _ = body
    for tick in range(120):
        now_s, near = tick * TICK_S, tick < 60
        at = (x, -1.0, 0.0) if near else (x, -4.0, 0.0)
        witness = beacon(3, tick + 1, now_s, at=(x, 1.0, 0.0), blocked=(place,))
        deliver(core, witness, now_s)
        core.step(observation(tick, at, [(0.0, 1.0, 0.0)] if near else []))
    assert bool(Counting.seen.silent) == kept


@pytest.mark.parametrize(("at", "kept"), [((3.0, 0.0, 0.0), True), (ORIGIN, False)])
def test_a_neighbour_contradicts_only_a_vehicle_that_it_could_report(at, kept):
    """Off the places nobody reports a vehicle; in the next mission it may be in the way."""
    core = counting_core(WEDGE)
    x, _, _ = at
    for tick in range(120):
        now_s, near = tick * TICK_S, tick < 60
        deliver(core, beacon(3, tick + 1, now_s, at=(x, 1.0, 0.0)), now_s)
        here = (x, -1.0 if near else -4.0, 0.0)
        core.step(observation(tick, here, [(0.0, 1.0, 0.0)] if near else []))
    assert bool(Counting.seen.silent) == kept


def test_places_that_others_see_taken_are_of_the_mission_that_is_flown():
    core = counting_core(CLOSED)
    deliver(core, beacon(3, 1, 0.0, blocked=(Place(0, 4),)), 0.0)
    core.step(observation(0))
    assert Counting.seen.blocked == {Place(0, 4)}
    order = Mission(key=0, frame=AT_HOME, formation=encode_formation(WEDGE))
    core.step(msgspec.structs.replace(observation(1), orders=(order,)))
    assert Counting.seen.mission.formation.name == "wedge"
    assert Counting.seen.blocked == frozenset()
