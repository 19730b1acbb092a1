"""What the process shells decide by themselves, without a process."""

import os
from pathlib import Path

import pytest

from agent.messages import Command, Telemetry
from netem.free_running import Intake, Lateness
from netem.link_keys import Conditions
from netem.messages import MediumSetup
from netem.wire.bus import RefusedError
from netem.wire.frame import MAX_TRANSMISSION_B, Outgoing, Transmission, pack
from worldsim.fleet import startup
from worldsim.fleet.ipc import MessageSocket
from worldsim.fleet.launcher_link import ByHand, Conducted, Loss
from worldsim.fleet.pacing import Pacer, Punctuality
from worldsim.fleet.process_table import ProcessTable, processes
from worldsim.fleet.startup import StartupError, assemble, shortened
from worldsim.results.run_folder import RunDirectoryError


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def sent(slot: int, incarnation: int = 0) -> bytes:
    return pack(Transmission(slot, incarnation, (Outgoing(0, b"beacon"),)))


def command(slot: int) -> Command:
    still = (0.0, 0.0, 0.0)
    return Command(
        slot,
        0,
        slot + 8,
        still,
        0.0,
        (0.0, 0.0),
        Telemetry(still, 0.0, None, None, (), (), 0, -1, -1, 0),
    )


@pytest.fixture
def intake() -> Intake:
    return Intake(MediumSetup(1, 3, 4, 80.0, Conditions()))


def test_the_pacer_absorbs_less_than_a_slot_and_slips_beyond() -> None:
    clock = Clock()
    pacer = Pacer(0.0125, clock)
    pacer.start()
    assert pacer.left_s(4) == pytest.approx(0.05)
    clock.now_s += 0.06
    pacer.begin(4)  # 0.01 s late: kept up with
    assert pacer.left_s(5) == pytest.approx(0.0025)
    clock.now_s += 1.0
    pacer.begin(5)  # a stall of a second: nothing is caught up
    assert pacer.left_s(6) == pytest.approx(0.0125)
    assert pacer.elapsed_s == pytest.approx(1.06)


def test_a_tick_is_late_when_its_command_is_not_there_at_the_next_slot() -> None:
    punctuality = Punctuality(2)
    assert punctuality.late_fraction is None
    punctuality.ask(0, 0, None)
    punctuality.ask(0, 4, command(0))
    assert punctuality.late_fraction == 0.0
    punctuality.ask(0, 8, command(0))
    assert punctuality.late_fraction == 0.5
    punctuality.ask(1, 1, None)
    punctuality.ask(1, 5, None)
    assert punctuality.late_fraction == pytest.approx(2 / 3)
    punctuality.forget([1])  # its process ended: nothing is late of what it was asked last
    punctuality.ask(1, 80, None)
    assert punctuality.late_fraction == pytest.approx(2 / 3)


def test_the_intake_takes_each_slot_of_a_sender_once(intake: Intake) -> None:
    assert intake.take(0, sent(8), 8) is not None
    assert intake.take(0, sent(8), 9) is None
    assert intake.take(1, sent(8), 9) is not None
    intake.incarnations = (1, 0, 0)
    assert intake.take(0, sent(8, incarnation=1), 9) is not None
    assert intake.rejected == {"repeated": 1}


def test_the_intake_refuses_what_is_not_of_now(intake: Intake) -> None:
    assert intake.take(0, sent(4), 9) is None
    assert intake.take(0, sent(14), 9) is None
    assert intake.take(0, sent(5), 9) is not None
    assert intake.rejected == {"stale": 1, "ahead": 1}


def test_the_intake_counts_what_cannot_be_read(intake: Intake) -> None:
    assert intake.take(0, b"", 9) is None
    assert intake.take(0, b"\xc1" * 40, 9) is None
    assert intake.take(0, bytes(MAX_TRANSMISSION_B + 1), 9) is None
    assert intake.rejected == {"malformed": 2, "oversize": 1}


def test_batches_that_leave_before_they_are_due_are_not_late() -> None:
    lateness = Lateness(speed=1.0)
    assert lateness.summary() is None
    far_ahead_s, behind_s = 1e6, -1e6
    for due_s in (far_ahead_s, far_ahead_s, behind_s):
        lateness.note(due_s, newest_s=0.0, read_at=0.0)
    summary = lateness.summary()
    assert summary is not None
    assert summary[0] == 0.0
    assert summary[1] > 1e6


def test_lines_cross_whole_and_in_order_until_an_end_closes() -> None:
    near, far = MessageSocket.pair()
    assert far.receive() == []
    near.send(spawn=1)
    near.offer(progress={"time_s": 0.5})
    assert far.receive() == [{"spawn": 1}, {"progress": {"time_s": 0.5}}]
    near.send(last=True)
    near.close()
    assert far.receive() == [{"last": True}]
    assert far.closed
    far.send(nobody="hears")
    far.close()


def test_an_offer_to_an_end_that_does_not_read_does_not_wait() -> None:
    near, far = MessageSocket.pair()
    for count in range(20_000):
        near.offer(count=count)
    assert 0 < len(far.receive()) < 20_000
    near.close()
    far.close()


def test_a_roster_tells_the_living_from_those_whose_pid_came_back(tmp_path: Path) -> None:
    table = ProcessTable(tmp_path, "mine", "tcp/127.0.0.1:7447")
    table.add("self", os.getpid())
    table.write()
    assert processes(tmp_path) == [("self", os.getpid(), True)]
    file = tmp_path / "fleet.json"
    file.write_text(file.read_text().replace('"started": ', '"started": 1'))
    assert processes(tmp_path) == [("self", os.getpid(), False)]


def test_a_folder_without_a_fleet_is_named(tmp_path: Path) -> None:
    with pytest.raises(RunDirectoryError, match=r"no fleet\.json in it"):
        processes(tmp_path)
    (tmp_path / "fleet.json").write_text("{}")
    with pytest.raises(RunDirectoryError, match="cannot be read"):
        processes(tmp_path)


def test_long_lists_of_names_are_shortened() -> None:
    names = [f"agent-{agent}" for agent in range(9)]
    assert shortened(names[:5]) == names[:5]
    assert shortened(names) == [*names[:5], "4 more"]


class SparseStartup:
    """A start-up to which some never come, or whose medium refuses."""

    def __init__(self, missing: list[str], refusal: str | None = None) -> None:
        self._missing = missing
        self._refusal = refusal

    def instruct_medium(self, speed: float) -> bool:
        if self._refusal is not None:
            raise RefusedError(self._refusal)
        return True

    def instruct_agents(self) -> None:
        """Nobody asks."""

    def missing(self) -> list[str]:
        return self._missing


def test_a_start_up_ends_when_all_are_there_or_nobody_wants_it() -> None:
    launcher = ByHand(list)
    assert assemble(SparseStartup([]), 1.0, lambda: False, launcher)
    assert not assemble(SparseStartup(["agent-1"]), 1.0, lambda: True, launcher)


def test_a_start_up_says_who_did_not_come(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(startup, "STARTUP_WITHIN_S", 0.05)
    with pytest.raises(StartupError, match=r"not there within 0\.05 s: agent-1"):
        assemble(SparseStartup(["agent-1"]), 1.0, lambda: False, ByHand(list))


def test_a_start_up_says_why_the_medium_refuses() -> None:
    with pytest.raises(StartupError, match="netem refuses: serves another"):
        assemble(SparseStartup([], "serves another"), 1.0, lambda: False, ByHand(list))


def test_by_hand_the_death_of_the_medium_is_nobody_elses() -> None:
    news = [["agent-2"], ["agent-0", "netem", "agent-1"]]
    launcher = ByHand(lambda: news.pop(0))
    assert launcher.losses() == [Loss(2)]
    assert launcher.stopped is None
    assert launcher.losses() == []
    assert launcher.stopped == "netem is gone"


def test_by_hand_no_process_is_touched() -> None:
    with pytest.raises(LookupError, match="started by hand"):
        ByHand(list).act("kill", [(2, 0)])


def test_under_a_launcher_losses_come_by_lines_and_its_end_is_the_end() -> None:
    near, far = MessageSocket.pair()
    launcher = Conducted(far)
    near.send(done="kill", whom=[[3, 1]])
    near.send(lost=[3, 1, 9, None])
    launcher.wait(5.0)
    assert launcher.losses() == [Loss(3, incarnation=1, signal=9)]
    launcher.act("pause", [(2, 0)])
    launcher.act("resume", [])
    assert near.receive() == [{"do": "pause", "whom": [[2, 0]], "after_s": 0.0}]
    assert launcher.stopped is None
    near.close()
    launcher.wait(5.0)
    assert launcher.losses() == []
    assert launcher.stopped == "the launcher is gone"
    far.close()
