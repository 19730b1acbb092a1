"""A fleet in lockstep, flown twice to see whether its traces are equal."""

import signal
from pathlib import Path

from netem.wire.shutdown import SIGNALS
from worldsim.fleet.launcher import run
from worldsim.fleet.process import RunOptions
from worldsim.results.closing import Output
from worldsim.results.run_folder import RunDirectory
from worldsim.results.same_twice import verify_twice
from worldsim.scenario.tables import Scenario


def run_twice(
    scenario: Scenario, directory: RunDirectory, options: RunOptions, output: Output
) -> int:
    """Run a fleet twice and compare the traces; return the exit status: 1 where they differ."""
    handlers = {number: signal.getsignal(number) for number in SIGNALS}
    kept = options._replace(trace=True)
    status = run(scenario, directory, kept, output)

    def again(folder: Path) -> int:
        # The launcher ignores signals once its fleet has ended; this one can be interrupted too.
        for number, handler in handlers.items():
            signal.signal(number, handler)
        silent = output._replace(silent=True, quiet=True, junit=None)
        second = RunDirectory.create(folder, scenario)
        return run(scenario, second, kept._replace(recording=False), silent)

    verified = verify_twice(scenario, directory.path, status, again)
    print(verified.text, file=output.stream)
    return verified.status
