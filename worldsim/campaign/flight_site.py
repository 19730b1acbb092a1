"""Where flights are flown: an order goes in anywhere, the same summary comes out.

A search or a sweep gives its orders to a site and takes what was flown, in any order. A site takes
an order when it has room for it, so that an order may depend on what was flown before. A flight
leaves nothing but what is returned; its scenario with its seed repeats it.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from shutil import rmtree
from typing import NamedTuple, Protocol

from netem.wire.shutdown import StopRequest
from worldsim.campaign.flight import FlightProbe
from worldsim.campaign.pool import Job, sweep
from worldsim.results.outcome import Outcome
from worldsim.results.overall import FailedRun, Made, is_cut_off
from worldsim.results.run_folder import RunWriteError
from worldsim.results.summary import Summary
from worldsim.scenario.tables import Scenario


class SiteError(Exception):
    """A site cannot fly, or no longer; one line with its name and the reason."""


class Order(NamedTuple):
    """One flight to fly.

    probe: looks into the flight, in its process. wanted: names of the files to be returned.
    """

    key: str  # names it among the others; letters, digits and dashes
    scenario: Scenario
    probe: FlightProbe | None = None
    wanted: tuple[str, ...] = ()


class Flown(NamedTuple):
    """What one flight showed; without a summary where an error ended it, a controller's as a rule.

    details: the traceback of such an error, where there is one. files: what was wanted, by name.
    """

    key: str
    outcome: Outcome
    reason: str | None
    summary: Summary | None
    details: str = ""
    files: Mapping[str, bytes] = {}


class FlightSite(Protocol):
    """Flies orders."""

    def at_once(self) -> int:
        """Return how many flights can be flown at once. Raises SiteError where that is unknown."""

    def fly(self, orders: Iterable[Order], stop: StopRequest) -> Iterator[Flown]:
        """Yield what each order showed, as soon as it is there.

        After a stop request no further order is taken, and a flight that it cuts off yields
        nothing. Raises SiteError, or RunDirectoryError, where the site can fly no more.
        """


class LocalSite:
    """Processes of this host.

    workers: flights at once. scratch: a folder for what they write; it is removed after them.
    on_poll: called now and then during a flight; what it raises ends all.
    """

    def __init__(
        self, workers: int, scratch: Path, on_poll: Callable[[], None] = lambda: None
    ) -> None:
        self._workers = workers
        self._scratch = scratch
        self._on_poll = on_poll

    def at_once(self) -> int:
        """Return the number of workers."""
        return self._workers

    def fly(self, orders: Iterable[Order], stop: StopRequest) -> Iterator[Flown]:
        """Yield what each order showed.

        Raises RunDirectoryError without room in ``scratch``, RunWriteError once it is full.
        """
        active: dict[Path, Order] = {}

        def jobs() -> Iterator[Job]:
            for order in orders:
                folder = self._scratch / order.key
                active[folder] = order
                yield Job(order.scenario, folder, recording=False, probe=order.probe)

        rmtree(self._scratch, ignore_errors=True)  # of a sweep that was killed
        try:
            for made in sweep(jobs(), self._workers, stop, self._on_poll):
                order = active.pop(made.folder)
                cut_off = stop.requested and is_cut_off(made, order.scenario)
                if isinstance(made, FailedRun) and made.outcome == "inconclusive" and not cut_off:
                    raise RunWriteError(made.folder, made.error)  # no flight: it is flown again
                flown = flown_of(order, made)
                rmtree(made.folder, ignore_errors=True)
                if not cut_off:
                    yield flown
        finally:
            rmtree(self._scratch, ignore_errors=True)


def flown_of(order: Order, made: Made) -> Flown:
    """Return what a run of a campaign showed, with the files that are wanted of it."""
    if isinstance(made, FailedRun):
        return Flown(order.key, made.outcome, made.error, None, made.details)
    paths = {name: made.folder / name for name in order.wanted}
    files = {name: path.read_bytes() for name, path in paths.items() if path.exists()}
    return Flown(order.key, made.outcome, made.summary["reason"], made.summary, files=files)
