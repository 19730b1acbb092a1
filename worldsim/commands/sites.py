"""Where the flights of a command are flown: on this host, or on a cluster."""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from worldsim.campaign.flight_site import FlightSite
    from worldsim.scenario.tables import Scenario

FlightsAtOnce = Annotated[
    int | None,
    typer.Option("--jobs", metavar="N", min=1, help="Flights at once.", show_default="all cores"),
]
Cluster = Annotated[
    str | None,
    typer.Option(
        metavar="tcp://HOST:PORT",
        help="Fly on this Dask cluster instead of this host (needs qswarm[cluster]).",
    ),
]


def workers_of(jobs: int | None) -> int:
    """Return how many flights are flown at once: as --jobs says, or one on each usable core."""
    return jobs or len(os.sched_getaffinity(0))


def local_site(jobs: int | None, scratch: Path) -> "FlightSite":
    """Return this host. scratch: a folder for what flights write; it is removed after them."""
    from worldsim.campaign.flight_site import LocalSite

    return LocalSite(workers_of(jobs), scratch)


@contextmanager
def flight_site(
    cluster: str | None, jobs: int | None, scenarios: "Iterable[Scenario]", scratch: Path
) -> "Iterator[FlightSite]":
    """Yield where flights are flown.

    scenarios: those whose controllers a cluster must have. Raises typer.BadParameter for a number
    of jobs with a cluster, SiteError where that cannot fly them.
    """
    if cluster is None:
        yield local_site(jobs, scratch)
        return
    if jobs is not None:
        raise typer.BadParameter("its workers decide that (--jobs)", param_hint="--cluster")
    from worldsim.campaign.cluster_site import ClusterSite
    from worldsim.results.controller_code import user_controllers

    site = ClusterSite(cluster, user_controllers(scenarios))
    try:
        yield site
    finally:
        site.close()
