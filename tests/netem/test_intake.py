"""The medium's intake: any bytes may arrive, and each refusal has a cause."""

from collections import Counter
from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st

from netem.free_running import Intake
from netem.link_parameters import Conditions
from netem.messages import MediumSetup
from netem.wire.channels import MAX_PAYLOAD_B
from netem.wire.frame import MAX_OUTGOING, MAX_TRANSMISSION_B, Outgoing, Transmission, pack

CAUSES = {"oversize", "malformed", "incarnation", "ahead", "stale", "repeated"}


def new_intake():
    return Intake(MediumSetup(1, 3, 4, 80.0, Conditions()))


@settings(derandomize=True, deadline=None, max_examples=300)
@given(st.lists(st.tuples(st.integers(0, 2), st.binary(max_size=60)), max_size=20))
def test_junk_is_refused_and_counted(junk):
    intake = new_intake()
    taken = [intake.take(sender, data, 40) for sender, data in junk]
    assert sum(each is None for each in taken) == intake.rejected.total()
    assert set(intake.rejected) <= CAUSES


def test_mutated_transmissions_are_refused_or_keep_every_limit():
    random, refused = Random(5), Counter()
    for slot in range(5_000):
        frames = tuple(Outgoing(at % 2, random.randbytes(30)) for at in range(3))
        data = bytearray(pack(Transmission(slot, 0, frames)))
        for _ in range(random.randrange(3)):
            data[random.randrange(len(data))] = random.randrange(256)
        intake = new_intake()
        taken = intake.take(slot % 3, bytes(data), slot)
        refused.update(intake.rejected)
        if taken is not None:
            assert slot - 4 <= taken.slot <= slot
            assert all(each.channel in (0, 1) for each in taken.frames)
            assert all(len(each.payload) <= MAX_PAYLOAD_B for each in taken.frames)
    assert 500 < refused.total() < 4_500
    assert {"malformed", "ahead", "stale"} <= set(refused) <= CAUSES


def test_a_transmission_ahead_of_the_truth_waits_for_it():
    intake, early = new_intake(), Transmission(42, 0, ())
    assert intake.take(0, pack(early), 40) is None
    assert intake.due(0, 41) is None
    assert intake.due(0, 42) == early
    assert intake.due(0, 43) is None
    assert intake.take(0, pack(early), 43) is None
    assert intake.rejected == {"repeated": 1}


def test_at_most_one_transmission_waits_and_none_is_a_tick_ahead():
    intake = new_intake()
    assert intake.take(0, pack(Transmission(45, 0, ())), 40) is None
    assert intake.rejected == {"ahead": 1}
    for slot in (41, 44):
        assert intake.take(1, pack(Transmission(slot, 0, ())), 40) is None
    assert intake.rejected == {"ahead": 2}
    assert intake.due(1, 44) == Transmission(41, 0, ())


def test_only_an_agents_present_incarnation_is_accepted():
    intake = new_intake()
    intake.incarnations = (0, 3, 0)
    for other in (2, 4, 2**52):
        assert intake.take(1, pack(Transmission(40, other, ())), 40) is None
    assert intake.rejected == {"incarnation": 3}
    assert intake.take(1, pack(Transmission(40, 3, ())), 40) is not None


def test_sizes_are_checked_before_decoding():
    intake = new_intake()
    assert intake.take(0, bytes(MAX_TRANSMISSION_B + 1), 40) is None
    assert intake.rejected == {"oversize": 1}
    many = Transmission(40, 0, (Outgoing(0, b""),) * (MAX_OUTGOING + 1))
    large = Transmission(40, 0, (Outgoing(0, bytes(MAX_PAYLOAD_B + 1)),))
    for message in (many, large):
        assert intake.take(0, pack(message), 40) is None
    assert intake.rejected == {"oversize": 1, "malformed": 2}
    intake.incarnations = (2**53 - 1,) * 3
    greatest = Transmission(40, 2**53 - 1, (Outgoing(1, bytes(MAX_PAYLOAD_B)),) * MAX_OUTGOING)
    assert intake.take(0, pack(greatest), 40) == greatest
