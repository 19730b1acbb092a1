"""Runs in virtual time, one or many: each into its own folder, and a summary over many.

A stop request ends the active runs between two slots. Each of them writes a summary of what it
has simulated so far; runs that have not begun leave nothing.
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import NamedTuple

from agent.checked_controller import FaultyControllerError
from netem.wire.shutdown import StopRequest
from worldsim.engine.step import SlotLoop
from worldsim.engine.virtual import Flight, fly
from worldsim.results.overall import FailedRun, Made, Result
from worldsim.results.run_folder import RunDirectory
from worldsim.results.sinks import open_sinks
from worldsim.results.summary import FinishedRun, summarise
from worldsim.scenario.tables import Scenario

POLL_EVERY_S = 0.2


class Job(NamedTuple):
    """One run to make."""

    scenario: Scenario
    folder: Path | None  # a new folder; None: one named after the scenario and the time
    recording: bool


def simulate(
    job: Job, stop: StopRequest, on_progress: Callable[[SlotLoop], None] | None = None
) -> Result:
    """Make one run, and write its folder. A stop request ends it early, and inconclusive.

    Raises RunDirectoryError when the folder exists or cannot be written.
    """
    scenario = job.scenario
    directory = RunDirectory.create(job.folder, scenario)
    sinks = open_sinks(directory, scenario, directory.path.name, "virtual", job.recording)
    try:
        flight = fly(scenario, sinks, on_progress=on_progress, should_stop=lambda: stop.requested)
    finally:
        sinks.close()
    summary = summarise(scenario, finished(flight, scenario))
    return Result(directory.path, directory.write_summary(summary))


def finished(flight: Flight, scenario: Scenario) -> FinishedRun:
    """Return a flight in virtual time for its summary; no tick can be late there."""
    world = flight.loop.world
    return FinishedRun(
        mode="virtual",
        loop=flight.loop,
        medium_counters=flight.medium_counters,
        late_tick_fraction=0.0,
        real_time_factor=world.time_s / flight.wall_s,
        cut_off_by="interrupted" if world.slot < scenario.slots else None,
    )


def sweep(jobs: list[Job], workers: int, stop: StopRequest) -> Iterator[Made]:
    """Make many runs in up to ``workers`` processes; yield each result as soon as it is there.

    A controller's error fails its run alone. After a stop request no further run begins.
    """
    if workers == 1 or len(jobs) == 1:
        for job in jobs:
            if not stop.requested:
                yield _simulate_or_fail(job, stop)
        return
    with _pool(min(workers, len(jobs))) as pool:
        yield from _results([pool.submit(_in_worker, job) for job in jobs], stop)


def _simulate_or_fail(job: Job, stop: StopRequest) -> Made:
    """Make one run of many; return its result, or the controller's error that ended it."""
    try:
        return simulate(job, stop)
    except FaultyControllerError as error:
        assert job.folder is not None  # each of many runs has a folder of its own
        return FailedRun(job.folder, job.scenario.name, job.scenario.seed, str(error))


def _results(pending: list[Future[Made | None]], stop: StopRequest) -> Iterator[Made]:
    interrupted = False
    while pending:
        done, _ = wait(pending, POLL_EVERY_S, FIRST_COMPLETED)
        completed = [future for future in pending if future in done]
        pending = [future for future in pending if future not in done]
        for future in completed:
            result = _result(future, stop)
            if result is not None:
                yield result
        if stop.requested and not interrupted:
            interrupted = True
            _interrupt(pending)


def _interrupt(pending: list[Future[Made | None]]) -> None:
    for future in pending:
        future.cancel()
    for worker in multiprocessing.active_children():
        worker.terminate()


def _result(future: Future[Made | None], stop: StopRequest) -> Made | None:
    """Return a worker's result; None for a run that did not begin before a stop request."""
    if future.cancelled():
        return None
    try:
        return future.result()
    except BrokenProcessPool:
        # SIGTERM ends a worker that has not installed its handler yet.
        if stop.requested:
            return None
        raise


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Give worker processes that end when this process ends, however it ends."""
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


def _in_worker(job: Job) -> Made | None:
    stop = _stop_of_worker()
    return None if stop.requested else _simulate_or_fail(job, stop)


def _begin_worker() -> None:
    """Ignore Ctrl-C, which the parent passes on as SIGTERM, and end when the parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _stop_of_worker()
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
