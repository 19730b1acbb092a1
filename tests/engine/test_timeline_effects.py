"""Events of the timeline in virtual time: their operations, their effects and their reports."""

from msgspec.structs import replace

from netem.faults import FaultOrder, Flap, Jam, Partition, RadioEvent
from tests.scenario.test_timeline import LINE, scenario
from worldsim.engine.operations import GiveMission, Operation
from worldsim.engine.step import SlotLoop, world_of
from worldsim.engine.virtual import Flight, fly
from worldsim.judge.radio_events import Flapped, Healed, Jammed
from worldsim.judge.run_events import RunEvent, as_row
from worldsim.scenario.tables import Scenario

JAM = "jam = { centre_m = [0, 0, 0], radius_m = 50 }"


def carried_out(*events: str) -> list[tuple[float, Operation]]:
    """Return the operations of the first 10 s, each with its time [s]."""
    flown = scenario(*events)
    loop = SlotLoop(flown, world_of(flown, command_ticks=1))
    found = []
    while loop.world.time_s < 10.0:
        for operation in loop.due():
            loop.apply(operation)
            found.append((loop.world.time_s, operation))
        loop.open()
        loop.close(b"")
    return found


def short(*events: str, radio: str = "") -> Scenario:
    """Return a scenario of 10 s: all that happens here happens within 8 s."""
    return replace(scenario(*events, radio=radio), duration_s=10.0)


def of_kind(flight: Flight, kind: type[RunEvent]) -> list[RunEvent]:
    return [event for event in flight.loop.events if isinstance(event, kind)]


def test_a_radio_fault_begins_and_ends_by_its_number() -> None:
    jam = Jam((0.0, 0.0, 0.0), 50.0)
    assert carried_out(f"at_s = 1\nfor_s = 2\n{JAM}") == [
        (1.0, FaultOrder(0, 1.0, RadioEvent(jam=jam))),
        (3.0, FaultOrder(0, 3.0)),
    ]
    flap = RadioEvent(flap=Flap(0.5, ((0, 1),)))
    assert carried_out("at_s = 1.5\nfor_s = 2\nflap = { period_s = 0.5, links = [[0, 1]] }") == [
        (1.5, FaultOrder(0, 1.5, flap)),
        (3.5, FaultOrder(0, 3.5)),
    ]


def test_a_partition_that_was_healed_does_not_end_again() -> None:
    first, second = "at_s = 1\nfor_s = 5\npartition = [[0]]", "at_s = 2\nheal = true"
    operations = carried_out(first, second)
    assert operations == [
        (1.0, FaultOrder(0, 1.0, RadioEvent(partition=Partition(((0,),))))),
        (2.0, FaultOrder(1, 2.0, RadioEvent(heal=True))),
    ]


def test_two_partitions_end_independently() -> None:
    flight = fly(
        short("at_s = 1\nfor_s = 6\npartition = [[0, 1]]", "at_s = 2\nfor_s = 2\npartition = [[0]]")
    )
    healed = [as_row(event) for event in of_kind(flight, Healed)]
    assert [(row["t_s"], row["number"]) for row in healed] == [(4.0, 1), (7.0, 0)]


def test_a_mission_keeps_the_part_that_it_does_not_change() -> None:
    other = LINE.replace("'line'", "'other'")
    missions = [
        (operation.kind, operation.formation.name, operation.path.waypoints, operation.path.yaw)
        for _, operation in carried_out(
            "at_s = 1\nframe = { yaw_deg = 90 }",
            f"at_s = 2\nformation = {other}",
            "at_s = 3\nframe = { waypoints_m = [[1, 2, 3]] }",
        )
        if isinstance(operation, GiveMission)
    ]
    quarter = 1.5707963267948966
    assert missions == [
        ("frame", "line", ((0.0, 0.0, 0.0),), quarter),
        ("formation", "other", ((0.0, 0.0, 0.0),), quarter),
        ("frame", "other", ((1.0, 2.0, 3.0),), quarter),
    ]


def dropped(*events: str, radio: str = "") -> int:
    return fly(short(*events, radio=radio)).medium_counters.fates["dropped_partition"]


def test_jammed_and_cut_frames_count_as_dropped_by_partition() -> None:
    flight = fly(short(f"at_s = 1\nfor_s = 2\n{JAM}"))
    jams = [event.jam for event in flight.loop.events if isinstance(event, Jammed)]
    assert jams == [Jam((0.0, 0.0, 0.0), 50.0), None]
    beacons = 2 * 20 * 4 * 3
    assert beacons <= flight.medium_counters.fates["dropped_partition"] <= 1.2 * beacons
    down = dropped("at_s = 1\nfor_s = 2\nflap = { period_s = 1 }")
    assert 0.4 * beacons <= down <= 0.7 * beacons


def test_a_flap_reports_its_own_start() -> None:
    flight = fly(short("at_s = 1.003\nfor_s = 2\nflap = { period_s = 1 }"))
    begun, ended = of_kind(flight, Flapped)
    assert as_row(begun)["flap"] == {"period_s": 1.0, "links": (), "from_s": 1.003}
    assert (begun.t_s, as_row(ended)["flap"]) == (1.0125, None)


def test_corrupt_frames_are_rejected_and_counted_and_the_team_converges() -> None:
    flight = fly(short(radio="corrupt_percent = 30\nduplicate_percent = 10"))
    counters = flight.medium_counters
    assert counters.corrupted > 0.25 * counters.fates["delivered"]
    assert counters.corrupted <= flight.rejected <= counters.corrupted + counters.duplicated
    assert flight.loop.judge.phases[-1].converge_s is not None
    assert flight.loop.judge.invariants()["I8"].violations == 0
