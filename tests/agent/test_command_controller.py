"""A program as a controller: whether time waits for it, and what becomes of one that is silent."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import pytest

from agent import command_controller
from agent.checked_controller import CheckedController
from agent.config import AgentSetup
from agent.controller import FailedProgramError, Senses
from tests.small_scenario import SMALL
from worldsim.scenario.file import parse

ECHO = "read setup; while read senses; do echo '{\"velocity\":[1,0,0]}'; done"
DEAF = "exec sleep 60"
MUTE = "read setup; read senses; echo '{\"velocity\":[1,0,0]}'; exec sleep 60"
TICK_S = 0.05


@dataclass
class Asked:
    """A controller that is asked tick by tick."""

    controller: CheckedController

    def at(self, now_s: float) -> float:
        """Return the speed along x that is wanted at a time."""
        senses = Senses(
            now_s=now_s,
            position=(0.0, 0.0, 0.0),
            velocity=(0.0, 0.0, 0.0),
            yaw=0.0,
            vehicles=(),
            neighbours=(),
            team=tuple,
            mission=None,
        )
        return self.controller.decide(senses).velocity[0]


def program(script: str, *, real_time: bool) -> Asked:
    scenario = parse(SMALL, overrides={"control.command": json.dumps(["sh", "-c", script])})
    setup: AgentSetup = msgspec.structs.replace(
        scenario.agent_setup(0, 0, 1), real_time=real_time, tick_hz=1.0 / TICK_S
    )
    return Asked(CheckedController(setup))


def test_where_time_waits_each_answer_is_awaited() -> None:
    slow = ECHO.replace("do echo", "do sleep 0.1; echo")
    assert program(slow, real_time=False).at(0.0) == 1.0


def test_in_real_time_a_late_answer_stops_the_vehicle(capsys: pytest.CaptureFixture[str]) -> None:
    asked = program(DEAF, real_time=True)
    assert [asked.at(TICK_S * tick) for tick in range(10)] == [0.0] * 10
    said = capsys.readouterr().err.splitlines()
    assert said == [
        "0.00 s: no answer in time, 1 so far",
        "0.45 s: no answer in time, 10 so far",
    ]


@pytest.mark.parametrize("script", [DEAF, MUTE])
def test_one_that_stays_silent_in_real_time_fails(script: str) -> None:
    asked = program(script, real_time=True)
    with pytest.raises(FailedProgramError) as failed:
        for second in range(99):  # a busy host may start the child late
            asked.at(float(second))
    assert str(failed.value).startswith("controller 'sh' of agent 0 failed at ")
    assert "NoAnswerError" not in str(failed.value)
    assert "no answer since" in str(failed.value)


class AlwaysLate:
    """A child each of whose answers comes, but after its tick."""

    def __init__(self, command: Sequence[str]) -> None:
        self.answered = 0

    def tell(self, line: bytes, within_s: float) -> None:
        """Take the setup."""

    def ask(self, line: bytes, within_s: float) -> None:
        """Drop the answer to the line before."""
        self.answered += 1


def test_one_that_is_always_late_does_not_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command_controller, "Child", AlwaysLate)
    asked = program(ECHO, real_time=True)
    assert [asked.at(float(second)) for second in range(20)] == [0.0] * 20


def test_a_program_that_fails_has_no_trace_of_python() -> None:
    with pytest.raises(FailedProgramError) as failed:
        program("read setup; read senses; echo; read more", real_time=False).at(0.0)
    assert failed.value.__cause__ is None
    assert str(failed.value).endswith("failed at 0 s: an empty line instead of an intent")
