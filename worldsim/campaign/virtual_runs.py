"""Runs in virtual time from the command line: progress, verdict or table, exit status."""

import sys
from collections import Counter
from pathlib import Path
from time import monotonic

from netem.wire.shutdown import StopRequest, stop_requests
from worldsim.campaign.pool import FailedFlightError, Job, simulate, sweep
from worldsim.results.closing import Output
from worldsim.results.exit_status import INTERRUPTED, INTERRUPTION
from worldsim.results.overall import Cut, FailedRun, Made, is_cut_off, over_all
from worldsim.results.progress_line import ProgressLine, pace_text
from worldsim.results.run_folder import (
    RunDirectoryError,
    RunWriteError,
    make_folder,
    room_reserved,
    write_json,
)
from worldsim.results.same_twice import verify_twice
from worldsim.scenario.tables import Scenario

ROW_B = 2048
"""Room for a run's row in the summary over all runs [bytes]."""
HEAD_B = 16 * 1024
"""Room for the rest of it [bytes]."""


def simulate_one(
    scenario: Scenario, out: Path | None, recording: bool, output: Output, trace: bool = False
) -> int:
    """Make one run and tell its outcome; return the exit status. Raises RunDirectoryError.

    Ctrl-C ends it early; the verdict on what was simulated is printed and kept all the same. trace:
    whether the trace is kept as a file.
    """
    line, began_s = ProgressLine(hidden=output.quiet), monotonic()
    again = "again: " if output.silent else ""
    with stop_requests() as stop:
        try:
            result = simulate(
                Job(scenario, out, recording, trace),
                stop,
                lambda time_s: line.update(again + _pace(time_s, scenario.duration_s, began_s)),
            )
        except (FailedFlightError, RunWriteError) as error:
            run = _failed(scenario, error)
            output.fail(run)
            if not run.cut_off:
                raise
            line.clear()
            print(f"{INTERRUPTION}: {run.error}", file=sys.stderr)
            return INTERRUPTED
    line.clear()
    status = output.conclude(result, recording)
    return INTERRUPTED if stop.requested else status


def simulate_twice(scenario: Scenario, out: Path, recording: bool, output: Output) -> int:
    """Make one run twice and compare the traces; return the exit status: 1 where they differ."""
    status = simulate_one(scenario, out, recording, output, trace=True)

    def again(folder: Path) -> int:
        silent = output._replace(silent=True, junit=None)
        return simulate_one(scenario, folder, False, silent, trace=True)

    verified = verify_twice(scenario, out, status, again)
    print(verified.text, file=output.stream)
    return verified.status


def _pace(time_s: float, duration_s: float, began_s: float) -> str:
    return pace_text(time_s, duration_s, time_s / max(monotonic() - began_s, 1e-9))


def _failed(scenario: Scenario, error: FailedFlightError | RunWriteError) -> FailedRun:
    if isinstance(error, FailedFlightError):
        return error.run
    folder, reason = error.args
    return FailedRun(folder, scenario.name, scenario.seed, reason, outcome="inconclusive")


def simulate_many(
    scenarios: list[Scenario], out: Path | None, recording: bool, workers: int, output: Output
) -> int:
    """Make many runs, each in its own folder within ``out``, and tell the outcome over all.

    A disk that fills up between two runs ends them; the table tells of those that were made.
    Returns the exit status. Raises RunDirectoryError, also for two runs of one name and seed.
    """
    names = [f"{scenario.name}-seed{scenario.seed}" for scenario in scenarios]
    name, count = Counter(names).most_common(1)[0]
    if count > 1:
        raise RunDirectoryError(Path(name), "would be written twice; rename one of the scenarios")
    folder = make_folder(out, scenarios[0].name)
    jobs = [
        Job(scenario, folder / name, recording)
        for scenario, name in zip(scenarios, names, strict=True)
    ]
    with stop_requests() as stop, room_reserved(folder, HEAD_B + ROW_B * len(jobs)):
        results, lost = _results(jobs, workers, stop, ProgressLine(hidden=output.quiet))
    scenario_of = {job.folder: job.scenario for job in jobs}
    ended = sum(is_cut_off(each, scenario_of[each.folder]) for each in results)
    cut_off_by = INTERRUPTION if stop.requested else lost
    cut = None if cut_off_by is None else Cut(cut_off_by, len(jobs), ended)
    overall = over_all(results, cut)
    write_json(folder / "summary.json", overall)
    status = output.conclude_many(results, overall, folder)
    return INTERRUPTED if stop.requested else status


def _results(
    jobs: list[Job], workers: int, stop: StopRequest, line: ProgressLine
) -> tuple[list[Made], str | None]:
    """Return the results in the order of the jobs, and why no further run could begin."""
    results: list[Made] = []
    lost: str | None = None
    try:
        for result in sweep(jobs, workers, stop):
            results.append(result)
            passed = sum(each.outcome == "pass" for each in results)
            line.update(f"{len(results)} of {len(jobs)} runs done, {passed} passed")
    except RunWriteError as error:
        lost = str(error)
    line.clear()
    order = {job.folder: index for index, job in enumerate(jobs)}
    return sorted(results, key=lambda made: order[made.folder]), lost
