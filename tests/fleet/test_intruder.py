"""The intruder: what it puts is rejected by everybody, counted, and never of the present."""

from random import Random

import pytest

from agent.codec import decode_command
from agent.rejection import RejectedError
from netem.free_running import Intake
from netem.link_parameters import Conditions
from netem.messages import MediumSetup
from netem.wire.access import MAX_AGENT_PUT_B
from worldsim.fleet.intruder import COUNTED, MAKERS, Flood, IntruderCounts, mixed
from worldsim.scenario.faults import Intruder

SLOTS = (400, 2000, 8000)


def test_it_knows_each_topic_that_an_agent_may_put() -> None:
    assert MAKERS.keys() == MAX_AGENT_PUT_B.keys()


@pytest.mark.parametrize("slot", SLOTS)
@pytest.mark.parametrize("incarnation", [0, 3])
def test_the_medium_takes_none_of_its_transmissions(slot: int, incarnation: int) -> None:
    intake = Intake(MediumSetup(1, 2, 4, 80.0, Conditions()))
    intake.incarnations = (incarnation, incarnation)
    messages = mixed(MAKERS["tx"], Random(1))
    assert all(intake.take(1, data, slot) is None for data in messages)
    assert intake.due(1, slot) is None
    assert sum(intake.rejected.values()) == len(messages)


@pytest.mark.parametrize("slot", SLOTS)
def test_none_of_its_commands_is_for_the_present(slot: int) -> None:
    taken = 0
    for data in mixed(MAKERS["command"], Random(1)):
        try:
            command = decode_command(data)
        except RejectedError:
            continue
        taken += 1
        assert command.incarnation > 10 or abs(command.slot - slot) > 100
    assert taken > 100


def test_it_puts_at_its_rate_on_every_key_and_counts() -> None:
    counts, put = IntruderCounts(), ([], [])  # type: ignore[var-annotated]
    flood = Flood([(each.append, (b"a", b"b")) for each in put], counts.row(3))
    for due in (2, 2, 5):
        flood.catch_up(due)
    assert put == ([b"a", b"b", b"a", b"b", b"a"],) * 2
    assert (counts.read(3), counts.read(4), counts.read(COUNTED)) == (10, 0, None)
    uncounted = Flood([(put[0].append, (b"a",))], counts.row(COUNTED))
    uncounted.catch_up(1)


def test_its_rate_is_lower_where_it_has_no_password() -> None:
    assert Intruder(agents=(1,)).rate == 10_000
    assert Intruder().rate == 200
    assert Intruder(per_s=7.0).rate == 7
