"""The command that asks one agent's controller again: ``replay``."""

from math import inf
from typing import TYPE_CHECKING, Annotated

import typer

from worldsim.commands.options import RunFolder, complain, examples
from worldsim.results.exit_status import BAD_INPUT, FAIL, PASS

if TYPE_CHECKING:
    from worldsim.replay.decisions import DecisionComparison
    from worldsim.replay.replay import Replay
    from worldsim.replay.steps import Span

commands = typer.Typer()


@commands.command(
    epilog=examples(
        "qswarm replay runs/mine --agent 3 --from 12",
        "qswarm replay runs/mine --agent 3 --from 12 --to 12.5 --json | jq .intent",
        "qswarm replay runs/mine --agent 3 --from 12 --pdb",
    )
)
def replay(
    run: RunFolder,
    agent: Annotated[int, typer.Option("--agent", metavar="I", help="The agent's id.", min=0)],
    from_s: Annotated[
        float, typer.Option("--from", metavar="T", help="First simulated time [s].", min=0.0)
    ] = 0.0,
    to_s: Annotated[
        float | None,
        typer.Option("--to", metavar="T", help="Last simulated time [s].", show_default="the end"),
    ] = None,
    pdb: Annotated[
        bool,
        typer.Option("--pdb", help="Stop in the Python debugger at each decide, and at an error."),
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="A line of JSON for each step.")] = False,
) -> int:
    """Ask one agent's controller again, with all that it sensed in a run.

    A run in virtual time or in lockstep is flown again for that, and its trace compared; one of
    `qswarm run --record-inputs` has it all in its folder, also free-running: there `replay` says if
    the controller has changed since, and where it first decides otherwise. Each step shows where
    the agent was, whom it heard, what it wanted, and what the safety filter made of it.
    """
    from worldsim.replay.decisions import DecisionComparison
    from worldsim.replay.replay import ReplayError, replay_of
    from worldsim.replay.steps import Span
    from worldsim.results.progress_line import ProgressLine
    from worldsim.scenario.toml import ScenarioError

    span = Span(from_s, inf if to_s is None else to_s)
    if span.to_s < span.from_s:
        raise typer.BadParameter(f"{to_s:g} is before --from {from_s:g}", param_hint="--to")
    progress = ProgressLine()
    try:
        found = replay_of(
            run, agent, lambda now_s, all_s: progress.update(f"{now_s:.1f} of {all_s:g} s again")
        )
    except (ReplayError, ScenarioError) as error:
        progress.clear()
        complain(str(error))
        return BAD_INPUT
    progress.clear()
    if pdb and found.scenario.control.command is not None:
        complain("--pdb: the controller is a program of its own; --json shows what it is told")
        return BAD_INPUT
    if found.doubt is not None:
        complain(f"{run}: {found.doubt}")
    compared = DecisionComparison()
    status = _show(found, span, compared, pdb, json)
    if compared.text is not None:
        complain(f"agent {agent} {compared.text}")
    return status


def _show(
    found: "Replay", span: "Span", compared: "DecisionComparison", pdb: bool, json: bool
) -> int:
    """Print the steps of a span; return the exit status."""
    from agent.controller import FaultyControllerError
    from agent.lines import SensesLines
    from worldsim.replay.debugger import StepDebugger
    from worldsim.replay.text import step_json, step_text

    debugger = StepDebugger() if pdb else None
    ask = debugger.ask if debugger is not None else None
    lines, shown = SensesLines(found.scenario.fleet.agents), 0
    try:
        for step in found.steps(span, ask, compared):
            print(step_json(step, lines) if json else step_text(step), flush=pdb)
            shown += 1
    except FaultyControllerError as error:
        if debugger is not None and debugger.left:
            return PASS
        complain(str(error))
        return FAIL
    if shown == 0:
        next_s = found.next_step_s(span.from_s)
        later = "none comes later" if next_s is None else f"the next is at {next_s:.3f} s"
        until = "" if span.to_s == inf else f" to {span.to_s:g} s"
        complain(f"the agent has no step from {span.from_s:g} s{until}: {later}")
        return BAD_INPUT
    return PASS
