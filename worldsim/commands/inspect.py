"""The commands that look at a run: ``verify`` and ``view`` its recording, ``ps`` its processes."""

from typing import Annotated

import typer

from worldsim.commands.options import Recordings, RunFolder, complain, examples
from worldsim.results.exit_status import FAIL, PASS

commands = typer.Typer()


@commands.command(epilog=examples("qswarm verify runs/wedge-9-20260102T030405Z"))
def verify(run: RunFolder) -> int:
    """Recompute the verdict of a run from its recording alone.

    The figures are compared with summary.json, scenario.toml and events.jsonl with the recording;
    any difference is printed. A run that has not
    finished, that proves nothing, is damaged, or differs is inconclusive: exit status 3.
    """
    from worldsim.recording.verify import verify as verify_run
    from worldsim.results.verdict_text import verified

    verification = verify_run(run)
    if verification.problem is not None:
        complain(verification.problem)
    else:
        print(verified(verification))
    return verification.exit_status


@commands.command(
    epilog=examples(
        "qswarm view runs/wedge-9-20260102T030405Z",
        "qswarm view runs/clean runs/lossy",
        "qswarm view runs/twenty --web",
    )
)
def view(
    runs: Recordings,
    web: Annotated[
        bool,
        typer.Option("--web", help="Use a browser instead of a window; served on this host only."),
    ] = False,
) -> int:
    """Open recordings in the rerun viewer.

    Two are shown side by side, on one time line. Of more, one is shown at a time: choose in the
    viewer's left panel, whose button is at the top right. Nothing is asked of other hosts, nor told
    to them. A run that is still going on is shown as far as it was when the viewer started; see
    qswarm run --live.
    """
    from worldsim.recording.side_by_side import joined
    from worldsim.recording.viewer import recordings, shortcomings
    from worldsim.recording.viewer import view as show

    found = recordings(runs)
    for line in shortcomings(found):
        complain(line)
    with joined(found) as shown:
        return PASS if show(shown, web) == 0 else FAIL


@commands.command(epilog=examples("qswarm ps runs/wedge-9-20260102T030405Z"))
def ps(run: RunFolder) -> int:
    """List the processes of a run: name, pid, alive or gone.

    zygote is the process that starts the agents, as copies of itself.
    """
    from worldsim.fleet.process_table import processes

    rows = processes(run)
    print(f"{'name':12} {'pid':>8}  state")
    for name, pid, alive in rows:
        print(f"{name:12} {pid:>8}  {'alive' if alive else 'gone'}")
    return PASS
