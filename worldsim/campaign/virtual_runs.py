"""Runs in virtual time as a person starts them: progress, verdict or table, exit status."""

from collections import Counter
from pathlib import Path

from netem.wire.shutdown import StopRequest, stop_requests
from worldsim.campaign.pool import Job, Summary, over_all, simulate, sweep
from worldsim.results.run_folder import RunDirectoryError, make_folder, write_json
from worldsim.results.summary import EXIT_STATUS, INTERRUPTED
from worldsim.results.verdict_text import ProgressLine, table, verdict
from worldsim.scenario.tables import Scenario


def fly_one(scenario: Scenario, out: Path | None, recording: bool) -> int:
    """Fly one run and print its verdict; return the exit status. Raises RunDirectoryError.

    Ctrl-C ends it early; its verdict is told and kept all the same.
    """
    line = ProgressLine()
    with stop_requests() as stop:
        summary = simulate(
            Job(scenario, out, recording),
            stop,
            lambda loop: line.tell(f"{loop.world.time_s:.1f} of {scenario.duration_s:g} s flown"),
        )
    line.clear()
    print(verdict(summary, Path(summary["folder"]), recording))
    return INTERRUPTED if stop.requested else EXIT_STATUS[summary["outcome"]]


def fly_many(scenarios: list[Scenario], out: Path | None, recording: bool, workers: int) -> int:
    """Fly many runs, each into a folder of its own within ``out``, and print a table over all.

    Returns the exit status. Raises RunDirectoryError; two runs of one name and seed are refused.
    """
    names = [f"{scenario.name}-seed{scenario.seed}" for scenario in scenarios]
    name, count = Counter(names).most_common(1)[0]
    if count > 1:
        raise RunDirectoryError(Path(name), "would be written twice; give scenarios other names")
    folder = make_folder(out, scenarios[0].name)
    jobs = [
        Job(scenario, folder / name, recording)
        for scenario, name in zip(scenarios, names, strict=True)
    ]
    with stop_requests() as stop:
        done = _flown(jobs, workers, stop)
    overall = over_all(done, stop.requested)
    write_json(folder / "summary.json", overall)
    print(table(overall, folder))
    return INTERRUPTED if stop.requested else EXIT_STATUS[overall["outcome"]]


def _flown(jobs: list[Job], workers: int, stop: StopRequest) -> list[Summary]:
    line = ProgressLine()
    done: list[Summary] = []
    for summary in sweep(jobs, workers, stop):
        done.append(summary)
        passed = sum(each["outcome"] == "pass" for each in done)
        line.tell(f"{len(done)} of {len(jobs)} runs flown, {passed} passed")
    line.clear()
    return done
