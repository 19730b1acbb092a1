"""A replay of one agent's controller: found in a run's folder, and checked against its trace."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from agent.input_log import InputLogError, Life, logged_lives
from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS, admit
from worldsim.recording.layout import SUMMARY_FILE
from worldsim.replay.decisions import DecisionComparison
from worldsim.replay.flown_again import flown_again
from worldsim.replay.steps import Ask, Span, Step, steps
from worldsim.results.flown_code import code_of, kept_code
from worldsim.results.run_folder import INPUTS
from worldsim.scenario.file import load
from worldsim.scenario.tables import Scenario

SCENARIO_FILE = "scenario.toml"
REPEATABLE = ("virtual", "lockstep")


class ReplayError(Exception):
    """A run that cannot be replayed, or an agent that it does not have; one line says why."""


class Replay(NamedTuple):
    """What is needed to ask one agent's controller again."""

    scenario: Scenario
    lives: list[Life]
    doubt: str | None
    """Why it may not be what happened in the run, or ends early; None: it is."""

    def next_step_s(self, from_s: float) -> float | None:
        """Return the time of the agent's first step from a time on [s]; None: it has none."""
        times_s = (each.observation.time_s for life in self.lives for each in life.steps)
        return next((time_s for time_s in times_s if time_s >= from_s), None)

    def steps(
        self, span: Span, ask: Ask | None = None, compared: DecisionComparison | None = None
    ) -> Iterator[Step]:
        """Yield the steps of a span; see worldsim.replay.steps."""
        return steps(self.lives, span, ask, compared)


def replay_of(
    run: Path, agent: int, on_progress: Callable[[float, float], None] = lambda *_: None
) -> Replay:
    """Return the replay of an agent of a run.

    run: its folder. on_progress: takes how far the flight is, and how long it is [s; simulated
    time]. Raises ReplayError, and ScenarioError for a scenario that cannot be flown.
    """
    file = run / SCENARIO_FILE
    if not file.is_file():
        raise ReplayError(f"{run}: not a run's folder: no {SCENARIO_FILE} in it")
    scenario = admit(load(file), file, VIRTUAL_COMMAND_TICKS)
    if not 0 <= agent < scenario.rows:
        raise ReplayError(f"--agent {agent}: the run has the agents 0 to {scenario.rows - 1}")
    summary = _summary(run / SUMMARY_FILE)
    recorded = _recorded(run, agent)
    if recorded:
        doubts = (_other_code(run, scenario), _cut(recorded))
        return Replay(scenario, recorded, "; ".join(filter(None, doubts)) or None)
    mode = summary.get("mode", "virtual")
    if mode not in REPEATABLE:
        raise ReplayError(
            f"{run}: a free-running fleet flies no flight twice, so what agent {agent} was given"
            " is not known; run it with --record-inputs or --lockstep, or in virtual time"
        )
    again = flown_again(scenario, agent, lambda time_s: on_progress(time_s, scenario.duration_s))
    if not again.lives:
        raise ReplayError(f"{run}: agent {agent} never started")
    return Replay(scenario, again.lives, again.failure or _doubt(summary, again.trace_sha256))


def _recorded(run: Path, agent: int) -> list[Life]:
    """Return what an agent's processes were given, where they kept it."""
    try:
        return logged_lives(run / INPUTS, agent)
    except InputLogError as error:
        raise ReplayError(str(error)) from error


def _other_code(run: Path, scenario: Scenario) -> str | None:
    """Return what code has changed since a run that kept its agents' inputs; None: none has."""
    kept = kept_code(run / INPUTS)
    if kept is None:
        return "which code it flew is not recorded: the controller may have changed since"
    changes = kept.changes_to(code_of(scenario.control))
    if changes is None:
        return None
    return f"{changes} since the run; today's is asked about what the agent was given then"


def _cut(lives: list[Life]) -> str | None:
    """Return where the log of a process is cut off; None where all are whole."""
    for life in lives:
        if life.cut:
            end_s = life.steps[-1].observation.time_s if life.steps else 0.0
            return f"what process {life.setup.incarnation} was given is cut off after {end_s:.3f} s"
    return None


def _doubt(summary: dict[str, Any], trace_sha256: str) -> str | None:
    trace = summary.get("trace_sha256")
    if trace is None:
        return "the run has no trace to compare with: it may have flown otherwise"
    if trace == trace_sha256:
        return None
    commit = str(summary.get("commit"))[:12]
    return (
        "flown again, the run has another trace: the controller, qswarm or a package has changed"
        f" since (the run is of commit {commit}); what follows is the flight of today"
    )


def _summary(file: Path) -> dict[str, Any]:
    try:
        content = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}
