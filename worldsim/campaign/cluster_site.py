"""Flights on a Dask cluster that is there already: the same summaries as on this host.

Every worker must have the same code: qswarm, the packages that it needs, and users' controllers.
A flight whose worker dies is flown again by another one; Dask sees to it, and gives one result.
"""

import logging
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from functools import cache
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import Any

from netem.wire.shutdown import StopRequest
from worldsim.campaign.flight_server import FlightServer, ServerEndedError
from worldsim.campaign.flight_site import Flown, Order, SiteError
from worldsim.results.controller_code import UserController, code_sha256
from worldsim.results.provenance import provenance

CONNECT_WITHIN_S = 10.0
WORKERLESS_S = 60.0
"""A cluster without a worker for so long flies no more."""
POLL_S = 0.5
LOOK_EVERY_S = 5.0
AHEAD = 2
"""Orders that wait at the cluster beside those that are flown."""
RETRIES = 3
"""Of a flight whose process ended, not its worker."""
Code = dict[str, str]
"""What must be the same everywhere, by what it is."""


class ClusterSite:
    """The workers of a Dask scheduler; ``close`` it.

    Raises SiteError where it does not answer, has no worker, or a worker has other code.
    """

    def __init__(self, address: str, controllers: Sequence[UserController]) -> None:
        self._distributed = _library()
        self._address = address
        self._controllers = tuple(controllers)
        self._folder = str(Path.cwd())
        began_s = time.monotonic()
        try:
            self._client = self._distributed.Client(
                address, timeout=CONNECT_WITHIN_S, set_as_default=False
            )
        except (OSError, ValueError, ImportError) as error:
            detail = f"no Dask scheduler answers within {CONNECT_WITHIN_S:g} s"
            raise SiteError(f"{address}: {detail}") from error
        try:
            self._check_workers(CONNECT_WITHIN_S - (time.monotonic() - began_s))
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Leave the cluster, which goes on."""
        with suppress(Exception):  # it may be gone
            self._client.close(timeout=2.0)

    def fly(self, orders: Iterable[Order], stop: StopRequest) -> Iterator[Flown]:
        """Yield what each order showed. Raises SiteError where the cluster flies no more."""
        waiting, active = iter(orders), dict[Any, Order]()
        room, looked_s = _Room(self), 0.0
        while not stop.requested:
            if time.monotonic() > looked_s + LOOK_EVERY_S:
                room.look()
                looked_s = time.monotonic()
            for order in islice(waiting, max(0, room.orders - len(active))):
                active[self._submitted(order)] = order
            if not active:
                return
            for future in self._done(list(active)):
                active.pop(future)
                yield self._flown(future)
        for future in active:
            future.cancel()

    def at_once(self) -> int:
        """Return how many threads the workers have. Raises SiteError without a scheduler."""
        try:
            return sum(self._client.nthreads().values())
        except (OSError, RuntimeError) as error:
            raise SiteError(f"{self._address}: does not answer any more") from error

    def _submitted(self, order: Order) -> Any:
        own = code_here(self._controllers, self._folder)
        return self._client.submit(
            fly_on_worker, order, own, self._controllers, self._folder,
            key=f"{self._client.id}-{order.key}", pure=False, retries=RETRIES,
        )  # fmt: skip

    def _done(self, futures: list[Any]) -> list[Any]:
        try:
            with suppress(TimeoutError), self._client.as_current():
                self._distributed.wait(futures, timeout=POLL_S, return_when="FIRST_COMPLETED")
        except CancelledError as error:
            raise SiteError(f"{self._address}: the scheduler is gone") from error
        return [future for future in futures if future.done()]

    def _flown(self, future: Any) -> Flown:
        if future.status == "finished":
            flown: Flown = future.result()
            return flown
        cause = future.exception() if future.status == "error" else future.status
        raise SiteError(f"{self._address}: a flight is lost: {_first_line(cause)}")

    def _check_workers(self, within_s: float) -> None:
        """Raise SiteError where there is no worker in time, or one has other code."""
        try:
            self._client.wait_for_workers(1, timeout=max(1.0, within_s))
        except TimeoutError as error:
            detail = f"has no worker within {CONNECT_WITHIN_S:g} s"
            raise SiteError(f"{self._address}: {detail}") from error
        try:
            found = self._client.run(code_here, self._controllers, self._folder)
        except Exception as error:  # what a worker raises comes back as it is
            detail = f"a worker cannot fly for qswarm: {_first_line(error)}"
            raise SiteError(f"{self._address}: {detail}") from error
        own = code_here(self._controllers, self._folder)
        for worker, code in sorted(found.items()):
            other = differing(own, code)
            if other is not None:
                raise SiteError(f"{self._address}: the worker {worker} has other code: {other}")


class _Room:
    """How many orders the cluster takes; it may have no worker for a while."""

    def __init__(self, site: ClusterSite) -> None:
        self._site = site
        self._seen_s = time.monotonic()
        self.orders = 0

    def look(self) -> None:
        """Ask the cluster. Raises SiteError where it has had no worker for long."""
        threads, now_s = self._site.at_once(), time.monotonic()
        self._seen_s = now_s if threads else self._seen_s
        if now_s - self._seen_s > WORKERLESS_S:
            raise SiteError(f"the cluster has had no worker for {WORKERLESS_S:g} s")
        self.orders = threads + AHEAD if threads else self.orders


_own = threading.local()


def fly_on_worker(
    order: Order, code: Code, controllers: Sequence[UserController], folder: str
) -> Flown:
    """Fly an order in the process of this thread of a worker.

    Raises SiteError where this worker's code is not that of who asks, ServerEndedError where the
    process ended.
    """
    other = differing(code, code_here(controllers, folder))
    if other is not None:
        raise SiteError(f"a worker has other code: {other}")
    if getattr(_own, "server", None) is None:
        _own.server = FlightServer(folder)
    server: FlightServer = _own.server
    try:
        return server.fly(order)
    except ServerEndedError:
        _own.server = None
        raise


def code_here(controllers: Sequence[UserController], folder: str) -> Code:
    """Return what this process would fly with. folder: where users' controllers may be."""
    return dict(_code(tuple(controllers), folder))


def differing(one: Code, other: Code) -> str | None:
    """Return the first difference between two codes in words; None: there is none."""
    for name in sorted(one.keys() | other.keys()):
        if one.get(name) != other.get(name):
            return f"{name} {other.get(name)}, here {one.get(name)}"
    return None


@cache
def _code(controllers: tuple[UserController, ...], folder: str) -> tuple[tuple[str, str], ...]:
    known = provenance()
    packages = {f"the package {name}": str(each) for name, each in known["packages"].items()}
    own = {f"the controller {each}": code_sha256(*each, folder) for each in controllers}
    return tuple(
        {
            "qswarm": f"{known['version']} (commit {known['commit']})",
            "Python": known["python"],
            **packages,
            **own,
        }.items()
    )


def _library() -> ModuleType:
    """Return the package ``distributed``, silenced. Raises SiteError without it."""
    try:
        import distributed  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise SiteError("--cluster needs a package: pip install 'qswarm[cluster]'") from error
    for name in logging.root.manager.loggerDict:
        if name.partition(".")[0] == "distributed":  # errors are told here, in one line
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    library: ModuleType = distributed
    return library


def _first_line(error: object) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
