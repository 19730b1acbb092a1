"""A replay asks one agent's controller again with what it had: the same intents, and pdb in it."""

import io
import json
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

from agent.codec import encode
from agent.controller import Intent, Senses
from agent.core import Agent
from agent.input_log import InputLog
from agent.messages import Command
from agent.setup import AgentSetup
from tests.small_scenario import SMALL
from worldsim.commands.app import command
from worldsim.engine.virtual import VirtualFleet
from worldsim.replay.flown_again import flown_again
from worldsim.replay.inputs import LifeRecorder
from worldsim.replay.steps import Span, steps
from worldsim.results.flown_code import keep_code
from worldsim.scenario.file import load, parse

LOSSY = {"netem.loss_percent": "30", "duration_s": "2"}
KILLED = f"{SMALL}\n[[event]]\nat_s = 0.6\nkill = [1]\n[[event]]\nat_s = 1.0\nrestart = [1]\n"
HOVER = Intent((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, (0.0, 0.0, 0.0))


class Forgetful:
    """Fails once it has been asked for a second; it counts, to show that memory is replayed."""

    services = ()

    def __init__(self, setup: AgentSetup) -> None:
        self._asked = 0

    def decide(self, senses: Senses) -> Intent:
        self._asked += 1
        if senses.now_s >= 1.5:
            raise ZeroDivisionError("the count is in the way")
        return replace(HOVER, signals={"asked": self._asked})


def test_an_agent_decides_again_what_it_decided(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = parse(SMALL, overrides=LOSSY)
    tap = LifeRecorder(1)
    fleet = VirtualFleet(scenario, tap=tap)
    commanded: list[Command] = []
    taken = fleet.loop.apply_command

    def note(agent: int, command: Command, encoded: bytes) -> None:
        if agent == 1:
            commanded.append(command)
        taken(agent, command, encoded)

    monkeypatch.setattr(fleet.loop, "apply_command", note)
    while fleet.loop.world.slot < scenario.slots:
        fleet.slot()
    again = flown_again(scenario, 1)
    assert again.trace_sha256 == fleet.loop.trace.sha256
    assert again.lives == tap.lives
    told = list(steps(again.lives, Span(0, 9)))
    assert [each.velocity for each in told] == [each.velocity for each in commanded]
    assert len(told) == 40
    assert any(step.senses.neighbours for step in told)


def test_each_process_of_the_agent_is_replayed_from_its_own_start() -> None:
    scenario = parse(KILLED, overrides={"duration_s": "2.5"})
    lives = flown_again(scenario, 1).lives
    assert [life.setup.incarnation for life in lives] == [0, 1]
    shown = list(steps(lives, Span(0.5, 9.0)))
    assert {step.incarnation for step in shown} == {0, 1}
    assert not any(0.65 < step.senses.now_s < 1.0 for step in shown)


def test_a_controller_keeps_the_memory_of_the_steps_before() -> None:
    scenario = parse(SMALL, overrides={"control.controller": f"{__name__}:Forgetful"})
    lives = LifeRecorder(0)
    fleet = VirtualFleet(scenario, tap=lives)
    for _ in range(4 * 25):
        fleet.slot()
    (first, *_) = steps(lives.lives, Span(1.0, 1.2))
    assert first.intent.signals["asked"] == 21.0


def flown(folder: Path, *settings: str) -> Path:
    file, out = folder / "small.toml", folder / "run"
    file.write_text(SMALL)
    options = [part for each in ("duration_s=2", *settings) for part in ("--set", each)]
    command(["sim", str(file), "--out", str(out), "--no-recording", *options])
    return out


def test_a_step_is_told_as_text_and_as_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = flown(tmp_path)
    capsys.readouterr()
    assert command(["replay", str(run), "--agent", "1", "--from", "0.5", "--to", "0.6"]) == 0
    told = capsys.readouterr()
    assert told.out.count(" s  at (") == 2
    assert "  hears  a0 " in told.out
    assert told.err == ""
    asked = ["replay", str(run), "--agent", "1", "--from", "0.5", "--to", "0.6", "--json"]
    assert command(asked) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [0.5 <= row["senses"]["now_s"] <= 0.6 for row in rows] == [True, True]
    assert rows[0]["intent"]["velocity"] == pytest.approx(rows[0]["velocity"], abs=1.0)


def test_the_debugger_stops_in_decide_and_quits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    controller = f"{__name__}:Forgetful"
    run = flown(tmp_path, f"control.controller={controller}", "duration_s=1")
    monkeypatch.setattr(sys, "stdin", io.StringIO("p senses.now_s\nc\np self._asked\nq\n"))
    capsys.readouterr()
    assert command(["replay", str(run), "--agent", "0", "--from", "0.5", "--pdb"]) == 0
    told = capsys.readouterr().out
    assert "decide()" in told
    assert "(Pdb) 0.5" in told
    assert "(Pdb) 11" in told
    assert told.count(" s  at (") == 1


def test_a_run_that_flies_otherwise_today_is_doubted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = flown(tmp_path)
    summary = json.loads((run / "summary.json").read_text())
    (run / "summary.json").write_text(json.dumps({**summary, "trace_sha256": "0" * 64}))
    capsys.readouterr()
    assert command(["replay", str(run), "--agent", "0", "--to", "0"]) == 0
    assert "flown again, the run has another trace" in capsys.readouterr().err


def recorded(folder: Path, run: Path, agent: int) -> None:
    """Let a run look as one of `qswarm run --record-inputs` does."""
    scenario = load(run / "scenario.toml")
    (run / "inputs").mkdir()
    keep_code(run / "inputs", scenario.control)
    (life,) = flown_again(scenario, agent).lives
    log, core = InputLog(run / "inputs", life.setup), Agent(life.setup)
    for frames, observation, _ in life.steps:
        log.hear(frames)
        log.step(observation)
        for frame in frames:
            core.receive(frame.source, frame.channel, frame.payload, observation.time_s)
        log.answer(encode(core.step(observation).command))
    log.close()


DRIFTS = """
from agent.controller import Intent
class Drifts:
    services = ()
    def __init__(self, setup): pass
    def decide(self, senses):
        v = ({}, 0.0, 0.0)
        return Intent(v, v, 0.0, 0.1, senses.position)
"""


def test_a_replay_of_recorded_inputs_says_what_has_changed_since(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    package = tmp_path / "drifting.py"
    package.write_text(DRIFTS.format("0.1"))
    run = flown(tmp_path, "control.controller=drifting:Drifts", "duration_s=1")
    recorded(tmp_path, run, 1)
    asked = ["replay", str(run), "--agent", "1", "--from", "0.5", "--to", "0.6"]

    capsys.readouterr()
    assert command(asked) == 0
    assert capsys.readouterr().err == "agent 1 decides as in the run, at 12 steps up to here\n"

    package.write_text(DRIFTS.format("0.1 + 0.2 * (senses.now_s > 0.3)"))
    for name in [name for name in sys.modules if name == "drifting"]:
        del sys.modules[name]
    assert command(asked) == 0
    told = capsys.readouterr().err.splitlines()
    assert told[0] == (
        f"{run}: the code of the controller 'drifting:Drifts' has changed since the run;"
        " today's is asked about what the agent was given then"
    )
    assert told[1].startswith("agent 1 decides otherwise than in the run from 0.312 s on: it wants")
    assert told[1].endswith("wants (0.3, 0, 0), not (0.1, 0, 0)")

    kept = run / "inputs" / "code.json"
    kept.write_text(json.dumps({**json.loads(kept.read_text()), "agent_sha256": "0" * 64}))
    package.write_text(DRIFTS.format("0.1"))
    assert command(asked) == 0
    assert "the code of qswarm's agents has changed since the run" in capsys.readouterr().err
    kept.unlink()
    assert command(asked) == 0
    assert "which code it flew is not recorded" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--agent", "7"], "the run has the agents 0 to 1"),
        (["--agent", "0", "--from", "50"], "no step from 50 s: none comes later"),
        (["--agent", "0", "--from", "1", "--to", "0.5"], "is before --from"),
        (["--agent", "0", "--from", "nan"], "nan"),
        (["--agent", "1", "--from", "0.52", "--to", "0.53"], "the next is at 0.562 s"),
    ],
)
def test_what_cannot_be_replayed_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], why: str
) -> None:
    run = flown(tmp_path)
    capsys.readouterr()
    assert command(["replay", str(run), *arguments]) == 2
    assert why in capsys.readouterr().err


def test_a_free_running_fleet_and_a_folder_without_a_run_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = flown(tmp_path)
    summary = json.loads((run / "summary.json").read_text())
    (run / "summary.json").write_text(json.dumps({**summary, "mode": "processes"}))
    capsys.readouterr()
    assert command(["replay", str(run), "--agent", "0"]) == 2
    assert "run it with --record-inputs or --lockstep" in capsys.readouterr().err
    assert command(["replay", str(tmp_path), "--agent", "0"]) == 2
    assert "no scenario.toml in it" in capsys.readouterr().err


def test_a_failure_in_flight_is_found_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = flown(tmp_path, f"control.controller={__name__}:Forgetful")
    capsys.readouterr()
    assert command(["replay", str(run), "--agent", "0", "--from", "1.4"]) == 1
    assert "ZeroDivisionError: the count is in the way" in capsys.readouterr().err
    monkeypatch.setattr(sys, "stdin", io.StringIO("c\n" * 3 + "p self._asked\nq\n"))
    command(["replay", str(run), "--agent", "0", "--from", "1.4", "--pdb"])
    told = capsys.readouterr().out
    assert "ZeroDivisionError: the count is in the way" in told
    assert "(Pdb) 31" in told
