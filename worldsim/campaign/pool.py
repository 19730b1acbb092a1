"""Runs in virtual time, one or many: each into its folder, many with a summary over all.

Who is asked to stop ends the runs in flight between slots: each writes a summary of what there was,
and runs that have not begun leave nothing.
"""

import multiprocessing
import os
import signal
import statistics
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from netem.wire.shutdown import StopRequest
from worldsim.engine.step import SlotLoop
from worldsim.engine.virtual import fly
from worldsim.results.run_folder import RunDirectory
from worldsim.results.sinks import open_sinks
from worldsim.results.summary import summarise
from worldsim.scenario.tables import Scenario

Summary = dict[str, Any]
LOOK_EVERY_S = 0.2


class Job(NamedTuple):
    """One run to fly: the scenario, where to, and whether to record it."""

    scenario: Scenario
    folder: Path | None
    recording: bool


def simulate(
    job: Job, stop: StopRequest, on_progress: Callable[[SlotLoop], None] | None = None
) -> Summary:
    """Fly one run into a new folder; return its summary and, under ``folder``, where it is.

    It ends early when ``stop`` is asked for, inconclusive.
    Raises RunDirectoryError when the folder exists or cannot be written.
    """
    scenario = job.scenario
    directory = RunDirectory.create(job.folder, scenario)
    notes = open_sinks(directory, scenario, directory.path.name, "virtual", job.recording)
    try:
        flight = fly(scenario, notes, on_progress=on_progress, unwanted=lambda: stop.requested)
    finally:
        notes.close()
    flown_s = flight.loop.world.time_s
    summary = summarise(
        scenario,
        flight.loop,
        mode="virtual",
        medium_counters=flight.medium_counters,
        late_tick_fraction=0.0,
        real_time_factor=flown_s / flight.wall_s,
        duration_s=flown_s,
        interrupted=flight.loop.world.slot < scenario.slots,
        host_too_slow=False,
    )
    directory.write_summary(summary)
    return {**summary, "folder": str(directory.path)}


def sweep(jobs: list[Job], workers: int, stop: StopRequest) -> Iterator[Summary]:
    """Fly many runs in up to ``workers`` processes; yield each summary as it is done.

    When ``stop`` is asked for, the runs in flight are the last.
    """
    if workers == 1 or len(jobs) == 1:
        for job in jobs:
            if not stop.requested:
                yield simulate(job, stop)
        return
    with _pool(min(workers, len(jobs))) as pool:
        yield from _done([pool.submit(_in_worker, job) for job in jobs], stop)


def _done(pending: list[Future[Summary | None]], stop: StopRequest) -> Iterator[Summary]:
    interrupted = False
    while pending:
        done, _ = wait(pending, LOOK_EVERY_S, FIRST_COMPLETED)
        finished = [future for future in pending if future in done]
        pending = [future for future in pending if future not in done]
        for future in finished:
            summary = _result(future, stop)
            if summary is not None:
                yield summary
        if stop.requested and not interrupted:
            interrupted = True
            _interrupt(pending)


def _interrupt(pending: list[Future[Summary | None]]) -> None:
    for future in pending:
        future.cancel()
    for worker in multiprocessing.active_children():
        worker.terminate()


def _result(future: Future[Summary | None], stop: StopRequest) -> Summary | None:
    """Return what a worker brought; None for a run that an interruption kept from beginning."""
    if future.cancelled():
        return None
    try:
        return future.result()
    except BrokenProcessPool:
        # A worker that is told to end before it can hear of it just ends.
        if stop.requested:
            return None
        raise


def over_all(summaries: Iterable[Summary], interrupted: bool = False) -> Summary:
    """Return the summary over many runs, by scenario, with a row for each run."""
    rows = sorted(summaries, key=lambda summary: (summary["scenario"], summary["seed"]))
    names = sorted({row["scenario"] for row in rows})
    outcomes = [row["outcome"] for row in rows] + ["inconclusive"] * interrupted
    return {
        "schema": 1,
        "mode": "virtual",
        "runs": len(rows),
        "outcome": next((bad for bad in ("fail", "inconclusive") if bad in outcomes), "pass"),
        "reason": "interrupted" if interrupted else None,
        "scenarios": [_of_scenario(name, rows) for name in names],
        "rows": [_row(row) for row in rows],
    }


def _of_scenario(name: str, rows: list[Summary]) -> Summary:
    mine = [_row(row) for row in rows if row["scenario"] == name]
    figures = ("min_separation_m", "converge_s", "residual_m", "turns_over_limit_fraction")
    return {
        "scenario": name,
        "runs": len(mine),
        **{
            outcome: sum(row["outcome"] == outcome for row in mine)
            for outcome in ("pass", "fail", "inconclusive")
        },
        **{figure: _spread([row[figure] for row in mine]) for figure in figures},
    }


def _row(summary: Summary) -> Summary:
    """Return a run's line: of several formations the slowest and the worst residual count."""
    phases = summary["phases"]
    return {
        "run": Path(summary["folder"]).name,
        "scenario": summary["scenario"],
        "seed": summary["seed"],
        "outcome": summary["outcome"],
        "reason": summary["reason"],
        "min_separation_m": summary["min_separation_m"],
        "converge_s": _worst([phase["converge_s"] for phase in phases]),
        "residual_m": _worst([phase["residual_m"] for phase in phases]),
        "turns_over_limit_fraction": summary["turns_over_limit_fraction"],
        "real_time_factor": summary["real_time_factor"],
        "trace_sha256": summary["trace_sha256"],
    }


def _worst(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return max(known) if len(known) == len(values) and known else None


def _spread(values: list[float | None]) -> Summary | None:
    """Return least, median and greatest of what was measured, and in how many runs it was."""
    known = [value for value in values if value is not None]
    if not known:
        return None
    return {
        "min": min(known),
        "median": statistics.median(known),
        "max": max(known),
        "measured": len(known),
    }


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Worker processes that end with this one, however it ends."""
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin_worker)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
    pool.shutdown()


@cache
def _stop_of_worker() -> StopRequest:
    return StopRequest()


def _in_worker(job: Job) -> Summary | None:
    stop = _stop_of_worker()
    return None if stop.requested else simulate(job, stop)


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent, who asks by SIGTERM, and go when the parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _stop_of_worker()
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
