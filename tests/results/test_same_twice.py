"""Whether a run is the same twice: where two traces part, and what stays on the disk."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.small_scenario import SMALL
from worldsim.engine.trace import TraceLog
from worldsim.engine.virtual import fly
from worldsim.results.run_folder import RunWriteError
from worldsim.results.same_twice import AGAIN, Verified, verify_twice
from worldsim.results.trace_file import TRACE_FILE, write_trace
from worldsim.scenario.file import parse

SCENARIO = parse(SMALL, overrides={"duration_s": "0.1"})


@pytest.fixture(scope="module")
def flown() -> TraceLog:
    log = TraceLog()
    fly(SCENARIO, log=log)
    return log


def copy_of(log: TraceLog) -> TraceLog:
    copy = TraceLog()
    copy.poses = [list(each) for each in log.poses]
    copy.commands = [dict(each) for each in log.commands]
    copy.verdicts = list(log.verdicts)
    return copy


def verified(folder: Path, first: TraceLog, second: TraceLog, status: int = 0) -> Verified:
    def again(into: Path) -> int:
        into.mkdir()
        write_trace(second, into)
        return 0

    write_trace(first, folder)
    return verify_twice(SCENARIO, folder, status, again)


def test_a_log_holds_every_slot_agent_and_command(flown: TraceLog) -> None:
    assert len(flown.poses) == len(flown.commands) == len(flown.verdicts) == 8
    assert [len(each) for each in flown.poses] == [2] * 8
    assert [list(each) for each in flown.commands] == [[0], [1], [], []] * 2
    assert len({each[0] for each in flown.poses}) > 1  # it moves
    assert all(one != other for one, other in flown.poses)


def test_equal_traces_leave_nothing(tmp_path: Path, flown: TraceLog) -> None:
    found = verified(tmp_path, flown, copy_of(flown), status=1)
    assert found == (1, "the same twice: poses, commands and verdicts of 8 slots")
    assert list(tmp_path.iterdir()) == []


def change_pose(log: TraceLog) -> None:
    log.poses[6][1] += 1
    log.verdicts[7] += 1


def change_command(log: TraceLog) -> None:
    log.commands[5][1] += 1


def change_verdict(log: TraceLog) -> None:
    log.verdicts[4] += 1


def drop_command(log: TraceLog) -> None:
    del log.commands[4][0]


def end_early(log: TraceLog) -> None:
    del log.poses[7], log.commands[7], log.verdicts[7]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (change_pose, "tick 1 (0.075 s): the pose of agent 1"),
        (change_command, "tick 1 (0.0625 s): the command of agent 1"),
        (change_verdict, "tick 1 (0.05 s): the radio's verdicts"),
        (drop_command, "tick 1 (0.05 s): the command of agent 0"),
        (end_early, "tick 1 (0.0875 s): the second run has ended"),
    ],
)
def test_traces_part_at_the_first_difference(
    tmp_path: Path, flown: TraceLog, change: Callable[[TraceLog], None], says: str
) -> None:
    other = copy_of(flown)
    change(other)
    status, text = verified(tmp_path, flown, other)
    assert status == 1
    assert text.startswith(f"NOT the same twice: they part at {says}")
    assert (tmp_path / TRACE_FILE).exists()
    assert (tmp_path / AGAIN / TRACE_FILE).exists()


def test_a_run_that_did_not_end_is_not_flown_again(tmp_path: Path) -> None:
    def again(_: Path) -> int:
        raise AssertionError

    assert verify_twice(SCENARIO, tmp_path, 130, again).status == 130


def test_a_second_run_that_is_interrupted_verifies_nothing(tmp_path: Path) -> None:
    assert verify_twice(SCENARIO, tmp_path, 0, lambda _: 130).status == 130


def test_a_run_without_a_trace_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RunWriteError, match="no trace to compare"):
        verify_twice(SCENARIO, tmp_path, 0, lambda _: 0)
