"""The command line, ``qswarm COMMAND``: its groups of commands, errors and exit status.

A command checks its whole input before it starts anything. Bad input is one line on stderr and
exit status 2. A command imports what it needs when it is called, so that --help stays quick.
"""

import gc
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.main import get_command

from worldsim.commands import (
    bench,
    doctor,
    inspect,
    netem,
    operate,
    replay,
    results,
    run,
    scenario,
    search,
    sweep,
)
from worldsim.commands.options import complain, examples
from worldsim.commands.usage_errors import usage_text
from worldsim.results.environment import folder_is_gone, prepare_environment
from worldsim.results.exit_status import (
    BAD_INPUT,
    FAIL,
    INCONCLUSIVE,
    INTERRUPTED,
    OUTPUT_CLOSED,
    PASS,
)
from worldsim.results.output_streams import flushed_stdout, open_streams

app = typer.Typer(
    name="qswarm",
    help="Chaos testing for swarm controllers. qswarm runs a fleet of agents over an emulated"
    " radio, as real processes or in virtual time, injects faults, and checks what the scenario"
    " expects.",
    epilog=examples(
        "qswarm run --list",
        "qswarm sim wedge-9",
        "qswarm run wedge-9 --set netem.loss_percent=50",
        "qswarm COMMAND --help",
    )
    + "\n\nExit status: 0 all expectations met; 1 an expectation not met or an invariant violated;"
    " 2 bad input, nothing started; 3 inconclusive: the host was too slow, the run ended early"
    " or was too short, a fault struck nothing, or results were lost;"
    " 130 interrupted.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
for group in (
    run,
    sweep,
    search,
    scenario,
    inspect,
    replay,
    results,
    netem,
    operate,
    bench,
    doctor,
):
    app.add_typer(group.commands)


def _print_version(requested: bool) -> None:
    if requested:
        from worldsim.results.provenance import provenance, version_text

        print(version_text(provenance()))
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            is_eager=True,
            callback=_print_version,
            help="Print the version, with its commit where known, and exit.",
        ),
    ] = False,
) -> None:
    """Take the options that stand before the command."""


def main() -> None:
    """Run the command line of this process, and exit with its status."""
    # A run makes few reference cycles, so the collector may look for them less often.
    gc.set_threshold(200_000)
    open_streams()
    prepare_environment()
    # A user's own controller is imported from the current folder, after everything installed.
    with suppress(FileNotFoundError):  # a folder that was removed holds no controller
        sys.path.append(str(Path.cwd()))
    try:
        status = command(sys.argv[1:])
    except KeyboardInterrupt:
        status = _interrupted()
    out = flushed_stdout()
    if out.failure is not None:
        complain(f"qswarm: stdout cannot be written: {out.failure}")
        status = status or FAIL
    if out.reader_gone:
        # What read the output has ended, as in `qswarm check wedge-9 | head`.
        status = OUTPUT_CLOSED
    sys.exit(status)


def command(arguments: list[str]) -> int:
    """Run one command line and return its exit status; bad input is reported in one line."""
    from worldsim.campaign.flight_site import SiteError
    from worldsim.campaign.pool import FailedFlightError
    from worldsim.fleet.process_table import OperatorError
    from worldsim.recording.viewer import ViewerError
    from worldsim.results.run_folder import RunDirectoryError, RunWriteError
    from worldsim.scenario.toml import ScenarioError

    typed: Any = get_command(app)
    names = tuple(typed.commands)
    try:
        status = typed(arguments, prog_name="qswarm", standalone_mode=False)
    except (ScenarioError, RunDirectoryError, SiteError, ViewerError, OperatorError) as error:
        complain(" ".join(str(error).splitlines()))
        return INCONCLUSIVE if isinstance(error, RunWriteError) else BAD_INPUT
    except typer.TyperException as error:
        complain(usage_text(error, arguments, names))
        return BAD_INPUT
    except FailedFlightError as error:
        complain(f"{error.details}qswarm: {error}")
        return FAIL
    except (typer.Abort, KeyboardInterrupt):
        return _interrupted()
    except OSError as error:
        gone = folder_is_gone()
        complain(f"qswarm: {'the current folder was removed' if gone else error}")
        return BAD_INPUT if gone else FAIL
    return int(status or PASS)


def _interrupted() -> int:
    complain("qswarm: interrupted")
    return INTERRUPTED
