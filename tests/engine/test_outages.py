"""Netem and the world down in virtual time: nothing passes meanwhile, and all is accounted for."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine.test_timeline_effects import scenario
from tests.results.test_fault_rows import flown
from tests.small_scenario import SMALL
from worldsim.campaign.flight import finished
from worldsim.engine.step import SlotLoop, world_of
from worldsim.engine.virtual import Flight, VirtualFleet, fly
from worldsim.results.fault_rows import fault_texts
from worldsim.results.summary import summarise
from worldsim.scenario.file import parse

SLOW = "[netem]\ndelay_ms = 200\n"
"""Frames are in flight for longer than a tick."""


def flight(*events: str, before: str = SLOW) -> Flight:
    tables = "".join(f"[[event]]\n{event}\n" for event in events)
    return fly(parse(f"{SMALL}{before}{tables}[expect]\nconverge = false\n"))


def kinds(found: Flight) -> list[tuple[float, str]]:
    wanted = ("netem_outage", "world_outage", "reconnect")
    return [(event.t_s, event.kind) for event in found.loop.events if event.kind in wanted]


@pytest.mark.parametrize("fault", ["kill", "pause"])
def test_nothing_passes_while_netem_is_down_and_the_vehicles_hover(fault: str) -> None:
    fleet = VirtualFleet(
        parse(f"{SMALL}{SLOW}[[event]]\nat_s = 0.5\nfor_s = 1\n{fault} = ['netem']\n")
    )
    seen = {}
    while fleet.loop.world.time_s < 2.5:
        fleet.slot()
        latest = [each.slot if each else -1 for each in fleet.loop.world.latest]
        packets = fleet.medium_counters.packets()
        place = fleet.loop.world.vehicles.position.tolist()
        seen[fleet.loop.world.slot] = (latest, packets, place)
    latest, packets, place = seen[46]
    for slot in range(47, 121):
        assert seen[slot][0] == latest, "no command comes"
        assert seen[slot][1]["sent"] == packets["sent"], "no frame is sent"
        assert seen[slot][1]["delivered"] == packets["delivered"], "no frame comes"
        assert seen[slot][2] == place, "the commands have expired"
    assert seen[160][0] != latest
    assert seen[160][1]["delivered"] > packets["delivered"]


def test_a_kill_takes_the_frames_in_flight_and_a_pause_delays_them() -> None:
    kill, pause = (
        flight(f"at_s = 3\nfor_s = 0.5\n{fault} = ['netem']") for fault in ("kill", "pause")
    )
    for found in (kill, pause):
        counted = found.medium_counters
        assert counted.addressed == sum(counted.fates.values()) + counted.in_flight
        assert found.loop.judge.invariants()["I8"].violations == 0
    # Each of two agents has sent one beacon a tick in the last 200 ms, and perhaps a record.
    assert 8 <= kill.medium_counters.fates["dropped_medium"] <= 12
    assert pause.medium_counters.fates["dropped_medium"] == 0


def test_an_outage_is_reported_with_its_end_and_what_it_struck() -> None:
    found = flight("at_s = 2\nfor_s = 1\nkill = ['netem']")
    assert kinds(found) == [(2.0, "netem_outage"), (3.0, "netem_outage"), (3.0, "reconnect")]
    (row,) = flown("at_s = 2\nfor_s = 1\nkill = ['netem']")["faults"]
    assert (row["kind"], row["process"]) == ("kill", "netem")
    assert (row["from_s"], row["to_s"], row["observations"]) == (2.0, 3.0, 2 * 20)
    assert (row["agents"], row["frames"], row["stopped_s"]) == (None, None, None)


spans = st.tuples(st.integers(1, 30), st.integers(1, 30), st.sampled_from(["kill", "pause"]))


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.lists(spans, min_size=1, max_size=4))
def test_netem_is_down_exactly_while_an_outage_is_in_force(outages: list) -> None:
    made = scenario(
        *(
            f"at_s = {at / 10}\nfor_s = {lasts / 10}\n{fault} = ['netem']"
            for at, lasts, fault in outages
        )
    )
    loop = SlotLoop(made, world_of(made, command_ticks=1))
    for tenth in range(80):
        for operation in loop.due():
            loop.apply(operation)
        down = any(at <= tenth < at + lasts for at, lasts, _ in outages)
        assert bool(loop.network.outages) == down, tenth
        for _ in range(8):
            opened = loop.open()
            assert not (down and opened.observations)
            loop.close(b"")
    expected = sum(1 for event in loop.events if event.kind == "reconnect")
    assert loop.judge.ticks > 0
    assert 1 <= expected <= len(outages)


def test_an_allocation_is_not_judged_while_netem_is_down() -> None:
    """A team that forms when the radio goes is frozen with places held twice, and not at fault."""
    for at_s in (0.4, 0.7, 1.0):
        found = flight(f"at_s = {at_s}\nkill = ['netem']", before="")
        for name, tally in found.loop.judge.invariants().items():
            assert not tally.violations, name


def test_a_killed_world_ends_the_run_inconclusive() -> None:
    made = parse(f"{SMALL}[[event]]\nat_s = 3\nkill = ['world']\n")
    found = fly(made)
    summary = summarise(made, finished(found, made))
    assert summary["duration_s"] == 3.0
    assert (summary["outcome"], summary["reason"]) == (
        "inconclusive",
        "the world was killed after 3.0 s",
    )
    assert kinds(found) == [(3.0, "world_outage")]


def test_a_pause_of_the_world_changes_nothing_in_virtual_time_and_is_left_out() -> None:
    event = "at_s = 3\nfor_s = 1\npause = ['world']"
    assert flight(event).loop.trace.sha256 == flight().loop.trace.sha256
    summary = flown(event)
    assert (summary["outcome"], summary["reason"]) == ("pass", None)
    (row,) = summary["faults"]
    assert (row["to_s"], row["stopped_s"]) == (3.0, None)
    assert fault_texts([row]) == [
        "pause of world, at 3 s: left out: virtual time has no process of the world to stop"
    ]


BAD = {
    "kill = ['netem', 1]": "event[0].kill[0]: 'netem' is no agent; allowed alone",
    "leave = ['netem']": "event[0].leave[0]: 'netem' is no agent",
    "resume = ['world']": "event[0].resume[0]: 'world' is no agent",
    "kill = ['netem', 'world']": "event[0].kill[0]: 'netem' is no agent",
    "sensor = { agents = ['netem'], mode = 'silent' }": "event[0].sensor.agents[0]: 'netem' is no",
    "pause = ['world']": "event[0].pause: 'world' needs for_s",
    "kill = ['world']\nfor_s = 2": "event[0].for_s: not with kill = ['world']",
    "kill = ['world']\nevery_s = 2": "event[0].every_s: not with kill = ['world']",
    "kill = ['router']": "event[0].kill[0]: got the text 'router'",
}


@pytest.mark.parametrize("event", BAD)
def test_what_cannot_be_struck_is_refused(event: str) -> None:
    with pytest.raises(Exception, match="event") as refused:
        parse(f"{SMALL}[[event]]\nat_s = 1\n{event}\n")
    assert BAD[event] in str(refused.value)
