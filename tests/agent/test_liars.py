"""One member that lies with its own credentials: its lies are bounded, and the agent flies on."""

from random import Random
from time import process_time

import msgspec
import pytest

from agent.codec import add_checksum, decode_beacon, decode_gossip, encode
from agent.comms.mission import FIRST_VERSIONS, FRAME_VERSIONS_AHEAD, KEYS_PER_VERSION
from agent.comms.neighbours import Neighbours
from agent.config import AgentSetup, Comms, Control, Vehicle
from agent.core import Agent
from agent.messages import (
    AT_HOME,
    PIECE_B,
    Branch,
    Drift,
    FramePath,
    Mission,
    Piece,
    Pose,
    RootKey,
    Summary,
)
from agent.qstructure.formation import FormationSpec
from agent.structure.label_code import FIRST_QUEUE
from netem.wire.channels import LOCAL, MULTIHOP
from tests.agent.comms.builders import beacon, gossip, heard_beacon, record
from tests.agent.structure.builders import standing
from tests.agent.test_core import TICK_S, observation
from tests.random_flights.lies import Lies, liars_senses

LIAR, HONEST, IDS = 5, 6, 12
HIGHEST = 2**53 - 1
HOME_2 = FramePath(waypoints=((2.0, 0.0, 0.0),))
RAY = {"kind": "ray", "direction": [-1, 1, 0]}


def formation(shape=RAY, vertices=None, through=("V",), **queue):
    """Return a formation of one queue."""
    tables = {
        "name": "f",
        "vertices": vertices or {"V": [0, 0, 0]},
        "queue": [{"name": "Q", "vertices": list(through), "shape": shape, **queue}],
    }
    return msgspec.convert(tables, FormationSpec)


def curve(x, y="0", z="0"):
    return {"kind": "curve", "x": x, "y": y, "z": z}


def agent(own_id=0):
    return Agent(
        AgentSetup(
            id=own_id,
            incarnation=0,
            tick_hz=1.0 / TICK_S,
            slots_per_tick=4,
            command_ticks=2,
            vehicle=Vehicle(),
            fleet_max_speed_mps=0.5,
            control=Control(),
            comms=Comms(),
            formation=formation(),
            ids=IDS,
        )
    )


@pytest.fixture
def core():
    return agent()


def telemetry(core, tick=0):
    return core.step(observation(tick)).command.telemetry


def pieces(key, spec, path=AT_HOME):
    """Return a mission as it travels, piece by piece."""
    data = msgspec.msgpack.encode([path, msgspec.msgpack.encode(spec)])
    parts = [data[at : at + PIECE_B] for at in range(0, len(data), PIECE_B)]
    return [Piece(key, index, len(parts), part) for index, part in enumerate(parts)]


def send(core, piece, sender=LIAR, now_s=0.0):
    message = msgspec.structs.replace(gossip(sender, now_s, ()), piece=piece)
    core.receive(sender, MULTIHOP, add_checksum(encode(message)), now_s)


def send_mission(core, key, spec, path=AT_HOME, sender=LIAR, now_s=0.0):
    for piece in pieces(key, spec, path):
        send(core, piece, sender, now_s)


def key_of(version):
    return version * KEYS_PER_VERSION + LIAR


UNFLYABLE = {
    "a closed queue between coincident vertices": (
        formation(None, {"V": [0, 0, 0], "W": [0, 0, 0]}, ("V", "W")),
        AT_HOME,
    ),
    "a curve that stands still": (formation(curve("1")), AT_HOME),
    "a pole at the vertex": (formation(curve("1/s")), AT_HOME),
    "a closed queue along a curve too slow to measure": (
        formation(curve("s*1e-7"), {"V": [0, 0, 0], "W": [9, 0, 0]}, ("V", "W")),
        AT_HOME,
    ),
    "a closed queue along a helix of a millimetre": (
        formation(
            {"kind": "helix", "radius_m": 0.001, "pitch_m": 1e-9},
            {"V": [0, 0, 0], "W": [9, 0, 0]},
            ("V", "W"),
        ),
        AT_HOME,
    ),
    "an orientation that is no number": (
        formation(orientation={"yaw_deg": "north"}),
        AT_HOME,
    ),
    "vertices far from the frame": (formation(vertices={"V": [1e6, 0, 0]}), AT_HOME),
    "a frame that never leaves its waypoint": (
        formation(),
        FramePath(waypoints=((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))),
    ),
    "a frame too far away": (formation(), FramePath(waypoints=((1e6, 1e6, 0.0),))),
    "a frame without speed": (formation(), FramePath(waypoints=((0.0,) * 3,), speed=1e-310)),
    "a frame that turns its slots too fast": (
        formation(vertices={"V": [4e4, 0, 0]}),
        FramePath(waypoints=((0.0, 0.0, 0.0), (9.0, 0.0, 0.0)), turn_rate=1.0),
    ),
}


@pytest.mark.parametrize(("spec", "path"), UNFLYABLE.values(), ids=UNFLYABLE)
def test_a_mission_that_cannot_be_flown_is_counted_and_the_agent_flies_on(core, spec, path):
    before = telemetry(core)
    began = process_time()
    send_mission(core, key_of(1), spec, path)
    assert process_time() - began < 2.0
    assert core.rejected.total() == 1
    assert telemetry(core, 1).mission == before.mission == 0


@pytest.mark.parametrize(("spec", "path"), list(UNFLYABLE.values())[:8], ids=list(UNFLYABLE)[:8])
def test_an_order_that_cannot_be_flown_is_counted_and_the_agent_flies_on(core, spec, path):
    order = Mission(key=0, frame=path, formation=msgspec.msgpack.encode(spec))
    asked = msgspec.structs.replace(observation(0), orders=(order,))
    assert core.step(asked).command.telemetry.mission == 0
    assert core.rejected["mission"] == 1


GROWS = {
    "a pole behind the third slot": curve("s", "0.1/(3.2-s)"),
    "a curve that slows down for ever": curve("tanh(s/4)*4"),
    "a spline of 1000 km": {"kind": "spline", "points_m": [[0, 0, 0], [1e6, 0, 0]]},
}


@pytest.mark.parametrize("shape", GROWS.values(), ids=GROWS)
def test_a_mission_that_fits_some_teams_only_is_flown_by_any(core, shape):
    send_mission(core, key_of(1), formation(shape, orientation={"yaw_deg": "1/(d-2)"}))
    assert telemetry(core).mission == key_of(1)
    for tick, size in enumerate(range(1, IDS), start=1):
        records = tuple(record(each, tick, tick * TICK_S) for each in range(1, size + 1))
        message = encode(gossip(LIAR, tick * TICK_S, records))
        core.receive(LIAR, MULTIHOP, add_checksum(message), tick * TICK_S)
        telemetry(core, tick)
    assert core.rejected.total() == 0


@pytest.mark.parametrize("key", [HIGHEST, key_of(FIRST_VERSIONS + 1)])
def test_an_invented_key_leaves_room_for_the_next_mission(core, key):
    send_mission(core, key, formation(curve("2*s")))
    ahead = beacon(LIAR, 1, 0.0, frame_key=key, mission=key)
    core.receive(LIAR, LOCAL, add_checksum(encode(ahead)), 0.0)
    assert core.rejected["mission"] == 2
    send_mission(core, key_of(1), formation(curve("3*s")), sender=HONEST)
    assert telemetry(core).mission == key_of(1)


def test_the_highest_key_that_a_liar_may_use_is_superseded_by_the_operator(core):
    send_mission(core, key_of(FIRST_VERSIONS), formation(curve("2*s")))
    assert telemetry(core).mission == key_of(FIRST_VERSIONS)
    core.step(
        msgspec.structs.replace(
            observation(1), orders=(Mission(key=0, frame=AT_HOME, formation=b""),)
        )
    )
    newest = telemetry(core, 2).mission
    assert newest // KEYS_PER_VERSION == FIRST_VERSIONS + 1
    other = agent(1)
    send_mission(other, newest, formation(curve("2*s")), sender=0, now_s=1.0)
    assert telemetry(other, 20).mission == newest


def test_a_sender_of_a_bad_mission_is_ignored_for_a_while_and_others_are_not(core):
    bad, good = formation(curve("1/s")), formation(curve("2*s"))
    for version in range(1, 6):
        send_mission(core, key_of(version), bad)
    assert core.rejected["mission"] == 1
    send_mission(core, key_of(6), good, sender=HONEST)
    assert telemetry(core).mission == key_of(6)
    send_mission(core, key_of(7), good, now_s=10.1)
    assert telemetry(core, 203).mission == key_of(7)


def test_a_liar_cannot_spoil_the_pieces_of_another(core):
    long = formation({"kind": "polyline", "points_m": [[0, 0, k] for k in range(99)]})
    sound = pieces(key_of(1), long)
    assert len(sound) > 1
    for piece in sound:
        send(core, msgspec.structs.replace(piece, data=b"\x00"))
        send(core, piece, HONEST)
    assert telemetry(core).mission == key_of(1)


def test_an_invented_frame_is_superseded_by_few_missions(core):
    for sequence, version in enumerate((FRAME_VERSIONS_AHEAD + 1, FRAME_VERSIONS_AHEAD), start=1):
        lie = Pose(float(version), 0.0, 0.0, 0.0)
        ahead = beacon(LIAR, sequence, 0.05 * sequence, frame_key=key_of(version), frame=lie)
        core.receive(LIAR, LOCAL, add_checksum(encode(ahead)), 0.05 * sequence)
    assert core.rejected["mission"] == 1
    send_mission(core, key_of(FRAME_VERSIONS_AHEAD + 1), formation(), HOME_2, now_s=0.2)
    sent = [each for each in core.step(observation(4)).frames if each[0] == LOCAL]
    assert decode_beacon(sent[0][1]).frame == Pose(2.0, 0.0, 0.0, 0.0)


def test_a_frame_that_would_fling_slots_is_counted(core):
    drift = Drift(stamp_s=0.0, x=0.0, y=0.0, z=0.0, yaw_rate=99.0)
    lie = beacon(LIAR, 1, 0.0, frame_key=key_of(1), frame=Pose(1.0, 0.0, 0.0, 0.0), drift=drift)
    core.receive(LIAR, LOCAL, add_checksum(encode(lie)), 0.0)
    assert core.rejected["mission"] == 1
    telemetry(core)


def test_invented_members_are_only_those_that_the_run_has(core):
    for first in range(1, 1101, 16):
        records = tuple(record(each, 1, 0.0) for each in range(first, first + 16))
        message = encode(gossip(LIAR, 0.0, records))
        core.receive(LIAR, MULTIHOP, add_checksum(message), 0.0)
    sent = core.step(observation(0)).frames
    told = [msgspec.msgpack.decode(each[:-4]) for channel, each in sent if channel == MULTIHOP]
    assert sorted(row[0] for message in told for row in message[2]) == list(range(IDS))


def test_a_restarted_agent_is_heard_after_an_invented_incarnation_falls_silent(core):
    lie = beacon(LIAR, HIGHEST, 0.0, incarnation=HIGHEST)
    core.receive(LIAR, LOCAL, add_checksum(encode(lie)), 0.0)
    assert telemetry(core).heard == (LIAR,)
    for tick in (101, 102):
        restarted = beacon(LIAR, tick - 100, tick * TICK_S, incarnation=1)
        core.receive(LIAR, LOCAL, add_checksum(encode(restarted)), tick * TICK_S)
        assert telemetry(core, tick).heard == (LIAR,)
    assert core.rejected.total() == 0


HONEST_STANDING = standing(branches=(Branch(RootKey(0, HONEST), 10, 0, -1),), leads=0)


@pytest.mark.parametrize("seed", range(4))
def test_an_agent_flies_on_whatever_a_member_says_of_the_structure(core, seed):
    """Ten seconds of lies, half of them aimed: none raises, none takes long."""
    lies, random, took_s = Lies(LIAR), Random(seed), []
    for tick in range(200):
        now_s = tick * TICK_S
        honest = beacon(HONEST, tick + 1, now_s, at=(0.0, 2.0, 0.0), standing=HONEST_STANDING)
        core.receive(HONEST, LOCAL, add_checksum(encode(honest)), now_s)
        known = liars_senses(LIAR, [honest], now_s)
        queue, rank = lies.place(known) or (-1, -1)
        lie = beacon(
            LIAR,
            tick + 1,
            now_s,
            at=(random.uniform(-9, 9), 1.0, 0.0),
            queue=queue,
            rank=rank,
            standing=lies.standing(known),
        )
        began = process_time()
        core.receive(LIAR, LOCAL, add_checksum(encode(lie)), now_s)
        for _ in range(20):
            told = gossip(LIAR, now_s, summary=lies.summary(known))
            core.receive(LIAR, MULTIHOP, add_checksum(encode(told)), now_s)
        core.step(observation(tick))
        took_s.append(process_time() - began)
    assert core.rejected.total() == 0
    assert sorted(took_s)[len(took_s) // 2] < 0.02


def test_a_member_with_many_summaries_leaves_room_for_those_of_others(core):
    """A step takes the latest of each sender: a flood shuts nobody out."""
    label = 255 - FIRST_QUEUE
    for _ in range(2000):
        flood = gossip(LIAR, 0.0, summary=Summary(0, 0, b"", (), ()))
        core.receive(LIAR, MULTIHOP, add_checksum(encode(flood)), 0.0)
    news = Summary(0, 0, b"", ((HONEST, label),), ())
    core.receive(HONEST, MULTIHOP, add_checksum(encode(gossip(HONEST, 0.0, summary=news))), 0.0)
    frames = [each for tick in range(20) for each in core.step(observation(tick)).frames]
    told = [decode_gossip(payload).summary for channel, payload in frames if channel == MULTIHOP]
    assert HONEST in {member for each in told if each is not None for member, _ in each.news}


def test_a_position_far_away_does_not_stretch_the_reach():
    neighbours = Neighbours(0, 20.0, 0.1)
    for sequence, liars_x in enumerate((2.0, 1e6, 2.0), start=1):
        now_s = 0.05 * sequence
        neighbours.receive(heard_beacon(LIAR, sequence, now_s, at=(liars_x, 0.0, 0.0)), now_s, {})
        neighbours.receive(heard_beacon(HONEST, sequence, now_s, at=(0.0, 3.0, 0.0)), now_s, {})
        neighbours.receive(heard_beacon(HONEST + 1, sequence, now_s, at=(0.0, 0.0, 1.0)), now_s, {})
        neighbours.link((0.0, 0.0, 0.0))
    assert neighbours.link((0.0, 0.0, 0.0)).reach_m == 3.0


def test_the_reach_of_two_is_what_the_nearer_shows_and_of_one_what_it_shows():
    neighbours = Neighbours(0, 20.0, 0.1)
    neighbours.receive(heard_beacon(3, 1, 0.0, at=(7.0, 0.0, 0.0)), 0.0, {})
    assert neighbours.link((0.0, 0.0, 0.0)).reach_m == 7.0
    neighbours.receive(heard_beacon(4, 1, 0.0, at=(5.0, 0.0, 0.0)), 0.0, {})
    assert neighbours.link((0.0, 0.0, 0.0)).reach_m == 5.0
    neighbours.receive(heard_beacon(4, 2, 0.05, at=(6.0, 0.0, 0.0)), 0.05, {})
    assert neighbours.link((0.0, 0.0, 0.0)).reach_m == 6.0
