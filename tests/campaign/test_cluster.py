"""Flights elsewhere: the process that flies for a worker, and what a cluster may answer.

The library of the cluster is played by a stand-in, whose workers are this process.
"""

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from netem.wire.shutdown import StopRequest, stop_requests
from tests.small_scenario import SMALL
from worldsim.campaign import cluster_site
from worldsim.campaign.cluster_site import ClusterSite
from worldsim.campaign.flight_server import FlightServer, ServerEndedError
from worldsim.campaign.flight_site import Flown, LocalSite, Order, SiteError
from worldsim.scenario.file import parse

ADDRESS = "tcp://10.0.0.5:8786"


def order(key: str, seed: int = 1) -> Order:
    return Order(key, parse(SMALL, overrides={"duration_s": "1.0", "seed": str(seed)}))


@pytest.fixture
def stop() -> Iterator[StopRequest]:
    with stop_requests() as requests:
        yield requests


def test_a_flight_shows_the_same_wherever_it_is_flown(tmp_path: Path, stop: StopRequest) -> None:
    server = FlightServer(str(tmp_path))
    there = [server.fly(order("a")), server.fly(order("b", seed=2))]
    here = list(LocalSite(2, tmp_path / "here").fly([order("a"), order("b", seed=2)], stop))
    for one, other in zip(there, sorted(here), strict=True):
        assert one.summary is not None
        assert other.summary is not None
        assert one.key == other.key
        assert one.summary["trace_sha256"] == other.summary["trace_sha256"]
    server._process.kill()
    with pytest.raises(ServerEndedError):
        server.fly(order("c"))
    server.close()


class Future:
    """A flight at the stand-in's cluster."""

    def __init__(self, work: Callable[[], Flown]) -> None:
        self.status, self._work = "finished", work
        self.cancelled = False

    def done(self) -> bool:
        return True

    def result(self) -> Flown:
        return self._work()

    def cancel(self) -> None:
        self.cancelled = True


class Client:
    """The stand-in for distributed.Client: ``workers`` have the code that they say."""

    id = "client"
    workers: dict[str, dict[str, str]]
    submitted: list[Order]

    def __init__(self, address: str, **_: Any) -> None:
        if address != ADDRESS:
            raise OSError("timed out")

    def wait_for_workers(self, _count: int, timeout: float) -> None:
        assert timeout <= cluster_site.CONNECT_WITHIN_S
        if not self.workers:
            raise TimeoutError

    def run(self, code: Callable[..., dict[str, str]], *given: Any) -> dict[str, dict[str, str]]:
        return {name: code(*given) | other for name, other in self.workers.items()}

    def nthreads(self) -> dict[str, int]:
        return dict.fromkeys(self.workers, 1)

    def submit(self, _work: Any, given: Order, *_: Any, **__: Any) -> Future:
        self.submitted.append(given)
        return Future(lambda: Flown(given.key, "pass", None, None))

    @contextmanager
    def as_current(self) -> Iterator[None]:
        yield

    def close(self, timeout: float) -> None:
        pass


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    Client.workers, Client.submitted = {"one": {}, "two": {}}, []
    library = SimpleNamespace(Client=Client, wait=lambda *_, **__: None)
    monkeypatch.setitem(sys.modules, "distributed", library)
    return library


@pytest.mark.usefixtures("library")
def test_orders_are_taken_when_there_is_room_and_flown_once(stop: StopRequest) -> None:
    flown: list[str] = []

    def orders() -> Iterator[Order]:
        for index in range(9):
            # Two workers of one thread, and AHEAD: a later order can know of earlier flights.
            assert len(flown) >= index - 2 - cluster_site.AHEAD
            yield Order(f"o{index}", order("x").scenario)

    for each in ClusterSite(ADDRESS, []).fly(orders(), stop):
        flown.append(each.key)
    assert sorted(flown) == [f"o{index}" for index in range(9)]
    assert len(Client.submitted) == 9


@pytest.mark.usefixtures("library")
def test_after_a_stop_request_nothing_is_taken(stop: StopRequest) -> None:
    stop.requested = True
    assert list(ClusterSite(ADDRESS, []).fly([order("a")], stop)) == []
    assert Client.submitted == []


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(
    ("address", "workers", "says"),
    [
        ("tcp://10.0.0.6:1", {}, "tcp://10.0.0.6:1: no Dask scheduler answers within 10 s"),
        (ADDRESS, {}, f"{ADDRESS}: has no worker within 10 s"),
        (
            ADDRESS,
            {"one": {}, "two": {"Python": "2.7"}},
            f"{ADDRESS}: the worker two has other code: Python 2.7, here 3",
        ),
    ],
)
def test_a_cluster_that_cannot_fly_is_refused(
    address: str, workers: dict[str, dict[str, str]], says: str
) -> None:
    Client.workers = workers
    with pytest.raises(SiteError) as refused:
        ClusterSite(address, [])
    assert str(refused.value).startswith(says)


def test_a_cluster_that_goes_away_is_told(library: SimpleNamespace, stop: StopRequest) -> None:
    def gone(*_: Any, **__: Any) -> None:
        raise CancelledError

    library.wait = gone
    with pytest.raises(SiteError, match="the scheduler is gone"):
        list(ClusterSite(ADDRESS, []).fly([order("a")], stop))


def test_without_the_library_its_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SiteError, match=r"pip install 'qswarm\[cluster\]'"):
        ClusterSite(ADDRESS, [])
