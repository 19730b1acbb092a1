"""Jams, flaps and partitions by the timeline: what the medium is told, and what is told of it."""

from netem.messages import Flap, Flapped, Jam, Jammed, Parted
from tests.scenario.test_timeline import played, scenario
from worldsim.engine.virtual import fly
from worldsim.scenario.timeline import Flapping, Heal, Jamming, Partition

JAM = Jam((0.0, 0.0, 0.0), 2.0)


def test_a_jam_ends_by_its_number() -> None:
    came = played(
        "at_s = 1\nfor_s = 2\njam = { centre_m = [0, 0, 0], radius_m = 2 }", "at_s = 2\nkill = [0]"
    )
    assert [each for each in came if isinstance(each[1], Jamming)] == [
        (1.0, Jamming(0, JAM)),
        (3.0, Jamming(0, None)),
    ]
    assert Jamming(0, JAM).order == Jammed(0, JAM)


def test_a_flap_counts_its_periods_from_its_own_time() -> None:
    came = played("at_s = 1.5\nfor_s = 2\nflap = { period_s = 0.5, links = [[0, 1]] }")
    flap = Flap(0.5, 1.5, ((0, 1),))
    assert came == [(1.5, Flapping(0, flap)), (3.5, Flapping(0, None))]
    assert Flapping(0, flap).order == Flapped(0, flap)


def test_a_partition_has_its_kind() -> None:
    bridge = "partition = { kind = 'bridge', groups = [[0], [1, 2]], bridge = [3] }"
    (_, parted), (_, healed) = played(f"at_s = 1\nfor_s = 2\n{bridge}")
    assert isinstance(parted, Partition)
    assert parted.order == Parted(((0,), (1, 2)), "bridge", (3,))
    assert healed == Heal()


def dropped(*events: str, radio: str = "") -> int:
    return fly(scenario(*events, radio=radio)).medium_counters.fates["dropped_partition"]


def test_what_is_jammed_or_down_is_counted_as_partition_and_told() -> None:
    flight = fly(scenario("at_s = 1\nfor_s = 2\njam = { centre_m = [0, 0, 0], radius_m = 50 }"))
    jams = [event for event in flight.loop.events if event["kind"] == "jam"]
    assert [event["jam"] for event in jams] == [
        {"centre_m": (0.0, 0.0, 0.0), "radius_m": 50.0},
        None,
    ]
    beacons = 2 * 20 * 4 * 3
    assert beacons <= flight.medium_counters.fates["dropped_partition"] <= 1.2 * beacons
    down = dropped("at_s = 1\nfor_s = 2\nflap = { period_s = 1 }")
    assert 0.4 * beacons <= down <= 0.7 * beacons


def test_a_turned_bit_is_rejected_and_counted_and_the_team_converges() -> None:
    flight = fly(scenario(radio="corrupt_percent = 30\nduplicate_percent = 10"))
    told = flight.medium_counters
    assert told.corrupted > 0.25 * told.fates["delivered"]
    assert told.corrupted <= flight.rejected <= told.corrupted + told.duplicated
    assert flight.loop.judge.phases[-1].converge_s is not None
    assert flight.loop.judge.invariants()["I8"]["violations"] == 0
