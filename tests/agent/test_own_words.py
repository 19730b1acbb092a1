"""A controller's own words, signals, log, services and filter modes, at the core and its check."""

from array import array
from math import inf, nan
from typing import Any

import pytest
from msgspec.structs import replace

from agent.codec import add_checksum, decode_beacon, decode_command, encode, holds_datagram
from agent.config import AgentSetup, Control, Vehicle
from agent.controller import ControllerError, FaultyControllerError, Intent, Outgoing, Senses
from agent.controller_log import LINES_PER_S, Logging, LogLimiter
from agent.core import Agent
from agent.messages import MAX_DATAGRAM_B, MAX_LOG_LINES, MAX_SIGNALS, Datagram, Place
from agent.plain_intent import MAX_DATAGRAMS, plain
from agent.services import SERVICES, Services, ServicesError, services_of
from netem.wire.channels import LOCAL, MULTIHOP
from tests.agent.comms.builders import beacon
from tests.agent.test_core import AGENT_SETUP, deliver, observation
from tests.agent.test_core import agent as q_structure_agent

REST = (0.0, 0.0, 0.0)
HOVER = Intent(REST, REST, 0.0, 0.0, REST)


class Chatty(Logging):
    """Asks for nothing, says what it heard, and tells of it."""

    services: Any = ()
    wanted = REST

    def __init__(self, setup: AgentSetup) -> None:
        self.log("made", setup.id)

    def decide(self, senses: Senses) -> Intent:
        self.log("hears", len(senses.inbox))
        said = (Outgoing("local", b"one"), Outgoing("multihop", b"three"))
        signals = {"heard": len(senses.inbox), "z": senses.position[2]}
        wanted = self.wanted
        return replace(HOVER, wanted=wanted, velocity=wanted, messages=said, signals=signals)


class Rushing(Chatty):
    wanted = (0.5, 0.0, 0.0)


def agent(controller: type = Chatty, **control: Any) -> Agent:
    name = f"{__name__}:{controller.__name__}"
    return Agent(replace(AGENT_SETUP, control=Control(controller=name, **control)))


def test_what_nobody_asked_for_costs_no_byte() -> None:
    core = agent()
    for tick in range(100):
        frames = core.step(observation(tick)).frames
        assert [holds_datagram(payload) for _, payload in frames] == [True, True]
        assert [channel for channel, _ in frames] == [LOCAL, MULTIHOP]


def test_beacons_are_neither_read_nor_rejected_where_nobody_asked_for_them() -> None:
    core = agent()
    deliver(core, beacon(1, sequence=1, stamp_s=0.0), 0.0)
    core.receive(2, LOCAL, b"\x93junk", 0.0)
    core.receive(2, MULTIHOP, b"\x93junk", 0.0)
    outbox = core.step(observation(0))
    assert outbox.command.telemetry.heard == ()
    assert not core.rejected


def test_a_scenario_may_switch_services_off_and_on() -> None:
    spoken = agent(services=("beacons",)).step(observation(0)).frames
    assert [holds_datagram(payload) for _, payload in spoken] == [False, True, True]
    silent = Agent(replace(AGENT_SETUP, control=Control(services=())))
    assert silent.step(observation(0)).frames == ()
    with pytest.raises(ControllerError, match="without 'beacons' there are no missions"):
        agent(services=("missions",))


def test_without_hierarchy_a_q_structure_says_nothing_of_it() -> None:
    plain_core = q_structure_agent()
    without = Agent(replace(AGENT_SETUP, control=Control(services=("beacons",))))
    said = [core.step(observation(0)).frames for core in (plain_core, without)]
    assert len(said[0][0][1]) > len(said[1][0][1])
    assert len(said[0]) >= len(said[1])


@pytest.mark.parametrize("asked", ["beacons", ("news",), ("records",)])
def test_services_that_cannot_be_had_are_named(asked: Any) -> None:
    kind = type("Asking", (), {"services": asked})
    with pytest.raises(ServicesError, match="beacons"):
        services_of(kind, None)


def test_a_controller_that_names_no_services_has_all() -> None:
    assert services_of(object, None) == Services(*(True for _ in SERVICES))
    assert services_of(Chatty, None) == Services(*(False for _ in SERVICES))
    assert services_of(Chatty, ("beacons",)).beacons


def test_the_inbox_is_heard_once_and_told() -> None:
    core = agent()
    core.step(observation(0))
    core.receive(7, LOCAL, add_checksum(encode(Datagram(0.0, b"four"))), 0.05)
    heard = core.step(observation(1)).command.telemetry.report
    after = core.step(observation(2)).command.telemetry.report
    assert heard is not None
    assert after is not None
    assert (heard.received, heard.sent, heard.oldest_s) == ((1, 4), (2, 8), 0.05)
    assert core.step(observation(3)).command.telemetry.heard == (7,)
    assert dict(heard.signals) == {"heard": 1.0, "z": 0.5}
    assert (after.received, after.oldest_s) == ((0, 0), 0.0)
    assert heard.log == ("hears 1",)


def test_a_report_crosses_the_codec() -> None:
    command = agent().step(observation(0)).command
    assert decode_command(encode(command)) == command
    assert command.telemetry.report.log == ("made 0", "hears 0")


def test_a_datagram_of_the_future_contradicts_the_clock_as_a_beacon_does() -> None:
    core = agent()
    core.step(observation(0))
    for tick in range(1, 5):
        for source in (3, 4):
            late = add_checksum(encode(Datagram(60.0, b"")))
            core.receive(source, LOCAL, late, 0.05 * tick)
        frames = core.step(observation(tick)).frames
    assert core.rejected["future"] == 8
    assert frames == ()  # who knows its clock to be wrong says nothing


@pytest.mark.parametrize(
    ("intent", "why"),
    [
        ({"messages": (Outgoing("loud", b""),)}, "'loud'"),  # type: ignore[arg-type]
        ({"messages": (Outgoing("local", "text"),)}, "str, not bytes"),  # type: ignore[arg-type]
        ({"messages": (Outgoing("local", bytes(MAX_DATAGRAM_B + 1)),)}, f"{MAX_DATAGRAM_B} B are"),
        ({"messages": (Outgoing("local", b""),) * (MAX_DATAGRAMS + 1)}, "messages in one tick"),
        ({"signals": {"Über": 1.0}}, "no name of a signal"),
        ({"signals": {"x": nan}}, "'x' is nan"),
        ({"signals": {"x": inf}}, "'x' is inf"),
        ({"signals": {"x": "2.5"}}, "'x' is '2.5', no number"),
        ({"signals": {"x": 10**400}}, "'x' is no number"),
        ({"signals": [1.0]}, "list, no mapping"),
        ({"messages": (("local", memoryview(array("d", [1.0] * 1000))),)}, "8000 B"),
        ({"messages": Outgoing("local", b"")}, "is no Outgoing"),
        ({"messages": (Outgoing("local", b"") for _ in iter(int, 1))}, "more than 8 messages"),
        ({"place": (0, 0, 0)}, "place is .* no queue and rank"),
        ({"place": "Q1"}, "place is 'Q1'"),
        ({"place": Place(10**30, 0)}, "at most 32767"),
        ({"cost_m": nan}, "cost_m is nan"),
        ({"words": None}, "no Words"),
        ({"signals": {f"s{k}": 0.0 for k in range(MAX_SIGNALS + 1)}}, "more than 16 signals"),
    ],
)
def test_words_and_signals_out_of_bounds_are_refused_by_name(intent: Any, why: str) -> None:
    with pytest.raises((ValueError, TypeError), match=why):
        plain(replace(HOVER, **intent))


def test_words_and_signals_become_plain() -> None:
    given = replace(HOVER, messages=[("local", bytearray(b"x"))], signals={"n": 3})  # type: ignore[arg-type]
    assert plain(given).messages == (Outgoing("local", b"x"),)
    assert plain(given).signals == {"n": 3.0}

    class Name(str):
        __slots__ = ()

    named = plain(replace(HOVER, signals={Name("n"): 1}, messages=((Name("local"), b""),)))  # type: ignore[arg-type]
    assert type(next(iter(named.signals))) is type(named.messages[0].channel) is str
    listed = plain(replace(HOVER, velocity=[0.1, 0, 0], place=[1, 2]))  # type: ignore[arg-type]
    assert (listed.velocity, listed.place) == ((0.1, 0.0, 0.0), Place(1, 2))


class Inventive(Chatty):
    def decide(self, senses: Senses) -> Intent:
        return replace(HOVER, signals={f"s{round(20 * senses.now_s)}": 1.0})


def test_the_names_of_all_signals_are_bounded() -> None:
    core = agent(Inventive)
    with pytest.raises(FaultyControllerError, match="17 different signals so far, s0, s1"):
        for tick in range(MAX_SIGNALS + 1):
            core.step(observation(tick))


def test_a_log_is_limited_each_second_and_says_what_it_left_out() -> None:
    limiter = LogLimiter()
    told = [limiter.limited([f"line {k}\nmore" for k in range(9)], 0.05 * k) for k in range(20)]
    assert all(len(each) <= MAX_LOG_LINES for each in told)
    assert sum(map(len, told)) == LINES_PER_S
    assert told[0][0] == "line 0 more"
    assert LogLimiter().limited(["\ud800 lone"], 0.0) == ("? lone",)
    assert limiter.limited([], 1.0) == (f"({9 * 20 - LINES_PER_S} lines left out: 10 a second)",)
    assert limiter.limited(["again"], 1.05) == ("again",)


@pytest.mark.parametrize(
    ("mode", "flown", "changed"),
    [("on", REST, 0.5), ("watch", (0.5, 0.0, 0.0), 0.5), ("off", (0.5, 0.0, 0.0), 0.0)],
)
def test_the_filter_acts_watches_or_is_off(mode: Any, flown: Any, changed: float) -> None:
    core = agent(Rushing, safety_filter=mode)
    close = [(0.25, 0.0, 0.0)]
    command = core.step(observation(0, vehicles=close)).command
    assert command.velocity == pytest.approx(flown, abs=1e-9)
    assert command.telemetry.filter_mps == pytest.approx(changed, abs=1e-9)
    assert command.telemetry.wanted == (0.5, 0.0, 0.0)


def test_who_only_watches_promises_nothing() -> None:
    blind = Vehicle(sensors=())
    caps = []
    for mode in ("on", "watch"):
        control = Control(services=("beacons",), safety_filter=mode)  # type: ignore[arg-type]
        core = Agent(replace(AGENT_SETUP, vehicle=blind, control=control, team=2))
        for tick in range(60):
            deliver(core, beacon(1, sequence=tick + 1, stamp_s=0.05 * tick), 0.05 * tick)
            said = core.step(observation(tick, at=(0.6, 0.0, 0.0))).frames[0][1]
        caps.append(decode_beacon(said).speed_cap)
    assert caps[1] == blind.max_speed_mps > caps[0]
