"""Runs in virtual time from the command line: progress, verdict or table, exit status."""

from collections import Counter
from pathlib import Path

from netem.wire.shutdown import StopRequest, stop_requests
from worldsim.campaign.pool import Job, simulate, sweep
from worldsim.results.exit_status import EXIT_STATUS, INTERRUPTED
from worldsim.results.overall import Made, over_all
from worldsim.results.progress_line import ProgressLine
from worldsim.results.run_folder import RunDirectoryError, make_folder, write_json
from worldsim.results.verdict_text import table, verdict
from worldsim.scenario.tables import Scenario


def simulate_one(scenario: Scenario, out: Path | None, recording: bool) -> int:
    """Make one run and print its verdict; return the exit status. Raises RunDirectoryError.

    Ctrl-C ends it early; the verdict on what was simulated is printed and kept all the same.
    """
    line = ProgressLine()
    with stop_requests() as stop:
        folder, summary = simulate(
            Job(scenario, out, recording),
            stop,
            lambda time_s: line.update(f"{time_s:.1f} of {scenario.duration_s:g} s simulated"),
        )
    line.clear()
    print(verdict(summary, folder, recording))
    return INTERRUPTED if stop.requested else EXIT_STATUS[summary["outcome"]]


def simulate_many(
    scenarios: list[Scenario], out: Path | None, recording: bool, workers: int
) -> int:
    """Make many runs, each in its own folder within ``out``, and print a table over all.

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
    with stop_requests() as stop:
        results = _results(jobs, workers, stop)
    overall = over_all(results, len(jobs) if stop.requested else None)
    write_json(folder / "summary.json", overall)
    print(table(overall, folder))
    return INTERRUPTED if stop.requested else EXIT_STATUS[overall["outcome"]]


def _results(jobs: list[Job], workers: int, stop: StopRequest) -> list[Made]:
    line = ProgressLine()
    results: list[Made] = []
    for result in sweep(jobs, workers, stop):
        results.append(result)
        passed = sum(each.outcome == "pass" for each in results)
        line.update(f"{len(results)} of {len(jobs)} runs done, {passed} passed")
    line.clear()
    order = {job.folder: index for index, job in enumerate(jobs)}
    return sorted(results, key=lambda made: order[made.folder])
