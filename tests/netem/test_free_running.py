"""The free-running medium: which transmissions it takes, and how late its batches leave."""

import pytest

from netem.free_running import Intake, Lateness
from netem.link_parameters import Conditions
from netem.messages import MediumSetup
from netem.wire.frame import MAX_TRANSMISSION_B, Outgoing, Transmission, pack


def sent(slot: int, incarnation: int = 0) -> bytes:
    return pack(Transmission(slot, incarnation, (Outgoing(0, b"beacon"),)))


@pytest.fixture
def intake() -> Intake:
    return Intake(MediumSetup(1, 3, 4, 80.0, Conditions()))


def test_the_intake_takes_each_slot_of_a_sender_once(intake: Intake) -> None:
    assert intake.take(0, sent(8), 8) is not None
    assert intake.take(0, sent(8), 9) is None
    assert intake.take(1, sent(8), 9) is not None
    intake.incarnations = (1, 0, 0)
    assert intake.take(0, sent(8, incarnation=1), 9) is not None
    assert intake.rejected == {"repeated": 1}


def test_the_intake_rejects_transmissions_of_another_time(intake: Intake) -> None:
    assert intake.take(0, sent(4), 9) is None
    assert intake.take(0, sent(14), 9) is None
    assert intake.take(0, sent(5), 9) is not None
    assert intake.rejected == {"stale": 1, "ahead": 1}


def test_the_intake_counts_transmissions_that_do_not_decode(intake: Intake) -> None:
    assert intake.take(0, b"", 9) is None
    assert intake.take(0, b"\xc1" * 40, 9) is None
    assert intake.take(0, bytes(MAX_TRANSMISSION_B + 1), 9) is None
    assert intake.rejected == {"malformed": 2, "oversize": 1}


def test_batches_that_leave_before_they_are_due_are_not_late() -> None:
    lateness = Lateness(speed=1.0)
    assert lateness.summary() is None
    far_ahead_s, behind_s = 1e6, -1e6
    for due_s in (far_ahead_s, far_ahead_s, behind_s):
        lateness.record(due_s, newest_s=0.0, read_at=0.0)
    summary = lateness.summary()
    assert summary is not None
    assert summary[0] == 0.0
    assert summary[1] > 1e6
