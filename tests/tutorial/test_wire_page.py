"""The page on the wire, and its foreign agent: what it imports, says and decides."""

import ast
import importlib.util
import sys
from pathlib import Path
from typing import Any

import msgpack
import msgspec
import pytest

from agent.codec import (
    add_checksum,
    decode_beacon,
    decode_command,
    decode_formation,
    decode_gossip,
    encode,
)
from agent.messages import Beacon, Mission, Observation, Pose, Standing
from netem.wire.channels import NUMBERS
from netem.wire.frame import Batch, Frame, pack, unpack_transmission
from worldsim.scenario.file import load

DOCS = Path(__file__).parents[2] / "docs"
PROGRAM = DOCS / "examples" / "foreign_agent.py"
SCENARIO = DOCS / "examples" / "foreign-9.toml"
OWN = 8


@pytest.fixture(scope="module")
def program() -> Any:
    """The foreign agent of the page, as a module."""
    spec = importlib.util.spec_from_file_location("foreign_agent", PROGRAM)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def agent_of(program: Any, *, incarnation: int = 0, lockstep: bool = True) -> Any:
    """The agent with a setup as the world answers it; a restarted one is not briefed."""
    setup = load(SCENARIO).agent_setup(OWN, incarnation, 1)
    setup = msgspec.structs.replace(setup, lockstep=lockstep)
    return program.Agent(msgspec.json.decode(msgspec.json.encode(setup)))


def observed(agent: Any, time_s: float, *orders: Mission, late_slots: int = 0) -> tuple[Any, Any]:
    """Let an agent step; return its decoded command and transmission."""
    here = (1.0, 2.0, 0.5)
    seen = Observation(
        round(80 * time_s), time_s, here, here, 0.1, ((0.3, 0.0, 0.0),), (), orders, (), late_slots
    )
    command, transmission = agent.step(msgpack.unpackb(encode(seen)))
    return decode_command(command), unpack_transmission(transmission)


def hear(agent: Any, time_s: float, *claims: tuple[int, int], leads: int = -1) -> None:
    """Let it hear members that claim places, the first as the leader of a vertex."""
    for k, place in enumerate(claims):
        led = leads if k == 0 else -1
        standing = Standing((), led, place[0], 9, False, None, None, 2)
        payload = add_checksum(encode(beacon(k, time_s, place, standing)))
        frame = Frame(k, 0, 0, round(80 * time_s), payload)
        agent.receive([msgpack.unpackb(pack(Batch(0, (frame,))))])


def beacon(
    sender: int, time_s: float, place: tuple[int, int], standing: Standing | None, mission: int = 0
) -> Beacon:
    point = (float(sender), 0.0, 0.0)
    claim, frame = (*place, 0, 0.5, ((OWN, 1),)), (mission, Pose(0.0, 0.0, 0.0, 0.0), None)
    sequence = round(20 * time_s)
    return Beacon(
        sender, 0, sequence, time_s, point, point, point, *claim, mission, *frame, (), standing
    )


def test_it_imports_nothing_of_the_project() -> None:
    tree = ast.parse(PROGRAM.read_text())
    names = {
        (node.module or "" if isinstance(node, ast.ImportFrom) else alias.name).partition(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }
    assert names - set(sys.stdlib_module_names) == {"zenoh", "msgpack"}


def test_the_page_shows_the_table_of_its_scenario() -> None:
    shown = (DOCS / "wire.md").read_text().split("```toml\n")[1].split("```")[0]
    (table,) = load(SCENARIO).agent
    for line in (f"ids = {list(table.ids)}", f"command = {list(table.command or ())}"):
        assert line.replace("'", '"') in shown


def test_what_it_says_is_what_the_fleet_decodes(program: Any) -> None:
    agent = agent_of(program)
    command, transmission = observed(agent, 0.1)
    assert (command.slot, command.expires_slot, command.telemetry.place) == (8, 12, None)
    (frame,) = transmission.frames
    said = decode_beacon(frame.payload)
    assert (said.id, said.mission, said.queue, said.rank) == (OWN, 0, -1, -1)
    assert said.standing is None  # nobody leads: it is no member
    hear(agent, 0.1, (0, 0), (0, 1), leads=0)
    command, transmission = observed(agent, 0.15)
    said = decode_beacon(transmission.frames[0].payload)
    assert command.telemetry.place == (said.queue, said.rank) == (3, 1)
    assert said.standing == Standing((), -1, 3, 3, False, None, None, 5)
    assert [id_ for id_, _ in said.echoes] == [0, 1]


def test_it_takes_the_place_that_is_left_and_gives_it_up_to_who_claims_it(program: Any) -> None:
    agent = agent_of(program)
    others = [(0, 0), *((queue, rank) for queue in range(4) for rank in (1, 2))][:-1]
    for time_s, claims, place in (
        (0.1, [*others[:-1], (-1, -1)], None),  # one of them has still to choose
        (0.2, others, (3, 2)),
        (0.3, [*others[:-1], (3, 2)], None),  # the other one keeps it
        (0.5, [*others[:-1], (3, 2)], None),
        (0.7, [*others[:-1], (3, 2)], (3, 1)),
        (2.5, [], None),  # nobody is heard any more
    ):
        hear(agent, time_s, *claims, leads=0)
        command, _ = observed(agent, time_s)
        assert command.telemetry.place == place, time_s


def test_damaged_and_forged_frames_are_left(program: Any) -> None:
    agent = agent_of(program)
    payload = add_checksum(encode(beacon(3, 0.1, (0, 0), None)))
    damaged = bytes([payload[0] ^ 1]) + payload[1:]
    junk = (b"", b"\x92\x01\x02", b"\x05", b"\xc1", b"\x94\x01\x02\x03\x04", b"\x81\x01\x01")
    frames = [Frame(3, 0, 0, 1, damaged), Frame(4, 0, 0, 1, payload)]
    frames += [Frame(3, 0, on, 1, add_checksum(each)) for each in junk for on in NUMBERS]
    agent.receive([msgpack.unpackb(pack(Batch(0, tuple(frames))))])
    assert agent.heard == {}


def test_a_restarted_one_learns_the_mission_and_tells_it_on(program: Any) -> None:
    agent, teacher = agent_of(program, incarnation=1), agent_of(program)
    assert observed(agent, 0.1)[0].telemetry.mission == -1
    lacking = add_checksum(encode(beacon(3, 0.1, (-1, -1), None, mission=-1)))
    teacher.receive([msgpack.unpackb(pack(Batch(0, (Frame(3, 0, 0, 1, lacking),))))])
    formation = encode(load(DOCS.parent / "deploy/scenarios/vertical-lines-12.toml").formation)
    order = Mission(key=0, frame=load(SCENARIO).agent_setup(0, 0, 1).frame, formation=formation)
    _, transmission = observed(teacher, 0.2, order)
    key, pieces = 65536 + OWN, [f.payload for f in transmission.frames if f.channel == 1]
    assert [decode_gossip(each).piece.key for each in pieces] == [key]  # type: ignore[union-attr]
    frames = [Frame(5, 0, 1, k, payload) for k, payload in enumerate(pieces)]
    agent.receive([msgpack.unpackb(pack(Batch(0, tuple(frames))))])
    assert observed(agent, 0.3)[0].telemetry.mission == key
    learnt = msgpack.unpackb(agent.encoded)[1]
    assert decode_formation(learnt).name == "three-vertical-lines"


def test_a_formation_that_it_does_not_know_is_left_to_the_others(
    program: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    agent = agent_of(program)
    formation = encode(load(DOCS.parent / "deploy/scenarios/helix-12.toml").formation)
    order = Mission(key=65536, frame=load(SCENARIO).agent_setup(0, 0, 1).frame, formation=formation)
    assert observed(agent, 0.2, order)[0].telemetry.mission == 0
    assert "mission 65536 is left to the others" in capsys.readouterr().err


def test_a_slow_step_says_its_frames_with_the_next_one_in_lockstep(program: Any) -> None:
    agent = agent_of(program)
    steps = ((0.1, 0), (0.15, 3), (0.2, 3), (0.25, 0), (0.3, 0))
    sent = [observed(agent, time_s, late_slots=late)[1].frames for time_s, late in steps]
    said = [[decode_beacon(each.payload).sequence for each in frames] for frames in sent]
    assert said == [[1], [], [2], [3, 4], [5]]
