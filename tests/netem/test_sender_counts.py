"""What netem counts of each agent: transmissions that it takes or refuses, and checked frames."""

from msgspec.structs import replace

from netem.free_running import Intake
from netem.link_parameters import Conditions
from netem.medium import Medium
from netem.messages import MediumSetup, Resumption
from netem.sender_counts import CheckedFrames, SenderRow
from netem.wire.frame import Outgoing, Transmission, pack
from tests.netem.test_resumption import SETUP, fly


def test_each_refusal_is_counted_for_the_agent_whose_key_it_came_by() -> None:
    intake = Intake(MediumSetup(1, 3, 4, 80.0, Conditions()))
    intake.take(0, pack(Transmission(40, 0, ())), 40)
    intake.take(2, b"junk", 40)
    intake.take(2, pack(Transmission(400, 0, ())), 40)
    intake.take(2, pack(Transmission(4, 0, ())), 40)
    rows = (SenderRow(0, 1, {}), SenderRow(2, 0, {"malformed": 1, "ahead": 1, "stale": 1}))
    assert intake.senders.rows() == rows
    assert intake.rejected == rows[1].rejected

    medium = Medium(SETUP)
    fly(medium, range(4))
    counters = replace(medium.counters(4), transmissions=rows, rejected=rows[1].rejected)
    resumed = Intake(replace(SETUP, resumes=Resumption(4, (), counters)))
    resumed.take(0, pack(Transmission(41, 0, ())), 41)
    assert resumed.senders.rows() == (SenderRow(0, 2, {}), rows[1])


class OnlyShort:
    """Takes short frames of agent 2."""

    def watches(self, agent: int) -> bool:
        return agent == 2

    def refusal(self, sender: int, frame: Outgoing, sent_s: float) -> str | None:
        assert (sender, sent_s) == (2, 0.5)
        return "long" if len(frame.payload) > 3 else None


def test_frames_of_watched_agents_are_counted() -> None:
    frames = (Outgoing(0, b"abc"), Outgoing(1, b"abcd"), Outgoing(1, b"abcde"))
    checked = CheckedFrames(OnlyShort())
    checked.note(2, frames, 0.5)
    checked.note(1, frames, 0.5)
    assert checked.rows() == (SenderRow(2, 1, {"long": 2}),)
    CheckedFrames(None).note(2, frames, 0.5)
