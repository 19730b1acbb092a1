"""Runs in virtual time as a person starts them: progress, verdict or table, exit status."""

from collections import Counter
from pathlib import Path

from worldsim.run.rundir import RunDirectoryError, make_folder, write_json
from worldsim.run.summary import EXIT_STATUS
from worldsim.run.sweep import Job, Summary, over_all, simulate, sweep
from worldsim.scenario.tables import Scenario
from worldsim.show.telling import ProgressLine, table, verdict


def fly_one(scenario: Scenario, out: Path | None, recording: bool) -> int:
    """Fly one run and print its verdict; return the exit status. Raises RunDirectoryError."""
    line = ProgressLine()
    summary = simulate(
        Job(scenario, out, recording),
        lambda loop: line.tell(f"{loop.world.time_s:.1f} of {scenario.duration_s:g} s flown"),
    )
    line.clear()
    print(verdict(summary, Path(summary["folder"]), recording))
    return EXIT_STATUS[summary["outcome"]]


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
    overall = over_all(_flown(jobs, workers))
    write_json(folder / "summary.json", overall)
    print(table(overall, folder))
    return EXIT_STATUS[overall["outcome"]]


def _flown(jobs: list[Job], workers: int) -> list[Summary]:
    line = ProgressLine()
    done: list[Summary] = []
    for summary in sweep(jobs, workers):
        done.append(summary)
        passed = sum(each["outcome"] == "pass" for each in done)
        line.tell(f"{len(done)} of {len(jobs)} runs flown, {passed} passed")
    line.clear()
    return done
