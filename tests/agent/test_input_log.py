"""The log of an agent's inputs comes back as it was written, cut off or not."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from agent.codec import encode
from agent.core import Agent
from agent.input_log import InputLog, InputLogError, StepInputs, log_path, logged_lives
from agent.messages import Command
from netem.wire.frame import Frame
from tests.agent.test_core import AGENT_SETUP, observation

FRAMES = (Frame(1, 0, 0, 7, b"\x92\x00"), Frame(2, 0, 1, 8, b""))


def written(folder: Path, steps: int = 3) -> list[StepInputs]:
    log = InputLog(folder, AGENT_SETUP)
    kept = []
    for tick in range(steps):
        heard = FRAMES[: tick % 3]
        log.hear(heard)
        log.step(observation(tick))
        kept.append(StepInputs(heard, observation(tick)))
    log.close()
    return kept


def test_it_comes_back_as_it_was_written(tmp_path: Path) -> None:
    kept = written(tmp_path)
    InputLog(tmp_path, replace(AGENT_SETUP, incarnation=1)).close()
    first, second = logged_lives(tmp_path, 0)
    assert first.setup == AGENT_SETUP
    assert (first.steps, first.cut) == (kept, False)
    assert (second.setup.incarnation, second.steps) == (1, [])
    assert logged_lives(tmp_path, 5) == []


def test_a_step_comes_back_with_what_the_agent_answered(tmp_path: Path) -> None:
    log, agent = InputLog(tmp_path, AGENT_SETUP), Agent(AGENT_SETUP)
    answers: list[Command | None] = []
    for tick in range(3):
        log.step(observation(tick))
        answers.append(agent.step(observation(tick)).command if tick != 1 else None)
        if answers[-1] is not None:
            log.answer(encode(answers[-1]))
    log.close()
    (life,) = logged_lives(tmp_path, 0)
    assert [step.command for step in life.steps] == answers
    assert [step.observation.slot for step in life.steps] == [observation(k).slot for k in range(3)]


def test_what_a_killed_process_left_is_read_to_its_last_whole_step(tmp_path: Path) -> None:
    kept = written(tmp_path)
    file = log_path(tmp_path, 0, 0)
    whole = file.read_bytes()
    for cut in (1, 20):
        file.write_bytes(whole[:-cut])
        (life,) = logged_lives(tmp_path, 0)
        assert (life.steps, life.cut) == (kept[:-1], True)


@pytest.mark.parametrize(
    "content", [b"", b"\xc1", b"\xa5hello", b"\xc4\x02{}", b"\x93\x01\x02\x03"]
)
def test_a_file_that_is_none_is_named(tmp_path: Path, content: bytes) -> None:
    file = log_path(tmp_path, 0, 0)
    file.write_bytes(content)
    with pytest.raises(InputLogError, match=r"agent-0\.0\.msgpack: no log of inputs"):
        logged_lives(tmp_path, 0)


def test_a_full_disk_ends_the_log_and_not_the_agent(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "full"
    folder.mkdir()
    log = InputLog(folder, AGENT_SETUP)
    log.close()
    log._file = Path("/dev/full").open("wb", buffering=0)  # noqa: SIM115
    for tick in range(3):
        log.step(observation(tick))
    assert capsys.readouterr().err.count("the log of inputs ends here: No space left") == 1
