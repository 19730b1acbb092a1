"""Runs in virtual time, one or many: each in a process of its own, in its own folder.

A stop request ends the active runs between two slots. Each of them writes a summary of what it
has simulated so far; runs that have not begun leave nothing. What a run's controllers start ends
with the run.
"""

import selectors
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from agent.controller import FaultyControllerError
from netem.compiled import tell_if_unfit
from netem.wire.shutdown import StopRequest
from worldsim.campaign.flight import finished
from worldsim.campaign.watched_flight import Job, WatchedFlight
from worldsim.fleet.fork import adopt_orphans, children, end_orphans
from worldsim.results.overall import FailedRun, Made, Result
from worldsim.results.run_folder import RunDirectoryError, RunWriteError

__all__ = ["FailedFlightError", "Job", "finished", "simulate", "sweep"]

POLL_EVERY_S = 0.2


class FailedFlightError(FaultyControllerError):
    """A run failed; ``details`` holds the traceback, where there is one, ``run`` the run."""

    def __init__(self, run: FailedRun) -> None:
        super().__init__(run.error)
        self.run = run
        self.details = run.details


def simulate(
    job: Job, stop: StopRequest, on_progress: Callable[[float], None] = lambda _: None
) -> Result:
    """Make one run, and write its folder. A stop request ends it early, and inconclusive.

    on_progress: called now and then with the simulated time [s]. Raises RunDirectoryError when the
    folder exists or cannot be written, RunWriteError when the summary cannot, FailedFlightError
    when the run fails before its end, or does not end on the request.
    """
    (made,) = _Pool([job], 1, stop, on_progress).results()
    if isinstance(made, FailedRun):
        if made.outcome == "inconclusive" and not made.cut_off:
            raise RunWriteError(made.folder, made.error)
        raise FailedFlightError(made)
    return made


def sweep(
    jobs: Iterable[Job],
    workers: int,
    stop: StopRequest,
    on_poll: Callable[[], None] = lambda: None,
) -> Iterator[Made]:
    """Make many runs, up to ``workers`` at once; yield each result as soon as it is there.

    A job is taken when there is room for it: it may depend on results that were yielded before. An
    error fails its run alone. After a stop request no further run begins. on_poll: called now and
    then during each run; what it raises ends all of them. Raises RunDirectoryError where the first
    run's folder cannot be written; where that of a later one cannot, RunWriteError, once the active
    runs have ended.
    """
    return _Pool(jobs, workers, stop, lambda _: on_poll()).results()


class _Ready(NamedTuple):
    flight: WatchedFlight
    printed: bool  # output to read; otherwise an exit


class _Waiting:
    """The jobs that wait, each taken when it is needed."""

    def __init__(self, jobs: Iterable[Job]) -> None:
        self._jobs = iter(jobs)
        self._next: Job | None = None

    def __bool__(self) -> bool:
        if self._next is None:
            self._next = next(self._jobs, None)
        return self._next is not None

    def pop(self) -> Job | None:
        job, self._next = self._next, None
        return job

    def clear(self) -> None:
        self._jobs, self._next = iter(()), None


class _Pool:
    """The flights that are active, and the jobs that wait."""

    def __init__(
        self,
        jobs: Iterable[Job],
        workers: int,
        stop: StopRequest,
        on_progress: Callable[[float], None],
    ) -> None:
        tell_if_unfit()
        self._waiting = _Waiting(jobs)
        self._workers = workers
        self._stop = stop
        self._on_progress = on_progress
        self._flights: list[WatchedFlight] = []
        self._selector = selectors.DefaultSelector()
        self._others = children()
        self._begun = False
        self._lost: RunWriteError | None = None
        """Why no further run can begin."""

    def results(self) -> Iterator[Made]:
        """Yield each run's result as soon as it is there."""
        with self._all_ended():
            while self._flights or (self._waiting and not self._stop.requested):
                while self._may_begin() and (job := self._waiting.pop()) is not None:
                    self._begin(job)
                yield from self._poll()
        if self._lost is not None:
            raise self._lost

    def _may_begin(self) -> bool:
        room = len(self._flights) < self._workers
        return room and bool(self._waiting) and not self._stop.requested

    def _begin(self, job: Job) -> None:
        try:
            flight = WatchedFlight(job)
        except RunDirectoryError as error:
            if not self._begun:
                raise
            self._lost = RunWriteError(*error.args)
            self._waiting.clear()
            return
        self._begun = True
        self._flights.append(flight)
        self._selector.register(flight.output, selectors.EVENT_READ, _Ready(flight, True))
        self._selector.register(flight.exit_descriptor, selectors.EVENT_READ, _Ready(flight, False))

    def _poll(self) -> Iterator[Made]:
        for key, _ in self._selector.select(POLL_EVERY_S):
            ready: _Ready = key.data
            if ready.printed and not ready.flight.output.pass_on():
                self._selector.unregister(ready.flight.output)
        for flight in list(self._flights):
            if self._stop.requested:
                flight.request_stop()
            self._on_progress(flight.time_s)
            if flight.check():
                yield self._ended(flight)

    def _ended(self, flight: WatchedFlight) -> Made:
        self._flights.remove(flight)
        self._selector.unregister(flight.exit_descriptor)
        if flight.output.fileno() in self._selector.get_map():
            self._selector.unregister(flight.output)
        self._end_orphans()
        return flight.result()

    def _end_orphans(self) -> None:
        end_orphans(self._others.union(flight.pid for flight in self._flights))

    @contextmanager
    def _all_ended(self) -> Iterator[None]:
        """Leave no process behind, however this block is left."""
        adopt_orphans()
        try:
            yield
        finally:
            for flight in self._flights:
                flight.kill()
            self._flights.clear()
            self._end_orphans()
            adopt_orphans(False)
            self._selector.close()
